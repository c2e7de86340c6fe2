//! How long expressions are: as they are evaluated, and in print.

use super::super::exprs::Exprs;
use super::super::node::{Expr, Node};
use super::super::rational::Rational;
use rustc_hash::FxHashMap;

impl Exprs {
    /// How long the expression is written: symbols, numbers, operators and functions, shared parts each time.
    pub fn written_length(&self, e: Expr) -> u64 {
        u64::from(self.entry(e).length)
    }

    /// The same of a node, by the lengths of its parts.
    pub(in crate::algebra) fn length_of_node(&self, node: &Node) -> u32 {
        let mut length: u32 = match node {
            Node::Number(value) if value.is_one() || value == &Rational::from(-1) => 1,
            Node::Number(_) | Node::Pi | Node::Symbol(_) => 2,
            Node::Whole(_) => return 2,
            Node::Add(terms) => terms.len() as u32,
            Node::Mul(factors) => factors.len() as u32 - 1,
            // A fraction within a fraction reads badly.
            Node::Pow(base, n) if *n == super::super::MINUS_ONE => 2 + 4 * u32::from(self.holds_fraction(*base)),
            // An exponent is short however it is written, and a square is shorter than a product.
            Node::Pow(_, n) if self.is_number(*n).is_some_and(|n| n.is_integer()) => 0,
            Node::Pow(..) => 1,
            _ => 2,
        };
        node.for_each_child(|c| length = length.saturating_add(self.entry(c).length));
        length
    }

    /// How long the expression is in print: a bar counts once, brackets and fractions within fractions count extra.
    pub fn printed_length(&self, e: Expr) -> u64 {
        let mut lengths: FxHashMap<Expr, u64> = FxHashMap::default();
        for part in self.around_wholes(&[e], &|_| true) {
            let length = self.length_of(part, &lengths);
            lengths.insert(part, length);
        }
        lengths[&e]
    }

    fn length_of(&self, e: Expr, known: &FxHashMap<Expr, u64>) -> u64 {
        match self.node(e) {
            Node::Number(value) if value.abs().is_one() => 1,
            Node::Number(_) | Node::Pi | Node::Symbol(_) | Node::Whole(_) => 2,
            Node::Add(terms) => terms.iter().fold(terms.len() as u64 - 1, |l, t| l.saturating_add(known[t])),
            Node::Mul(factors) => self.length_of_product(factors, known),
            Node::Pow(..) => self.length_of_product(&[e], known),
            node => {
                let mut length = 2u64;
                node.for_each_child(|c| length = length.saturating_add(known[&c]));
                length
            }
        }
    }

    fn length_of_product(&self, factors: &[Expr], known: &FxHashMap<Expr, u64>) -> u64 {
        let mut length = 0u64;
        let (mut above, mut below) = (0u64, 0u64);
        for &factor in factors {
            let (base, exponent) = match *self.node(factor) {
                Node::Pow(base, n) => (base, Some(n)),
                _ => (factor, None),
            };
            if self.is_number(base).is_some_and(|v| v.abs().is_one()) {
                continue;
            }
            let number = exponent.and_then(|n| self.is_number(n));
            let under = number.is_some_and(|n| n.signum() < 0);
            *if under { &mut below } else { &mut above } += 1;
            length = length.saturating_add(known[&base]);
            let sum = matches!(self.node(base), Node::Add(_));
            length += u64::from(sum && (factors.len() > 1 || exponent.is_some()));
            if self.holds_fraction(base) {
                length += if under { 4 } else { 1 };
            }
            match exponent {
                Some(n) if number.is_none_or(|n| !n.is_integer()) => length = length.saturating_add(known[&n]),
                _ => {}
            }
        }
        let bar = if below > 0 { 2 + u64::from(above == 0) } else { 0 };
        length + bar + above.saturating_sub(1) + below.saturating_sub(1)
    }

    /// Whether a term of the sum has a denominator.
    pub(super) fn holds_fraction(&self, sum: Expr) -> bool {
        let Node::Add(terms) = self.node(sum) else { return false };
        terms.iter().any(|&term| self.is_fraction(term))
    }

    /// Whether a product, or what stands alone, has a denominator.
    pub(super) fn is_fraction(&self, e: Expr) -> bool {
        match self.node(e) {
            Node::Mul(factors) => factors.iter().any(|&factor| self.divides(factor)),
            _ => self.divides(e),
        }
    }

    /// Whether it is a power with a negative number for its exponent: it stands below a bar.
    pub(in crate::algebra) fn divides(&self, e: Expr) -> bool {
        matches!(self.node(e), Node::Pow(_, n) if self.is_number(*n).is_some_and(|n| n.signum() < 0))
    }
}
