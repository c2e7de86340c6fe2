//! What values read: operands, blocks, the values of parameters.

use super::op::Op;
use super::values::{Reads, Values};
use super::{Block, BlockId, Parameter, Program, Value};
use crate::ids::{Id, Table};
use rustc_hash::FxHashSet;

/// Values with what their operations stand for: solutions of blocks, parameters.
#[derive(Clone, Copy)]
pub(super) struct Dataflow<'a> {
    pub values: &'a Values,
    pub blocks: &'a Table<BlockId, Block>,
    pub parameters: &'a [Parameter],
}

impl Program {
    /// What its values read.
    pub(super) fn dataflow(&self) -> Dataflow<'_> {
        Dataflow { values: &self.values, blocks: &self.blocks, parameters: &self.parameters }
    }
}

impl<'a> Dataflow<'a> {
    /// Marks what the wanted values read, themselves included; with what parameters alone determine if `deep`.
    pub fn live(self, wanted: &[Value], deep: bool) -> Vec<bool> {
        self.live_but_for(wanted, deep, &FxHashSet::default())
    }

    /// The same where some values are given, so that what they read is not.
    pub fn live_but_for(self, wanted: &[Value], deep: bool, given: &FxHashSet<Value>) -> Vec<bool> {
        let mut live = vec![false; self.values.len()];
        wanted.iter().for_each(|v| live[v.index()] = true);
        // A large block is read by as many values as it has unknowns.
        let mut seen = vec![false; self.blocks.len()];
        for (value, op) in self.values.iter().rev() {
            let ends = || (!deep && self.values.reads(value) == Reads::PARAMETERS) || given.contains(&value);
            if !live[value.index()] || ends() {
                continue;
            }
            match op {
                Op::Solution(block, _) if std::mem::replace(&mut seen[block.index()], true) => {}
                Op::Solution(block, _) => self.blocks[block].reads().for_each(|v| live[v.index()] = true),
                Op::Parameter(i) => live[self.parameters[i as usize].default.index()] = true,
                _ => op.for_each_operand(|v| live[v.index()] = true),
            }
        }
        live
    }

    /// The operations of what varies of the wanted values and of what they read.
    pub fn varying(self, wanted: &[Value]) -> impl Iterator<Item = Op> + use<'a> {
        let live = self.live(wanted, false);
        self.values.iter().filter(move |(v, _)| live[v.index()]).map(|(_, op)| op)
    }
}
