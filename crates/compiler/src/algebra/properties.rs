//! What is known of an expression without a value for its symbols: sign, and whether it is defined everywhere.

use super::assumptions::Notes;
use super::exprs::Exprs;
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
    /// The signs its values may have.
    pub signs: Signs,
    /// It has a finite value for all finite values of its symbols.
    pub total: bool,
    /// It holds corners or jumps, so that a value at a few points says nothing of the others.
    pub piecewise: bool,
    /// It holds roots, so that a fingerprint of zero is no proof.
    pub radical: bool,
    /// A fingerprint other than zero is no proof: [generic, at the given parameters].
    pub opaque: [bool; 2],
}

impl Exprs {
    /// Whether the expression is known never to be zero.
    pub fn nonzero(&self, e: Expr) -> bool {
        self.claims(e, Signs::NOT_ZERO, Notes::NOT_ZERO)
    }

    /// Whether the expression is known to be above zero.
    pub fn positive(&self, e: Expr) -> bool {
        self.claims(e, Signs::PLUS, Notes::POSITIVE)
    }

    /// Whether the expression is known not to be below zero.
    pub fn nonnegative(&self, e: Expr) -> bool {
        self.claims(e, Signs::NOT_MINUS, Notes::NOT_NEGATIVE)
    }

    /// Whether the signs of an expression are among these; if so that is noted.
    fn claims(&self, e: Expr, signs: Signs, note: u8) -> bool {
        let entry = self.entry(e);
        let known = entry.properties.signs.within(signs);
        if known {
            entry.notes.add(note);
        }
        known
    }

    /// Whether the expression is known to have a finite value for all values of its symbols.
    pub fn total(&self, e: Expr) -> bool {
        self.entry(e).properties.total
    }

    /// From now on the expression counts as defined and nonzero: it is watched while the program runs. Its factors are
    /// nonzero too.
    pub fn assume_nonzero(&mut self, e: Expr) {
        self.short_forms.forget();
        self.assume_total(e);
        let monomial = self.entry(e).monomial;
        let (_, primitive) = self.primitive(monomial);
        for e in [e, monomial, primitive] {
            let entry = &mut self.entries[e.0 as usize];
            if !entry.properties.signs.within(Signs::NOT_ZERO) {
                entry.notes.add(Notes::WATCHED);
            }
            entry.properties.signs = entry.properties.signs.and(Signs::NOT_ZERO);
        }
        let mut parts = Vec::new();
        match self.node(monomial) {
            Node::Mul(factors) => parts.extend_from_slice(factors),
            Node::Pow(base, _) => parts.push(*base),
            _ => {}
        }
        for part in parts {
            self.assume_nonzero(part);
        }
    }

    /// What is finite has finite parts; only what a condition chooses may be undefined.
    fn assume_total(&mut self, e: Expr) {
        let chosen =
            |x: &Exprs, e: Expr| matches!(x.node(e), Node::Select(..) | Node::Call(Function::Min | Function::Max, _));
        let mut open = vec![e];
        while let Some(e) = open.pop() {
            if !self.total(e) && !chosen(self, e) {
                self.entries[e.0 as usize].properties.total = true;
                self.node(e).for_each_child(|c| open.push(c));
            }
        }
    }

    pub(super) fn signs(&self, e: Expr) -> Signs {
        self.entry(e).properties.signs
    }

    pub(super) fn properties_of(&self, node: &Node) -> Properties {
        let mut total = self.total_of(node);
        let (mut piecewise, mut radical, mut opaque) =
            (is_piecewise(node), self.is_radical(node), self.opaque_of(node));
        node.for_each_child(|c| {
            let p = &self.entry(c).properties;
            total &= p.total;
            piecewise |= p.piecewise;
            radical |= p.radical;
            opaque = [opaque[0] | p.opaque[0], opaque[1] | p.opaque[1]];
        });
        Properties { signs: self.signs_of(node, &|e| self.signs(e)), total, piecewise, radical, opaque }
    }

    fn is_radical(&self, node: &Node) -> bool {
        matches!(node, Node::Pow(_, n) if self.is_number(*n).is_none_or(|n| !n.is_integer()))
    }

    /// Whether a node is defined and finite wherever its parts are.
    fn total_of(&self, node: &Node) -> bool {
        match node {
            Node::Pow(base, n) => match self.is_number(*n) {
                Some(n) if n.is_integer() => n.signum() >= 0 || self.nonzero(*base),
                Some(n) if n.signum() > 0 => self.nonnegative(*base),
                Some(_) => self.positive(*base),
                None => self.positive(*base),
            },
            Node::Call(Function::Tan | Function::Asin | Function::Acos, _) => false,
            Node::Call(Function::Log | Function::Log10, x) => self.positive(x[0]),
            Node::Call(Function::Mod, x) => self.nonzero(x[1]),
            Node::Table(t, _) | Node::TableSlope(t, _) => self.table1d(*t).outside() != Outside::Error,
            _ => true,
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
        }
    }

    fn signs_of_power(&self, base: Signs, n: Expr) -> Signs {
        let Some(n) = self.is_number(n) else {
            return if base.within(Signs::PLUS) { Signs::PLUS } else { Signs::ANY };
        };
        let possible = if n.signum() < 0 { base.and(Signs::NOT_ZERO) } else { base };
        let even = !n.numerator().bit(0);
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
