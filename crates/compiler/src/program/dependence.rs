//! Which states a value reads.

use super::values::{Op, Reads};
use super::{Program, Value};
use crate::ids::Id;
use std::rc::Rc;

type Set = Rc<[u32]>;

impl Program {
    /// Finds what rates and start conditions read; what only moves a condition does not count.
    pub(super) fn find_dependence(&mut self) {
        let sets = self.state_sets();
        let states = self.states.len() as u32;
        let below = |v: Value| sets[v.index()].iter().copied().filter(|&s| s < states).collect();
        self.dependence = self.states.iter().map(|s| below(s.rate)).collect();
        self.start.iter_mut().for_each(|c| c.reads = sets[c.residual.index()].to_vec());
    }

    /// For each value the states, and after them the conserved constants, that it reads.
    fn state_sets(&self) -> Vec<Set> {
        let none: Set = Rc::from([]);
        let states = self.states.len() as u32;
        let mut sets: Vec<Set> = Vec::with_capacity(self.values.len());
        let mut blocks: Vec<Option<Set>> = vec![None; self.blocks.len()];
        for (value, op) in self.values.iter() {
            let set = match op {
                Op::State(i) => Rc::from([i]),
                Op::Conserved(i) => Rc::from([states + i]),
                Op::Side(..) | Op::Floor(..) | Op::Positive(_) => none.clone(),
                Op::Solution(block, _) => {
                    let all = || self.blocks[block].reads().fold(none.clone(), |all, v| union(&all, &sets[v.index()]));
                    blocks[block.index()].get_or_insert_with(all).clone()
                }
                _ if self.values.reads(value) == Reads::PARAMETERS => none.clone(),
                _ => {
                    let mut all = none.clone();
                    op.for_each_operand(|v| all = union(&all, &sets[v.index()]));
                    all
                }
            };
            sets.push(set);
        }
        sets
    }
}

fn union(a: &Set, b: &Set) -> Set {
    if Rc::ptr_eq(a, b) || b.is_empty() || is_within(b, a) {
        return a.clone();
    }
    if a.is_empty() || is_within(a, b) {
        return b.clone();
    }
    let mut both: Vec<u32> = a.iter().chain(b.iter()).copied().collect();
    both.sort_unstable();
    both.dedup();
    both.into()
}

fn is_within(small: &Set, large: &Set) -> bool {
    let mut rest = large.iter();
    small.len() <= large.len() && small.iter().all(|s| rest.any(|l| l == s))
}
