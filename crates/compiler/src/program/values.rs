//! Values: operations on values, equal ones shared.

use super::Value;
use super::op::{Bits, Op};
use super::samples::{Recognised, Samples};
use crate::algebra::near;
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
    /// As a number.
    pub fn bits(self) -> u8 {
        self.0
    }
    /// What a number stands for.
    pub fn of_bits(bits: u8) -> Reads {
        Reads(bits)
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
    /// What values are at a few points, from the first product on that moving values make.
    samples: Option<Box<Samples>>,
}

/// Values that are made of a list of operations.
#[derive(Debug)]
pub struct ListedValues(Values, Vec<Op>);

impl ListedValues {
    /// None yet, with room for so many.
    pub fn of(count: usize) -> ListedValues {
        let (ops, reads) = (Vec::with_capacity(count), Vec::with_capacity(count));
        ListedValues(Values { reads, known: HashTable::with_capacity(count), ..Values::default() }, ops)
    }

    /// Adds the next; `None` if it is there already, or reads what is not.
    pub fn add(&mut self, op: Op, reads: Reads) -> Option<()> {
        let ListedValues(values, ops) = self;
        let mut is_known = true;
        op.for_each_operand(|v| is_known &= (v.0 as usize) < ops.len());
        let at = spot(op);
        if !is_known || values.known.find(at, |value| ops[value.0 as usize] == op).is_some() {
            return None;
        }
        values.known.insert_unique(at, Value(ops.len() as u32), |value| spot(ops[value.0 as usize]));
        ops.push(op);
        values.reads.push(reads);
        Some(())
    }

    /// All of them.
    pub fn finish(self) -> Values {
        let ListedValues(values, ops) = self;
        Values { ops: ops.into(), ..values }
    }
}

/// Where an operation is looked for: near others of operands of about the same time.
fn spot(op: Op) -> u64 {
    near(FxBuildHasher.hash_one(op), |part| op.for_each_operand(|value| part(value.0)))
}

impl Values {
    /// The value of an operation; equal operations are one value, and so are operations that are found to be equal. For a
    /// solution, `reads` is what its block reads.
    pub(super) fn add(&mut self, op: Op, reads: Reads) -> Value {
        if let Some(known) = self.find(op) {
            return known;
        }
        let mut all = reads;
        op.for_each_operand(|v| all = all.with(self.reads(v)));
        if self.samples.is_none() && self.is_moving_product(op) {
            let mut samples = Samples::default();
            self.ops.values().for_each(|&op| samples.add(op));
            self.samples = Some(Box::new(samples));
        }
        let recognised = self.samples.as_ref().and_then(|samples| samples.recognise(op, all, |v| self.reads(v)));
        match recognised {
            None => self.push(op, all),
            Some(Recognised::Known(value)) => value,
            Some(Recognised::Number(number)) => self.push_once(Op::Constant(Bits::of(number)), Reads::PARAMETERS),
            Some(Recognised::Opposite(value)) => match self.op(value) {
                Op::Neg(value) => value,
                _ => self.push_once(Op::Neg(value), self.reads(value)),
            },
        }
    }

    fn push_once(&mut self, op: Op, reads: Reads) -> Value {
        self.find(op).unwrap_or_else(|| self.push(op, reads))
    }

    fn push(&mut self, op: Op, reads: Reads) -> Value {
        self.reads.push(reads);
        if let Some(samples) = &mut self.samples {
            samples.add(op);
        }
        let value = self.ops.push(op);
        let Values { ops, known, .. } = self;
        known.insert_unique(spot(op), value, |&value| spot(ops[value]));
        value
    }

    /// Whether two values that move are multiplied, or divided by each other.
    fn is_moving_product(&self, op: Op) -> bool {
        let moves = |v: Value| self.reads(v).includes(Reads::STATE) || self.reads(v).includes(Reads::GUESS);
        matches!(op, Op::Mul(a, b) | Op::Div(a, b) if moves(a) && moves(b))
    }

    /// Forgets what values are at a few points, which takes more memory than all the rest.
    pub(super) fn settle(&mut self) {
        self.samples = None;
    }

    /// The value of an operation, if there is one.
    pub fn find(&self, op: Op) -> Option<Value> {
        self.known.find(spot(op), |&value| self.ops[value] == op).copied()
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
