//! Values: operations on values, equal ones shared.

use super::Value;
use super::op::Op;
use crate::ids::Table;
use hashbrown::HashTable;
use rustc_hash::FxBuildHasher;
use std::hash::BuildHasher;

/// On what a value depends, as a set.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Reads(u8);

impl Reads {
    /// Nothing but constants and parameters.
    pub const PARAMETERS: Reads = Reads(0);
    /// Time.
    pub const TIME: Reads = Reads(1);
    /// States, inputs, held signals, conserved constants.
    pub const STATE: Reads = Reads(2);
    /// The guess of a Newton block.
    pub const GUESS: Reads = Reads(4);

    /// Both.
    pub fn with(self, other: Reads) -> Reads {
        Reads(self.0 | other.0)
    }
    /// This without the other.
    pub fn without(self, other: Reads) -> Reads {
        Reads(self.0 & !other.0)
    }
    /// Whether it includes the other.
    pub fn includes(self, other: Reads) -> bool {
        self.0 & other.0 == other.0 && other.0 != 0
    }
}

/// All values, each reading those before it.
#[derive(Debug, Clone, Default)]
pub struct Values {
    ops: Table<Value, Op>,
    reads: Vec<Reads>,
    known: HashTable<Value>,
}

impl Values {
    /// The value of an operation; equal operations are one value. For a solution, `reads` is what its block reads.
    pub(super) fn add(&mut self, op: Op, reads: Reads) -> Value {
        let Values { ops, known, .. } = self;
        let hash = |op: &Op| FxBuildHasher.hash_one(op);
        let at = hash(&op);
        if let Some(&known) = known.find(at, |&value| ops[value] == op) {
            return known;
        }
        let mut all = reads;
        op.for_each_operand(|v| all = all.with(self.reads(v)));
        self.reads.push(all);
        let value = self.ops.push(op);
        let Values { ops, known, .. } = self;
        known.insert_unique(at, value, |&value| hash(&ops[value]));
        value
    }
    /// The value of an operation, if there is one.
    pub fn find(&self, op: Op) -> Option<Value> {
        self.known.find(FxBuildHasher.hash_one(op), |&value| self.ops[value] == op).copied()
    }
    /// The operation of a value.
    pub fn op(&self, value: Value) -> Op {
        self.ops[value]
    }
    /// On what a value depends.
    pub fn reads(&self, value: Value) -> Reads {
        self.reads[value.0 as usize]
    }
    /// The number that the value is, if it is a constant.
    pub fn constant(&self, value: Value) -> Option<f64> {
        match self.op(value) {
            Op::Constant(bits) => Some(bits.number()),
            _ => None,
        }
    }
    /// Values and operations, in order.
    pub fn iter(&self) -> impl DoubleEndedIterator<Item = (Value, Op)> {
        self.ops.iter().map(|(v, &op)| (v, op))
    }
    /// How many there are.
    pub fn len(&self) -> usize {
        self.ops.len()
    }
    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.ops.is_empty()
    }
}
