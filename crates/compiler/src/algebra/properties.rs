//! What is known of an expression without a value for its symbols: sign, and whether it is defined everywhere.

use super::assumptions::Decided;
use super::exprs::{Exprs, PoolEntry};
use super::node::{Expr, Function, Node};
use super::rational::Rational;
use super::table::Outside;

/// The signs a number may have, as a set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Signs(u8);

impl Signs {
    pub const MINUS: Signs = Signs(1);
    pub const ZERO: Signs = Signs(2);
    pub const PLUS: Signs = Signs(4);
    pub const NOT_MINUS: Signs = Signs(6);
    pub const NOT_ZERO: Signs = Signs(5);
    pub const ANY: Signs = Signs(7);

    pub fn within(self, other: Signs) -> bool {
        self.0 & !other.0 == 0
    }

    pub fn and(self, other: Signs) -> Signs {
        Signs(self.0 & other.0)
    }

    fn of(value: &Rational) -> Signs {
        [Signs::MINUS, Signs::ZERO, Signs::PLUS][(value.signum() + 1) as usize]
    }

    fn pairs(self, other: Signs, result: impl Fn(i32, i32) -> Signs) -> Signs {
        let mut all = 0;
        for (i, a) in [(-1, 1), (0, 2), (1, 4)] {
            for (j, b) in [(-1, 1), (0, 2), (1, 4)] {
                if self.0 & a != 0 && other.0 & b != 0 {
                    all |= result(i, j).0;
                }
            }
        }
        Signs(all)
    }

    fn plus(self, other: Signs) -> Signs {
        self.pairs(other, |a, b| match (a, b) {
            (1, -1) | (-1, 1) => Signs::ANY,
            _ => [Signs::MINUS, Signs::ZERO, Signs::PLUS][((a + b).signum() + 1) as usize],
        })
    }

    fn times(self, other: Signs) -> Signs {
        self.pairs(other, |a, b| [Signs::MINUS, Signs::ZERO, Signs::PLUS][(a * b + 1) as usize])
    }
}

/// See the fields.
#[derive(Debug, Clone, Copy)]
pub(super) struct Properties {
    /// Of itself: the signs that its values may have, and whether it has a finite value for all values of its symbols.
    pub known: Known,
    /// It holds corners or jumps, so that a value at a few points says nothing of the others.
    pub piecewise: bool,
    /// It holds roots, so that a fingerprint of zero is no proof.
    pub radical: bool,
    /// A fingerprint other than zero is no proof: [generic, at the given parameters].
    pub opaque: [bool; 2],
}

/// What is known of a value: its signs, and whether it is defined.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Known {
    pub signs: Signs,
    pub total: bool,
}

impl Known {
    /// Whether divisors that do not vanish tell no more of it.
    fn is_settled(self) -> bool {
        self.total && self.signs.within(Signs::NOT_ZERO)
    }
}

impl Exprs {
    /// Whether the expression is known never to be zero.
    pub fn nonzero(&self, e: Expr) -> bool {
        self.claims(e, Signs::NOT_ZERO, Decided::NOT_ZERO)
    }

    /// Whether the expression holds corners or jumps.
    pub fn is_piecewise(&self, e: Expr) -> bool {
        self.entry(e).properties.piecewise
    }

    /// The parts of an expression that have a corner or a jump of their own: where one stands within another, both.
    pub fn corners(&self, e: Expr) -> Vec<Expr> {
        let mut found = self.below(&[e], &|part| self.is_piecewise(part));
        found.retain(|&part| is_piecewise(self.node(part)));
        found
    }

    /// The same as [`nonzero`](Self::nonzero), to choose by: nothing is decided by it yet.
    pub fn is_known_nonzero(&self, e: Expr) -> bool {
        self.signs(e).within(Signs::NOT_ZERO)
    }

    /// Whether the expression is known never to be zero, without anything being assumed of what it is made of.
    pub fn is_nonzero_by_itself(&self, e: Expr) -> bool {
        self.entry(e).properties.known.signs.within(Signs::NOT_ZERO)
    }

    /// Whether the expression is known to be above zero.
    pub fn positive(&self, e: Expr) -> bool {
        self.claims(e, Signs::PLUS, Decided::POSITIVE)
    }

    /// Whether the expression is known not to be below zero.
    pub fn nonnegative(&self, e: Expr) -> bool {
        self.claims(e, Signs::NOT_MINUS, Decided::NOT_NEGATIVE)
    }

    /// Whether the expression is known to have a finite value for all values of its symbols.
    pub fn total(&self, e: Expr) -> bool {
        let known = self.known(e).total;
        if known {
            self.assumptions.decide(e, Decided::TOTAL);
        }
        known
    }

    /// Whether the signs of an expression are among these; if so that has been decided.
    fn claims(&self, e: Expr, signs: Signs, decided: u8) -> bool {
        let known = self.signs(e).within(signs);
        if known {
            self.assumptions.decide(e, decided);
        }
        known
    }

    /// The signs that an expression may have. Nothing is decided by looking at them.
    pub(super) fn signs(&self, e: Expr) -> Signs {
        self.known(e).signs
    }

    /// What is known of an expression, by itself and by divisors that do not vanish.
    fn known(&self, e: Expr) -> Known {
        let own = self.entry(e).properties.known;
        if own.is_settled() || !self.assumptions.has_divisors() {
            return own;
        }
        let mut found = self.assumptions.found();
        if let Some(&known) = found.get(&e) {
            return known;
        }
        let open = |p: Expr| !self.entry(p).properties.known.is_settled() && !found.contains_key(&p);
        for part in self.below(&[e], &open) {
            let of = |c: Expr| found.get(&c).copied().unwrap_or(self.entry(c).properties.known);
            let known = self.known_by(part, &of);
            found.insert(part, known);
        }
        found[&e]
    }

    /// What is known of an expression if this is known of its parts.
    fn known_by(&self, e: Expr, of: &dyn Fn(Expr) -> Known) -> Known {
        let PoolEntry { node, properties, .. } = self.entry(e);
        let mut signs = properties.known.signs.and(self.signs_of(node, &|c| of(c).signs));
        if self.assumptions.is_divisor(e) {
            signs = signs.and(Signs::NOT_ZERO);
        }
        let mut parts_total = true;
        node.for_each_child(|c| parts_total &= of(c).total);
        let total = properties.known.total || self.assumptions.is_defined(e);
        Known { signs, total: total || parts_total && self.total_of(node, &|c| of(c).signs) }
    }

    pub(super) fn properties_of(&self, node: &Node) -> Properties {
        let of = |e: Expr| self.entry(e).properties.known;
        let mut total = self.total_of(node, &|c| of(c).signs);
        let (mut piecewise, mut radical, mut opaque) =
            (is_piecewise(node), self.is_radical(node), self.opaque_of(node));
        node.for_each_child(|c| {
            let p = &self.entry(c).properties;
            total &= p.known.total;
            piecewise |= p.piecewise;
            radical |= p.radical;
            opaque = [opaque[0] | p.opaque[0], opaque[1] | p.opaque[1]];
        });
        let signs = self.signs_of(node, &|c| of(c).signs);
        Properties { known: Known { signs, total }, piecewise, radical, opaque }
    }

    fn is_radical(&self, node: &Node) -> bool {
        matches!(node, Node::Pow(_, n) if self.is_number(*n).is_none_or(|n| !n.is_integer()))
    }

    /// Whether a node is defined and finite wherever its parts are.
    fn total_of(&self, node: &Node, of: &dyn Fn(Expr) -> Signs) -> bool {
        match node {
            Node::Call(Function::Tan | Function::Asin | Function::Acos, _) => false,
            Node::Table(t, _) | Node::TableSlope(t, _) => self.table1d(*t).outside() != Outside::Error,
            _ => self.needed_for_a_value(node).is_none_or(|(part, signs)| of(part).within(signs)),
        }
    }

    /// The signs that a part of a node has to have for the node to have a value wherever its parts have one.
    pub(super) fn needed_for_a_value(&self, node: &Node) -> Option<(Expr, Signs)> {
        match *node {
            Node::Pow(base, n) => match self.is_number(n) {
                Some(n) if n.is_integer() => (n.signum() < 0).then_some((base, Signs::NOT_ZERO)),
                Some(n) if n.signum() > 0 => Some((base, Signs::NOT_MINUS)),
                _ => Some((base, Signs::PLUS)),
            },
            Node::Call(Function::Log | Function::Log10, ref x) => Some((x[0], Signs::PLUS)),
            Node::Call(Function::Mod, ref x) => Some((x[1], Signs::NOT_ZERO)),
            _ => None,
        }
    }

    /// The signs of a node by those of its parts.
    pub(super) fn signs_of(&self, node: &Node, of: &dyn Fn(Expr) -> Signs) -> Signs {
        match node {
            Node::Number(value) => Signs::of(value),
            Node::Pi => Signs::PLUS,
            Node::Symbol(s) => match self.facts(*s) {
                f if f.positive => Signs::PLUS,
                f if f.nonzero => Signs::NOT_ZERO,
                _ => Signs::ANY,
            },
            Node::Add(terms) => terms.iter().map(|&t| of(t)).reduce(Signs::plus).unwrap_or(Signs::ZERO),
            Node::Mul(factors) => factors.iter().map(|&f| of(f)).fold(Signs::PLUS, Signs::times),
            Node::Pow(base, n) => self.signs_of_power(of(*base), *n),
            Node::Call(f, x) => self.signs_of_call(*f, x, of),
            Node::Compare(..) | Node::And(..) | Node::Or(..) | Node::Not(_) => Signs::NOT_MINUS,
            Node::Select(_, a, b) => Signs(of(*a).0 | of(*b).0),
            Node::Table(..) | Node::TableSlope(..) => Signs::ANY,
            Node::Whole(a) => of(*a),
        }
    }

    fn signs_of_power(&self, base: Signs, n: Expr) -> Signs {
        let Some(n) = self.is_number(n) else {
            return if base.within(Signs::PLUS) { Signs::PLUS } else { Signs::ANY };
        };
        let possible = if n.signum() < 0 { base.and(Signs::NOT_ZERO) } else { base };
        let even = n.is_even();
        match n.is_integer() {
            true if even => Signs(possible.and(Signs::ZERO).0 | if possible.within(Signs::ZERO) { 0 } else { 4 }),
            true => possible,
            false => possible.and(Signs::NOT_MINUS),
        }
    }

    fn signs_of_call(&self, f: Function, x: &[Expr], of: &dyn Fn(Expr) -> Signs) -> Signs {
        use Function::*;
        let arg = of(x[0]);
        match f {
            Exp | Cosh => Signs::PLUS,
            Sqrt => arg.and(Signs::NOT_MINUS),
            Abs => Signs(arg.0 & 2 | if arg.within(Signs::ZERO) { 0 } else { 4 }),
            Sign | Asin | Atan | Sinh | Tanh => arg,
            Acos => Signs::NOT_MINUS,
            Min => self.signs_of_extreme(arg, of(x[1]), i32::min),
            Max => self.signs_of_extreme(arg, of(x[1]), i32::max),
            Sin | Cos | Tan | Atan2 | Log | Log10 | Floor | Mod => Signs::ANY,
        }
    }

    fn signs_of_extreme(&self, a: Signs, b: Signs, pick: fn(i32, i32) -> i32) -> Signs {
        a.pairs(b, |a, b| [Signs::MINUS, Signs::ZERO, Signs::PLUS][(pick(a, b) + 1) as usize])
    }
}

fn is_piecewise(node: &Node) -> bool {
    use Function::*;
    match node {
        Node::Call(f, _) => matches!(f, Abs | Sign | Min | Max | Floor | Mod | Atan2),
        Node::Compare(..) | Node::And(..) | Node::Or(..) | Node::Not(_) | Node::Select(..) => true,
        Node::Table(..) | Node::TableSlope(..) => true,
        _ => false,
    }
}
