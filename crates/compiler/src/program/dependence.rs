//! Which states a value reads.

use super::dataflow::Dataflow;
use super::op::Op;
use super::values::Reads;
use super::{Position, Value};
use crate::ids::Id;
use crate::sparse::{Columns, Unions};
use smallvec::SmallVec;
use std::collections::BTreeMap;

/// The states, and after them the conserved constants and positions that are found by iteration, that values read; what only
/// moves a condition does not count.
pub(super) struct Dependence {
    /// By value; none for those that were not wanted and that one other value reads.
    sets: Vec<Option<Columns>>,
    states: u32,
}

impl Dependence {
    /// What the wanted values read, of this many states. Positions count as unknowns, the first of them with the number
    /// `positions.0`; where none are named, as what they follow from.
    pub fn new(flow: Dataflow<'_>, states: u32, positions: (u32, &[Position]), wanted: &[Value]) -> Dependence {
        Dependence { sets: flow.state_sets(states, positions, wanted), states }
    }

    /// What a wanted value reads, ascending: states by their index, and after them conserved constants and positions.
    pub fn unknowns_of(&self, value: Value) -> &[u32] {
        self.sets[value.index()].as_ref().expect("what is wanted has its set")
    }

    /// The states that a wanted value reads, ascending.
    pub fn states_of(&self, value: Value) -> Vec<u32> {
        let unknowns = self.unknowns_of(value).iter().copied();
        unknowns.take_while(|&u| u < self.states).collect()
    }
}

impl Dataflow<'_> {
    /// The states, and after them the conserved constants, that each value reads; of values that one other value reads
    /// the set is not kept, so that a long sum has one set.
    fn state_sets(self, states: u32, (first, positions): (u32, &[Position]), wanted: &[Value]) -> Vec<Option<Columns>> {
        let none = Columns::from([]);
        let mut unions = Unions::default();
        let positions: BTreeMap<Value, u32> = positions.iter().map(|p| p.value).zip(first..).collect();
        let readers = self.readers(wanted);
        let mut sets: Vec<Option<Columns>> = Vec::with_capacity(self.values.len());
        let mut blocks: Vec<Option<Columns>> = vec![None; self.blocks.len()];
        for (value, op) in self.values.iter() {
            let set = match op {
                Op::State(i) | Op::Rate(i) => Some(Columns::from([i])),
                Op::Conserved(i) => Some(Columns::from([states + i])),
                Op::Solution(..) if positions.contains_key(&value) => Some(Columns::from([positions[&value]])),
                Op::Sign(..) | Op::Floor(..) | Op::Positive(_) => Some(none.clone()),
                Op::Solution(block, _) => {
                    let all = || self.gathered(&mut unions, &sets, self.blocks[block].reads().collect());
                    Some(blocks[block.index()].get_or_insert_with(all).clone())
                }
                _ if self.values.reads(value) == Reads::PARAMETERS => Some(none.clone()),
                _ if readers[value.index()] == 1 => None,
                _ => Some(self.gathered(&mut unions, &sets, operands(op))),
            };
            sets.push(set);
        }
        sets
    }

    /// How many times a value is read by others, by blocks, and by those who want it, which counts twice.
    fn readers(self, wanted: &[Value]) -> Vec<u32> {
        let mut readers = vec![0; self.values.len()];
        wanted.iter().for_each(|v| readers[v.index()] += 2);
        self.blocks.values().flat_map(|b| b.reads()).for_each(|v| readers[v.index()] += 1);
        self.values.iter().for_each(|(_, op)| op.for_each_operand(|v| readers[v.index()] += 1));
        readers
    }

    /// The union of what values read.
    fn gathered(self, unions: &mut Unions, sets: &[Option<Columns>], mut open: SmallVec<[Value; 4]>) -> Columns {
        let mut parts: SmallVec<[&Columns; 4]> = SmallVec::new();
        while let Some(value) = open.pop() {
            match &sets[value.index()] {
                Some(set) => parts.push(set),
                None => open.extend(operands(self.values.op(value))),
            }
        }
        unions.of(parts)
    }
}

fn operands(op: Op) -> SmallVec<[Value; 4]> {
    let mut all = SmallVec::new();
    op.for_each_operand(|v| all.push(v));
    all
}
