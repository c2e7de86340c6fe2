//! What an expression is made of.

use super::math;
use super::rational::Rational;
use super::table::TableId;
use crate::ids::id;
use smallvec::SmallVec;

id! {
    /// An expression: an entry of the pool.
    Expr
}
id! {
    /// A named quantity.
    Symbol
}

/// What is known of a symbol.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Facts {
    /// It is never zero.
    pub nonzero: bool,
    /// It is above zero.
    pub positive: bool,
    /// The value of a parameter: numbers and other parameters. `None` for whatever varies.
    pub given: Option<Expr>,
}

/// A function of the model language. `Log` is the natural logarithm; `Mod` has the sign of its second argument.
#[allow(missing_docs)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Function {
    Sin,
    Cos,
    Tan,
    Asin,
    Acos,
    Atan,
    Atan2,
    Exp,
    Log,
    Log10,
    Sqrt,
    Abs,
    Sign,
    Min,
    Max,
    Sinh,
    Cosh,
    Tanh,
    Floor,
    Mod,
}

impl Function {
    /// All functions.
    pub const ALL: [Function; 20] = {
        use Function::*;
        [
            Sin, Cos, Tan, Asin, Acos, Atan, Atan2, Exp, Log, Log10, Sqrt, Abs, Sign, Min, Max, Sinh, Cosh, Tanh,
            Floor, Mod,
        ]
    };

    /// Its name in the model language.
    pub fn name(self) -> &'static str {
        use Function::*;
        match self {
            Sin => "sin",
            Cos => "cos",
            Tan => "tan",
            Asin => "asin",
            Acos => "acos",
            Atan => "atan",
            Atan2 => "atan2",
            Exp => "exp",
            Log => "log",
            Log10 => "log10",
            Sqrt => "sqrt",
            Abs => "abs",
            Sign => "sign",
            Min => "min",
            Max => "max",
            Sinh => "sinh",
            Cosh => "cosh",
            Tanh => "tanh",
            Floor => "floor",
            Mod => "mod",
        }
    }

    /// The function of that name.
    pub fn named(name: &str) -> Option<Function> {
        Self::ALL.into_iter().find(|f| f.name() == name)
    }

    /// How many arguments it takes.
    pub fn arity(self) -> usize {
        match self {
            Function::Atan2 | Function::Min | Function::Max | Function::Mod => 2,
            _ => 1,
        }
    }

    /// Its value. `sign(0)` is 0; outside its domain NaN.
    pub fn value(self, x: f64, y: f64) -> f64 {
        match self.arity() {
            2 => math::call2(self, x, y),
            _ => math::call(self, x),
        }
    }
}

/// A relation between two numbers.
#[allow(missing_docs)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Comparison {
    Lt,
    Le,
    Gt,
    Ge,
    Eq,
    Ne,
}

impl Comparison {
    /// Its sign in the model language.
    pub fn sign(self) -> &'static str {
        match self {
            Comparison::Lt => "<",
            Comparison::Le => "<=",
            Comparison::Gt => ">",
            Comparison::Ge => ">=",
            Comparison::Eq => "==",
            Comparison::Ne => "!=",
        }
    }

    /// Whether it holds.
    pub fn holds<T: PartialOrd>(self, a: &T, b: &T) -> bool {
        match self {
            Comparison::Lt => a < b,
            Comparison::Le => a <= b,
            Comparison::Gt => a > b,
            Comparison::Ge => a >= b,
            Comparison::Eq => a == b,
            Comparison::Ne => a != b,
        }
    }
}

/// Terms, factors or arguments, a few of them held in place.
pub type Parts = SmallVec<[Expr; 4]>;

/// An entry of the pool. Truth values are numbers: 0 is false, anything else true.
///
/// Invariants: children stand earlier in the pool than their parents; sums and products are flat, sorted, and their
/// number comes first; a number in a sum or product of one other entry is never 0 or 1 in vain; `sqrt` is
/// `Pow(x, 1/2)`, a quotient `a/b` is `Mul([a, Pow(b, -1)])`, and `-a` is `Mul([-1, a])`.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum Node {
    /// An exact number.
    Number(Rational),
    /// The number pi.
    Pi,
    /// A named quantity.
    Symbol(Symbol),
    /// A sum of two or more.
    Add(Parts),
    /// A product of two or more.
    Mul(Parts),
    /// Base and exponent.
    Pow(Expr, Expr),
    /// A function of its arguments; never `Sqrt`, which is a power.
    Call(Function, Parts),
    /// A relation: 1 or 0.
    Compare(Comparison, Expr, Expr),
    /// Both hold: 1 or 0.
    And(Expr, Expr),
    /// One of them holds: 1 or 0.
    Or(Expr, Expr),
    /// It does not hold: 1 or 0.
    Not(Expr),
    /// If the first holds the second, else the third; the other is not evaluated.
    Select(Expr, Expr, Expr),
    /// A table at a value.
    Table(TableId, Expr),
    /// The slope of a table at a value.
    TableSlope(TableId, Expr),
    /// Its part, which nothing around it is multiplied into or taken out of: see [`Exprs::whole`](super::Exprs::whole).
    Whole(Expr),
}

impl Node {
    /// The same node of other parts.
    pub(super) fn with_parts(&self, part: &dyn Fn(Expr) -> Expr) -> Node {
        let all = |parts: &Parts| -> Parts { parts.iter().map(|&p| part(p)).collect() };
        match self {
            Node::Number(_) | Node::Pi | Node::Symbol(_) => self.clone(),
            Node::Add(terms) => Node::Add(all(terms)),
            Node::Mul(factors) => Node::Mul(all(factors)),
            &Node::Pow(base, n) => Node::Pow(part(base), part(n)),
            Node::Call(f, x) => Node::Call(*f, all(x)),
            &Node::Compare(c, a, b) => Node::Compare(c, part(a), part(b)),
            &Node::And(a, b) => Node::And(part(a), part(b)),
            &Node::Or(a, b) => Node::Or(part(a), part(b)),
            &Node::Not(a) => Node::Not(part(a)),
            &Node::Select(c, a, b) => Node::Select(part(c), part(a), part(b)),
            &Node::Table(t, x) => Node::Table(t, part(x)),
            &Node::TableSlope(t, x) => Node::TableSlope(t, part(x)),
            &Node::Whole(a) => Node::Whole(part(a)),
        }
    }

    /// Calls `visit` with each entry it is made of, in order.
    #[inline]
    pub fn for_each_child(&self, mut visit: impl FnMut(Expr)) {
        match self {
            Node::Number(_) | Node::Pi | Node::Symbol(_) => {}
            Node::Add(v) | Node::Mul(v) | Node::Call(_, v) => v.iter().copied().for_each(visit),
            Node::Pow(a, b) | Node::Compare(_, a, b) | Node::And(a, b) | Node::Or(a, b) => {
                visit(*a);
                visit(*b);
            }
            Node::Not(a) | Node::Table(_, a) | Node::TableSlope(_, a) | Node::Whole(a) => visit(*a),
            Node::Select(a, b, c) => {
                visit(*a);
                visit(*b);
                visit(*c);
            }
        }
    }
}
