//! Rates in two parts: what inputs, or some of the states, do not move, and what they do.

use super::op::Op;
use super::values::Reads;
use super::{Block, Program, Routine, Value};
use crate::ids::Id;

/// The rates, where all is there that something does not move.
#[derive(Debug, Clone)]
pub struct RatesInParts {
    /// What they read that does not move, and that more than parameters determine.
    pub known: Vec<Value>,
    /// What computes them from these; the known values are [givens](super::Arg::Given) in it. Divisors that move are guarded.
    pub rest: Routine,
}

impl Program {
    /// The rates in two parts: what no input moves is known as soon as time, states, held signals and constants are.
    pub fn rates_ahead(&self) -> RatesInParts {
        self.rates_moved(&self.moved_by_inputs())
    }

    /// The rates in two parts: beside a state, where only these of its numbers are others, the first part holds.
    pub fn rates_beside(&self, states: &[usize]) -> RatesInParts {
        self.rates_moved(&self.moved_by_states(states))
    }

    fn rates_moved(&self, moves: &[bool]) -> RatesInParts {
        let moved = |v: Value| moves[v.index()];
        let guards = self.watches_of(false).into_iter().filter(|&guard| {
            let guard = &self.pivot_guards[guard as usize];
            moved(guard.pivot) || moved(guard.scale)
        });
        let guards: Vec<u32> = guards.collect();
        let rates: Vec<Value> = self.states.iter().map(|s| s.rate).collect();
        let guarded = guards.iter().map(|&guard| &self.pivot_guards[guard as usize]);
        let roots: Vec<Value> = rates.iter().copied().chain(guarded.flat_map(|g| [g.pivot, g.scale])).collect();
        let known = self.known_of(&roots, moves);
        let rest = self.routine_given(&rates, &known, &guards);
        RatesInParts { known, rest }
    }

    /// Whether an input moves it, of each value.
    fn moved_by_inputs(&self) -> Vec<bool> {
        self.moved_by(|op| matches!(op, Op::Input(_)))
    }

    /// Whether one of these states moves it, of each value.
    pub fn moved_by_states(&self, states: &[usize]) -> Vec<bool> {
        let mut among = vec![false; self.states.len()];
        states.iter().for_each(|&state| among[state] = true);
        self.moved_by(|op| matches!(op, Op::State(state) if among[state as usize]))
    }

    fn moved_by(&self, moves: impl Fn(Op) -> bool) -> Vec<bool> {
        let mut moved = vec![false; self.values.len()];
        for (value, op) in self.values.iter() {
            moved[value.index()] = match op {
                _ if moves(op) => true,
                Op::Solution(block, _) => self.blocks[block].reads().any(|v| moved[v.index()]),
                _ => {
                    let mut any = false;
                    op.for_each_operand(|v| any |= moved[v.index()]);
                    any
                }
            };
        }
        moved
    }

    /// Whether something that is looked at where an input jumps may jump with it: conditions and what happens at events, held
    /// signals, nonlinear laws, positions that move on their own, branches of set-valued laws.
    pub fn inputs_jump(&self) -> bool {
        let moved = self.moved_by_inputs();
        let newton = self.values.iter().filter(|(_, op)| match op {
            Op::Solution(block, _) => matches!(self.blocks[*block], Block::Newton { .. }),
            _ => false,
        });
        let mut looked_at: Vec<Value> = newton.map(|(value, _)| value).collect();
        looked_at.extend(self.conditions.values().map(|c| c.operand));
        looked_at.extend(self.clauses.iter().flat_map(|c| c.values()));
        looked_at.extend(self.held.iter().flat_map(|h| [h.source, h.time]));
        looked_at.extend(self.jumps.iter().flat_map(|j| j.values()));
        looked_at.extend(self.positions.iter().filter_map(|p| p.rate));
        looked_at.extend(self.bounds().iter().flat_map(|b| b.values().into_iter().chain(b.compared.concat())));
        looked_at.into_iter().any(|v| moved[v.index()])
    }

    /// The values that do not move, read by what does on the way to the roots, or roots themselves.
    fn known_of(&self, roots: &[Value], moves: &[bool]) -> Vec<Value> {
        let mut needed = vec![false; self.values.len()];
        roots.iter().for_each(|v| needed[v.index()] = true);
        let mut known = Vec::new();
        for (value, op) in self.values.iter().rev() {
            let reads = self.values.reads(value);
            if !needed[value.index()] || op.is_given() || reads == Reads::PARAMETERS {
                continue;
            }
            // What reads the guess of a block that moves is computed with it.
            if !moves[value.index()] && !reads.includes(Reads::GUESS) {
                known.push(value);
                continue;
            }
            match op {
                Op::Solution(block, _) => self.blocks[block].reads().for_each(|v| needed[v.index()] = true),
                _ => op.for_each_operand(|v| needed[v.index()] = true),
            }
        }
        known.reverse();
        known
    }
}
