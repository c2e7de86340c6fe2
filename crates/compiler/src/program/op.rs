//! The table of operations, and what is made of it for all who compute, write or derive them.
//!
//! [`for_each_op!`](crate::for_each_op) lists every operation once. Whoever treats operations, the interpreter, lanes,
//! machine code, C, derivatives, hands it a macro that makes of the rows what it needs. An operation more is a row more;
//! what a processor does in one instruction machine code lowers itself, the rest it calls.

use super::calculus::{Calculus, Moving, Whether};
use super::{BlockId, ConditionId, Value};
use crate::algebra::Function;

/// The operations, a row each: name, what is fixed in it, and what it reads, each with the name of its derivative and `A`,
/// the kind of operands.
///
/// - `given` stand before anything is computed, or are found by a solve block;
/// - `plain` follow from what they read. `cost` is what they are counted as, `value` the meaning in `f64`, `text` how programs
///   are printed, `c` the expression in C, by what writes it, `k`, `derivative` its rule: of `value`, for the calculus `k`, a
///   number that may be none where nothing moves;
/// - `held` read a condition or a table as well, so whoever runs them has a way of its own.
///
/// The first row names `k` and `value` for the rules.
#[macro_export]
macro_rules! for_each_op {
    ($with:ident) => {
        $with! {
            (k value)
            given {
                /// A number.
                Constant(bits: Bits);
                /// A parameter, by index.
                Parameter(index: u32);
                /// Time, in s.
                Time;
                /// An input, by index.
                Input(index: u32);
                /// A held signal, by index.
                Held(index: u32);
                /// A conserved constant, by index.
                Conserved(index: u32);
                /// A state, by index.
                State(index: u32);
                /// The rate of a state that no value gives, by index of the state.
                Rate(index: u32);
                /// An unknown of a Newton block while it is solved.
                Guess(block: BlockId, index: u32);
                /// An unknown of a solve block once it is solved.
                Solution(block: BlockId, index: u32);
            }
            plain {
                /// `-a`.
                Neg() [a da A] {
                    cost: Addition, value: -a, text: "-{a}", c: k.neg(a),
                    derivative: $crate::program::calculus::opposite(k, da),
                }
                /// `a + b`.
                Add() [a da A, b db A] {
                    cost: Addition, value: a + b, text: "{a} + {b}", c: k.add(a, b),
                    derivative: $crate::program::calculus::sum(k, da, db),
                }
                /// `a - b`.
                Sub() [a da A, b db A] {
                    cost: Addition, value: a - b, text: "{a} - {b}", c: k.sub(a, b),
                    derivative: $crate::program::calculus::difference(k, da, db),
                }
                /// `a * b`.
                Mul() [a da A, b db A] {
                    cost: Multiplication, value: a * b, text: "{a} * {b}", c: k.mul(a, b),
                    derivative: $crate::program::calculus::of_product(k, (a, da), (b, db)),
                }
                /// `a / b`.
                Div() [a da A, b db A] {
                    cost: Division, value: a / b, text: "{a} / {b}", c: k.div(a, b),
                    derivative: $crate::program::calculus::of_quotient(k, value, da, (b, db)),
                }
                /// `a^n`, by repeated multiplication.
                Powi(n: u32) [a da A] {
                    cost: Power, value: $crate::algebra::math::powi(a, n), text: "{a}^{n}", c: k.powi(a, n),
                    derivative: $crate::program::calculus::of_whole_power(k, n, (a, da)),
                }
                /// `a^b`.
                Pow() [a da A, b db A] {
                    cost: Call, value: $crate::algebra::math::pow(a, b), text: "{a} ^ {b}", c: k.pow(a, b),
                    derivative: $crate::program::calculus::of_power(k, value, (a, da), (b, db)),
                }
                /// A function of one argument; `abs`, `sign` and `floor` only where no condition is held.
                Call(f: Function) [a da A] {
                    cost: Call, value: $crate::algebra::math::call(f, a), text: "{f}({a})", c: k.call(f, a),
                    derivative: $crate::program::calculus::of_call(k, f, value, (a, da)),
                }
                /// The angle of the point at `b` along and `a` across.
                Atan2() [a da A, b db A] {
                    cost: Call, value: $crate::algebra::math::atan2(a, b), text: "atan2({a}, {b})", c: k.atan2(a, b),
                    derivative: $crate::program::calculus::of_angle(k, (a, da), (b, db)),
                }
                /// 1 if `a > 0`, else 0; never held.
                Positive() [a da A] {
                    cost: Addition, value: f64::from(a > 0.0), text: "{a} > 0", c: k.positive(a),
                    derivative: $crate::program::calculus::none(k, [da]),
                }
                /// 1 if neither is 0.
                And() [a da A, b db A] {
                    cost: Addition, value: f64::from(a != 0.0 && b != 0.0), text: "{a} and {b}",
                    c: k.and(a, b),
                    derivative: $crate::program::calculus::none(k, [da, db]),
                }
                /// 1 if one of them is not 0.
                Or() [a da A, b db A] {
                    cost: Addition, value: f64::from(a != 0.0 || b != 0.0), text: "{a} or {b}",
                    c: k.or(a, b),
                    derivative: $crate::program::calculus::none(k, [da, db]),
                }
                /// 1 if it is 0.
                Not() [a da A] {
                    cost: Addition, value: f64::from(a == 0.0), text: "not {a}", c: k.not(a),
                    derivative: $crate::program::calculus::none(k, [da]),
                }
                /// The second if the first is not 0, else the third.
                Select() [c dc A, a da A, b db A] {
                    cost: Addition, value: if c != 0.0 { a } else { b }, text: "if {c} then {a} else {b}",
                    c: k.select(c, a, b),
                    derivative: $crate::program::calculus::of_choice(k, (c, dc), da, db),
                }
            }
            held {
                /// 1 if the held condition says `a > 0`, else 0.
                Sign(condition: ConditionId) [a da A] {
                    cost: Addition, text: "c{condition}: {a} > 0",
                    derivative: $crate::program::calculus::none(k, [da]),
                }
                /// The held integer part of `a`.
                Floor(condition: ConditionId) [a da A] {
                    cost: Call, text: "c{condition}: floor({a})",
                    derivative: $crate::program::calculus::none(k, [da]),
                }
                /// A table (index into `Program::tables`), on the held piece if there is a condition.
                Table(table: u32, piece: Option<ConditionId>) [a da A] {
                    cost: Table, text: "table {table} at {a}",
                    derivative: $crate::program::calculus::of_table(k, (table, piece), 1, (a, da)),
                }
                /// The slope of a table.
                TableSlope(table: u32, piece: Option<ConditionId>) [a da A] {
                    cost: Table, text: "slope of table {table} at {a}",
                    derivative: $crate::program::calculus::of_table(k, (table, piece), 2, (a, da)),
                }
                /// The derivative of the slope of a table.
                TableCurvature(table: u32, piece: Option<ConditionId>) [a da A] {
                    cost: Table, text: "curvature of table {table} at {a}",
                    derivative: $crate::program::calculus::of_table(k, (table, piece), 3, (a, da)),
                }
            }
        }
    };
}

/// The bits of a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Bits([u32; 2]);

impl Bits {
    /// Those of a number.
    pub fn of(number: f64) -> Bits {
        let bits = number.to_bits();
        Bits([(bits >> 32) as u32, bits as u32])
    }
    /// The number.
    pub fn number(self) -> f64 {
        f64::from_bits(u64::from(self.0[0]) << 32 | u64::from(self.0[1]))
    }
}

/// What an operation is counted as.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cost {
    /// Nothing: it is there.
    Given,
    /// An addition, a change of sign, a comparison, a choice.
    Addition,
    /// A product.
    Multiplication,
    /// A quotient.
    Division,
    /// Products, by the exponent.
    Power,
    /// A function.
    Call,
    /// A look into a table.
    Table,
}

macro_rules! define {
    (($k:ident $value:ident)
     given { $($(#[$given_doc:meta])* $given:ident$(($($given_part:ident: $given_kind:ty),*))?;)* }
     plain { $($(#[$plain_doc:meta])* $plain:ident($($part:ident: $kind:ty),*) [$($a:ident $da:ident $A:ident),*] {
        cost: $cost:ident, value: $meaning:expr, text: $text:literal, c: $c:expr, derivative: $derivative:expr,
     })* }
     held { $($(#[$held_doc:meta])* $held:ident($($held_part:ident: $held_kind:ty),*) [$x:ident $dx:ident $X:ident] {
        cost: $held_cost:ident, text: $held_text:literal, derivative: $held_derivative:expr,
     })* }) => {
        /// An operation on operands `A`: how a [`Value`] comes about, a step of a routine, an instruction on registers.
        /// First what is fixed in it, then what it reads.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        pub enum Op<A = Value> {
            $($(#[$given_doc])* $given$(($($given_kind),*))?,)*
            $($(#[$plain_doc])* $plain($($kind,)* $($A),*),)*
            $($(#[$held_doc])* $held($($held_kind,)* $X),)*
        }

        impl<A: Copy> Op<A> {
            /// Calls `visit` with each operand that it reads directly; a solution reads its block, which is not visited.
            #[inline]
            pub fn for_each_operand(self, mut visit: impl FnMut(A)) {
                match self {
                    $(Op::$given { .. } => {})*
                    $(Op::$plain($($part,)* $($a),*) => {
                        $(let _ = $part;)*
                        $(visit($a);)*
                    })*
                    $(Op::$held(.., $x) => visit($x),)*
                }
            }

            /// The same operation on other operands, which `to` gives one after the other.
            #[inline]
            pub fn map_operands<B>(self, mut to: impl FnMut(A) -> B) -> Op<B> {
                match self {
                    $(Op::$given$(($($given_part),*))? => Op::$given$(($($given_part),*))?,)*
                    $(Op::$plain($($part,)* $($a),*) => Op::$plain($($part,)* $(to($a)),*),)*
                    $(Op::$held($($held_part,)* $x) => Op::$held($($held_part,)* to($x)),)*
                }
            }

            /// What it is counted as.
            pub fn cost(self) -> Cost {
                match self {
                    $(Op::$given { .. } => Cost::Given,)*
                    $(Op::$plain(..) => Cost::$cost,)*
                    $(Op::$held(..) => Cost::$held_cost,)*
                }
            }

            /// Its derivative by the rules of the table, `None` where nothing moves; `of` gives what an operand is, and its
            /// rate.
            #[allow(unused_variables, reason = "each rule reads what it needs")]
            #[inline]
            pub fn derivative<K: Calculus>(
                self,
                k: &mut K,
                value: K::Number,
                mut of: impl FnMut(&mut K, A) -> Moving<K>,
            ) -> Option<K::Number> {
                match self {
                    $(Op::$given { .. } => None,)*
                    $(Op::$plain($($part,)* $($a),*) => {
                        $(let ($a, $da) = of(k, $a);)*
                        let ($k, $value) = (k, value);
                        $derivative
                    })*
                    $(Op::$held($($held_part,)* $x) => {
                        let ($x, $dx) = of(k, $x);
                        let $k = k;
                        $held_derivative
                    })*
                }
            }

            /// Whether it reads a condition or a table.
            pub fn is_held(self) -> bool {
                matches!(self, $(Op::$held(..))|*)
            }
        }

        impl<A: Copy + std::fmt::Display> Op<A> {
            /// It as text; givens, which whoever prints has names for, by their kind.
            pub fn text(self) -> String {
                match self {
                    $(Op::$given { .. } => stringify!($given).to_string(),)*
                    $(Op::$plain($($part,)* $($a),*) => {
                        $(let $part = Shown($part);)*
                        format!($text)
                    })*
                    $(Op::$held($($held_part,)* $x) => {
                        $(let $held_part = Shown($held_part);)*
                        $(let _ = &$held_part;)*
                        format!($held_text)
                    })*
                }
            }
        }
    };
}

for_each_op!(define);

/// What is fixed in an operation, as text.
struct Shown<T>(T);

impl std::fmt::Display for Shown<u32> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}", self.0)
    }
}

impl std::fmt::Display for Shown<Function> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.0.name())
    }
}

impl std::fmt::Display for Shown<ConditionId> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}", self.0.0)
    }
}

impl<A: Copy> Op<A> {
    /// Whether it stands before any routine runs.
    pub fn is_given(self) -> bool {
        self.cost() == Cost::Given && !matches!(self, Op::Guess(..) | Op::Solution(..))
    }

    /// Whether it moves with what it reads, rather than jump.
    pub fn moves(self) -> bool {
        self.derivative(&mut Whether, (), |_, _| ((), Some(()))).is_some()
    }

    /// The condition that it reads.
    pub fn condition(self) -> Option<ConditionId> {
        match self {
            Op::Sign(c, _) | Op::Floor(c, _) => Some(c),
            Op::Table(_, c, _) | Op::TableSlope(_, c, _) | Op::TableCurvature(_, c, _) => c,
            _ => None,
        }
    }
}
