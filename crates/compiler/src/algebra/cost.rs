//! What it costs to evaluate expressions once.

use super::exprs::{Exprs, MINUS_ONE};
use super::node::{Expr, Node};

/// Bits of a rational beyond which it is long: literals of 17 digits have about 110, products of two less than this.
const LONG_NUMBER: u64 = 256;

/// No entry of an expression adds more to its written length.
const LONGEST: u64 = 8;

/// Operations of one evaluation, shared parts counted once.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Cost {
    /// Additions and subtractions.
    pub adds: usize,
    /// Multiplications.
    pub muls: usize,
    /// Divisions.
    pub divs: usize,
    /// Functions, roots, tables, comparisons and choices.
    pub calls: usize,
}

impl Cost {
    /// All operations.
    pub fn total(&self) -> usize {
        self.adds + self.muls + self.divs + self.calls
    }
}

impl Exprs {
    /// Whether an expression is written longer than this, or holds a long number: exact products of numbers that are put
    /// into each other grow without bound, though they are printed and computed with the digits of one.
    pub fn is_longer(&self, e: Expr, length: u64) -> bool {
        let is_long = |part: Expr| self.is_number(part).is_some_and(|n| n.bits() > LONG_NUMBER);
        let size = self.entry(e).size;
        let may_be = LONGEST * u64::from(size) > length;
        let holds_a_long_number = || match size {
            1 => is_long(e),
            _ => self.around_wholes(&[e], &|_| true).into_iter().any(is_long),
        };
        may_be && self.written_length(e) > length || holds_a_long_number()
    }

    /// What it costs to evaluate the expressions once. Integer powers are multiplications by squaring; a factor of -1
    /// is part of the addition around it.
    pub fn cost(&self, roots: &[Expr]) -> Cost {
        let mut cost = Cost::default();
        for e in self.below(roots, &|_| true) {
            self.add_cost(e, &mut cost);
        }
        cost
    }

    fn add_cost(&self, e: Expr, cost: &mut Cost) {
        match self.node(e) {
            Node::Number(_) | Node::Pi | Node::Symbol(_) | Node::Whole(_) => {}
            Node::Add(terms) => cost.adds += terms.len() - 1,
            Node::Mul(factors) => {
                let counted = factors.iter().filter(|&&f| f != MINUS_ONE);
                let below = counted.clone().filter(|&&f| self.divides(f)).count();
                // a/(b c) is one product below and one division.
                let above = counted.count() - below;
                cost.muls += above.saturating_sub(1) + below.saturating_sub(1);
            }
            Node::Pow(_, n) => match self.is_number(*n).and_then(|n| n.as_integer()) {
                Some(n) => {
                    let size = n.unsigned_abs();
                    cost.divs += usize::from(n < 0);
                    cost.muls += (size.max(1).ilog2() + size.count_ones()).saturating_sub(1) as usize;
                }
                None => cost.calls += 1,
            },
            _ => cost.calls += 1,
        }
    }
}
