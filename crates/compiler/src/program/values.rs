//! Values: operations on values, equal ones shared.

use super::{BlockId, ConditionId, Value};
use crate::algebra::Function;
use crate::ids::Table;
use rustc_hash::FxHashMap;

/// How a value comes about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Op {
    /// A number, by its bits.
    Constant(u64),
    /// A parameter, by index.
    Parameter(u32),
    /// Time, in s.
    Time,
    /// An input, by index.
    Input(u32),
    /// A held signal, by index.
    Held(u32),
    /// A conserved constant, by index.
    Conserved(u32),
    /// A state, by index.
    State(u32),
    /// The rate of a state that no value gives, by index of the state.
    Rate(u32),
    /// An unknown of a Newton block while it is solved.
    Guess(BlockId, u32),
    /// An unknown of a solve block once it is solved.
    Solution(BlockId, u32),
    /// `-a`.
    Neg(Value),
    /// `a + b`.
    Add(Value, Value),
    /// `a - b`.
    Sub(Value, Value),
    /// `a * b`.
    Mul(Value, Value),
    /// `a / b`.
    Div(Value, Value),
    /// `a^n`, by repeated multiplication.
    Powi(Value, u32),
    /// `a^b`.
    Pow(Value, Value),
    /// A function of one argument; `abs`, `sign` and `floor` only where no condition is held.
    Call(Function, Value),
    /// `atan2`; `min` and `max` only where no condition is held.
    Call2(Function, Value, Value),
    /// 1 if `a > 0`, else 0; never held.
    Positive(Value),
    /// 1 if the held condition says `a > 0`, else 0.
    Side(ConditionId, Value),
    /// The held integer part of `a`.
    Floor(ConditionId, Value),
    /// 1 if neither is 0.
    And(Value, Value),
    /// 1 if one of them is not 0.
    Or(Value, Value),
    /// 1 if it is 0.
    Not(Value),
    /// The second if the first is not 0, else the third.
    Select(Value, Value, Value),
    /// A table (index into `Program::tables`), on the held piece if there is a condition.
    Table(u32, Option<ConditionId>, Value),
    /// The slope of a table.
    TableSlope(u32, Option<ConditionId>, Value),
    /// The derivative of the slope of a table.
    TableCurvature(u32, Option<ConditionId>, Value),
}

impl Op {
    /// Calls `visit` with each value it reads directly; a solution reads its block, which is not visited.
    pub fn for_each_operand(self, mut visit: impl FnMut(Value)) {
        match self {
            Op::Constant(_) | Op::Parameter(_) | Op::Time | Op::Input(_) | Op::Held(_) => {}
            Op::Conserved(_) | Op::State(_) | Op::Rate(_) | Op::Guess(..) | Op::Solution(..) => {}
            Op::Neg(a) | Op::Powi(a, _) | Op::Call(_, a) | Op::Positive(a) | Op::Not(a) => visit(a),
            Op::Side(_, a) | Op::Floor(_, a) | Op::Table(_, _, a) => visit(a),
            Op::TableSlope(_, _, a) | Op::TableCurvature(_, _, a) => visit(a),
            Op::Add(a, b) | Op::Sub(a, b) | Op::Mul(a, b) | Op::Div(a, b) | Op::Pow(a, b) => {
                visit(a);
                visit(b);
            }
            Op::Call2(_, a, b) | Op::And(a, b) | Op::Or(a, b) => {
                visit(a);
                visit(b);
            }
            Op::Select(a, b, c) => {
                visit(a);
                visit(b);
                visit(c);
            }
        }
    }

    /// The same operation on other values.
    pub(super) fn map_operands(self, to: impl Fn(Value) -> Value) -> Op {
        match self {
            Op::Constant(_) | Op::Parameter(_) | Op::Time | Op::Input(_) | Op::Held(_) => self,
            Op::Conserved(_) | Op::State(_) | Op::Rate(_) | Op::Guess(..) | Op::Solution(..) => self,
            Op::Neg(a) => Op::Neg(to(a)),
            Op::Add(a, b) => Op::Add(to(a), to(b)),
            Op::Sub(a, b) => Op::Sub(to(a), to(b)),
            Op::Mul(a, b) => Op::Mul(to(a), to(b)),
            Op::Div(a, b) => Op::Div(to(a), to(b)),
            Op::Powi(a, n) => Op::Powi(to(a), n),
            Op::Pow(a, b) => Op::Pow(to(a), to(b)),
            Op::Call(f, a) => Op::Call(f, to(a)),
            Op::Call2(f, a, b) => Op::Call2(f, to(a), to(b)),
            Op::Positive(a) => Op::Positive(to(a)),
            Op::Side(c, a) => Op::Side(c, to(a)),
            Op::Floor(c, a) => Op::Floor(c, to(a)),
            Op::And(a, b) => Op::And(to(a), to(b)),
            Op::Or(a, b) => Op::Or(to(a), to(b)),
            Op::Not(a) => Op::Not(to(a)),
            Op::Select(a, b, c) => Op::Select(to(a), to(b), to(c)),
            Op::Table(t, c, a) => Op::Table(t, c, to(a)),
            Op::TableSlope(t, c, a) => Op::TableSlope(t, c, to(a)),
            Op::TableCurvature(t, c, a) => Op::TableCurvature(t, c, to(a)),
        }
    }

    /// Whether it stands in a register before any routine runs.
    pub fn is_given(self) -> bool {
        matches!(
            self,
            Op::Constant(_)
                | Op::Parameter(_)
                | Op::Time
                | Op::Input(_)
                | Op::Held(_)
                | Op::Conserved(_)
                | Op::State(_)
                | Op::Rate(_)
        )
    }
}

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
    known: FxHashMap<Op, Value>,
}

impl Values {
    /// The value of an operation; equal operations are one value. For a solution, `reads` is what its block reads.
    pub(super) fn add(&mut self, op: Op, reads: Reads) -> Value {
        if let Some(&known) = self.known.get(&op) {
            return known;
        }
        let mut all = reads;
        op.for_each_operand(|v| all = all.with(self.reads(v)));
        self.reads.push(all);
        let value = self.ops.push(op);
        self.known.insert(op, value);
        value
    }
    /// The value of an operation, if there is one.
    pub fn find(&self, op: Op) -> Option<Value> {
        self.known.get(&op).copied()
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
            Op::Constant(bits) => Some(f64::from_bits(bits)),
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
