//! Functions, relations, choices and tables in canonical form.

use super::exprs::{Exprs, MINUS_ONE, ONE, ZERO};
use super::node::{Comparison, Expr, Function, Node};
use super::rational::Rational;
use super::table::TableId;
use smallvec::smallvec;

impl Exprs {
    /// A function of its arguments. Panics if their number is not its arity.
    pub fn call(&mut self, f: Function, x: &[Expr]) -> Expr {
        assert_eq!(x.len(), f.arity(), "the number of arguments of {}", f.name());
        use Function::*;
        match f {
            Sqrt => self.sqrt(x[0]),
            Min | Max => self.extreme(f, x[0], x[1]),
            Mod => self.modulo(x[0], x[1]),
            Atan2 => self.intern(Node::Call(f, x.into())),
            Abs => self.abs(x[0]),
            Sign => self.sign(x[0]),
            Cos | Cosh => {
                let x = self.without_sign(x[0]).1;
                self.simple_call(f, x)
            }
            Sin | Tan | Asin | Atan | Sinh | Tanh => {
                let (negative, x) = self.without_sign(x[0]);
                let value = self.simple_call(f, x);
                if negative { self.neg(value) } else { value }
            }
            Acos | Exp | Log | Log10 | Floor => self.simple_call(f, x[0]),
        }
    }

    /// `sqrt(x)`, the power 1/2.
    pub fn sqrt(&mut self, x: Expr) -> Expr {
        self.pow_number(x, &Rational::new(1, 2))
    }

    /// A relation: 1 or 0.
    pub fn compare(&mut self, relation: Comparison, a: Expr, b: Expr) -> Expr {
        use Comparison::*;
        if let (Some(a), Some(b)) = (self.is_number(a), self.is_number(b)) {
            return if relation.holds(a, b) { ONE } else { ZERO };
        }
        match relation {
            _ if a == b && self.total(a) => match relation {
                Le | Ge | Eq => ONE,
                Lt | Gt | Ne => ZERO,
            },
            Gt => self.compare(Lt, b, a),
            Ge => self.compare(Le, b, a),
            Eq | Ne if self.order(a, b).is_gt() => self.intern(Node::Compare(relation, b, a)),
            _ => self.intern(Node::Compare(relation, a, b)),
        }
    }

    /// Both hold: 1 or 0.
    pub fn and(&mut self, a: Expr, b: Expr) -> Expr {
        match (self.truth_of(a), self.truth_of(b)) {
            (Some(false), _) | (_, Some(false)) => ZERO,
            (Some(true), Some(true)) => ONE,
            (Some(true), None) => self.truth(b),
            (None, Some(true)) => self.truth(a),
            (None, None) => {
                let (a, b) = (self.truth(a), self.truth(b));
                if a == b { a } else { self.intern(Node::And(a, b)) }
            }
        }
    }

    /// One of them holds: 1 or 0.
    pub fn or(&mut self, a: Expr, b: Expr) -> Expr {
        match (self.truth_of(a), self.truth_of(b)) {
            (Some(true), _) | (_, Some(true)) => ONE,
            (Some(false), Some(false)) => ZERO,
            (Some(false), None) => self.truth(b),
            (None, Some(false)) => self.truth(a),
            (None, None) => {
                let (a, b) = (self.truth(a), self.truth(b));
                if a == b { a } else { self.intern(Node::Or(a, b)) }
            }
        }
    }

    /// It does not hold: 1 or 0.
    pub fn not(&mut self, a: Expr) -> Expr {
        match (self.truth_of(a), self.node(a)) {
            (Some(known), _) => {
                if known {
                    ZERO
                } else {
                    ONE
                }
            }
            (None, Node::Not(inner)) => *inner,
            _ => {
                let a = self.truth(a);
                self.intern(Node::Not(a))
            }
        }
    }

    /// If `condition` holds `then`, else `otherwise`; the other one is not evaluated.
    pub fn select(&mut self, condition: Expr, then: Expr, otherwise: Expr) -> Expr {
        match self.truth_of(condition) {
            Some(true) => then,
            Some(false) => otherwise,
            None if then == otherwise && self.total(condition) => then,
            None => {
                let condition = self.truth(condition);
                self.intern(Node::Select(condition, then, otherwise))
            }
        }
    }

    /// A table at `x`.
    pub fn table(&mut self, table: TableId, x: Expr) -> Expr {
        self.intern(Node::Table(table, x))
    }

    /// The slope of a table at `x`.
    pub fn table_slope(&mut self, table: TableId, x: Expr) -> Expr {
        self.intern(Node::TableSlope(table, x))
    }

    fn truth_of(&self, e: Expr) -> Option<bool> {
        self.is_number(e).map(|value| !value.is_zero())
    }

    /// The expression as 1 or 0.
    fn truth(&mut self, e: Expr) -> Expr {
        match self.node(e) {
            Node::Compare(..) | Node::And(..) | Node::Or(..) | Node::Not(_) => e,
            _ => self.compare(Comparison::Ne, e, ZERO),
        }
    }

    /// Whether the expression is written with a minus in front, and what stands behind it.
    pub(super) fn without_sign(&mut self, e: Expr) -> (bool, Expr) {
        let negative = match self.node(e) {
            Node::Add(_) => self.primitive(e).0.signum() < 0,
            _ => self.coefficient(e).0.signum() < 0,
        };
        (negative, if negative { self.neg(e) } else { e })
    }

    fn simple_call(&mut self, f: Function, x: Expr) -> Expr {
        if let Some(value) = self.known_value(f, x) {
            return value;
        }
        match (f, self.node(x)) {
            (Function::Log, Node::Call(Function::Exp, inner)) => inner[0],
            (Function::Exp, Node::Call(Function::Log, inner)) if self.positive(inner[0]) => inner[0],
            (Function::Floor, Node::Call(Function::Floor, _)) => x,
            _ => self.intern(Node::Call(f, smallvec![x])),
        }
    }

    /// Exact values at numbers, and of angles at the twelfths of a turn.
    fn known_value(&mut self, f: Function, x: Expr) -> Option<Expr> {
        use Function::*;
        if let Sin | Cos | Tan = f {
            return self.known_angle(f, x);
        }
        let value = self.is_number(x)?.clone();
        let zero = value.is_zero();
        match f {
            Asin | Atan | Sinh | Tanh if zero => Some(ZERO),
            Exp | Cosh if zero => Some(ONE),
            Log | Log10 if value.is_one() => Some(ZERO),
            Acos if value.is_one() => Some(ZERO),
            Floor => Some(self.number(value.floor())),
            _ => None,
        }
    }

    fn known_angle(&mut self, f: Function, x: Expr) -> Option<Expr> {
        use Function::*;
        if x == ZERO {
            return Some(if f == Cos { ONE } else { ZERO });
        }
        let (turns, rest) = self.coefficient(x);
        if *self.node(rest) != Node::Pi {
            return None;
        }
        let sixths = (&turns * &Rational::from(6)).as_integer()?.rem_euclid(12);
        match f {
            Sin => self.sine_of_sixths(sixths),
            Cos => self.sine_of_sixths((sixths + 3) % 12),
            _ if sixths % 6 == 0 => Some(ZERO),
            _ => None,
        }
    }

    fn sine_of_sixths(&mut self, sixths: i64) -> Option<Expr> {
        let half = match sixths % 6 {
            0 => ZERO,
            3 => ONE,
            1 | 5 => self.ratio(1, 2),
            _ => {
                let three = self.int(3);
                let root = self.sqrt(three);
                self.scale(&Rational::new(1, 2), root)
            }
        };
        Some(if sixths >= 6 { self.neg(half) } else { half })
    }

    fn abs(&mut self, x: Expr) -> Expr {
        if self.nonnegative(x) {
            return x;
        }
        let minus = self.neg(x);
        if self.nonnegative(minus) {
            return minus;
        }
        let (known, x) = self.without_known_signs(x);
        let x = self.without_sign(x).1;
        let size = match self.node(x) {
            Node::Number(_) | Node::Call(Function::Abs, _) => x,
            _ => self.intern(Node::Call(Function::Abs, smallvec![x])),
        };
        let known = self.abs_of_known(known);
        self.mul(&[known, size])
    }

    fn abs_of_known(&mut self, e: Expr) -> Expr {
        if self.nonnegative(e) { e } else { self.neg(e) }
    }

    /// A product as the factors that are above or below zero for sure and defined everywhere, and the others.
    fn without_known_signs(&mut self, e: Expr) -> (Expr, Expr) {
        let Node::Mul(factors) = self.node(e) else { return (ONE, e) };
        let (mut known, mut other) = (Vec::new(), Vec::new());
        for factor in factors.clone() {
            let sure =
                self.total(factor) && (self.positive(factor) || self.is_number(factor).is_some_and(|n| !n.is_zero()));
            if sure { known.push(factor) } else { other.push(factor) }
        }
        (self.mul(&known), self.mul(&other))
    }

    fn sign(&mut self, x: Expr) -> Expr {
        if x == ZERO {
            return ZERO;
        }
        let minus = self.neg(x);
        if self.total(x) && self.positive(x) {
            return ONE;
        }
        if self.total(x) && self.positive(minus) {
            return MINUS_ONE;
        }
        let (known, x) = self.without_known_signs(x);
        let (negative, x) = self.without_sign(x);
        let value = self.intern(Node::Call(Function::Sign, smallvec![x]));
        if negative == self.positive(known) { self.neg(value) } else { value }
    }

    fn extreme(&mut self, f: Function, a: Expr, b: Expr) -> Expr {
        if let (Some(p), Some(q)) = (self.is_number(a), self.is_number(b)) {
            return if (p < q) == (f == Function::Min) { a } else { b };
        }
        match self.order(a, b) {
            std::cmp::Ordering::Equal => a,
            std::cmp::Ordering::Less => self.intern(Node::Call(f, smallvec![a, b])),
            std::cmp::Ordering::Greater => self.intern(Node::Call(f, smallvec![b, a])),
        }
    }

    fn modulo(&mut self, a: Expr, b: Expr) -> Expr {
        if let (Some(p), Some(q)) = (self.is_number(a), self.is_number(b))
            && let Some(ratio) = p.over(q)
        {
            let value = p - &(q * &ratio.floor());
            return self.number(value);
        }
        self.intern(Node::Call(Function::Mod, smallvec![a, b]))
    }
}
