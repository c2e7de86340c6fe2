//! Operations on values, with what is trivial left out.

use super::Value;
use super::op::{Bits, Op};
use super::values::{Reads, Values};

impl Values {
    /// The value of an operation on others.
    pub(super) fn op_of(&mut self, op: Op) -> Value {
        self.add(op, Reads::PARAMETERS)
    }

    /// A constant.
    pub(super) fn number(&mut self, value: f64) -> Value {
        self.op_of(Op::Constant(Bits::of(value)))
    }

    fn is(&self, a: Value, number: f64) -> bool {
        self.constant(a) == Some(number)
    }

    pub(super) fn neg(&mut self, a: Value) -> Value {
        match self.op(a) {
            Op::Neg(b) => b,
            Op::Sub(b, c) => self.op_of(Op::Sub(c, b)),
            Op::Constant(bits) => self.number(-bits.number()),
            _ => self.op_of(Op::Neg(a)),
        }
    }

    pub(super) fn plus(&mut self, a: Value, b: Value) -> Value {
        match () {
            () if self.is(a, 0.0) => b,
            () if self.is(b, 0.0) => a,
            () => match (self.op(a), self.op(b)) {
                (_, Op::Neg(b)) => self.op_of(Op::Sub(a, b)),
                (Op::Neg(a), _) => self.op_of(Op::Sub(b, a)),
                _ => self.op_of(Op::Add(a, b)),
            },
        }
    }

    pub(super) fn minus(&mut self, a: Value, b: Value) -> Value {
        match () {
            () if self.is(a, 0.0) => self.neg(b),
            () if self.is(b, 0.0) => a,
            () => match self.op(b) {
                Op::Neg(b) => self.op_of(Op::Add(a, b)),
                _ => self.op_of(Op::Sub(a, b)),
            },
        }
    }

    pub(super) fn times(&mut self, a: Value, b: Value) -> Value {
        match () {
            () if self.is(a, 1.0) => b,
            () if self.is(b, 1.0) => a,
            () if self.is(a, -1.0) => self.neg(b),
            () if self.is(b, -1.0) => self.neg(a),
            () => self.op_of(Op::Mul(a, b)),
        }
    }

    pub(super) fn over(&mut self, a: Value, b: Value) -> Value {
        if self.is(b, 1.0) { a } else { self.op_of(Op::Div(a, b)) }
    }

    pub(super) fn powi(&mut self, a: Value, n: u32) -> Value {
        match n {
            0 => self.number(1.0),
            1 => a,
            2 => self.op_of(Op::Mul(a, a)),
            3 => {
                let square = self.op_of(Op::Mul(a, a));
                self.op_of(Op::Mul(square, a))
            }
            4 => {
                let square = self.op_of(Op::Mul(a, a));
                self.op_of(Op::Mul(square, square))
            }
            _ => self.op_of(Op::Powi(n, a)),
        }
    }

    pub(super) fn select(&mut self, condition: Value, then: Value, other: Value) -> Value {
        match self.constant(condition) {
            Some(c) => [then, other][usize::from(c == 0.0)],
            None if then == other => then,
            None => self.op_of(Op::Select(condition, then, other)),
        }
    }
}
