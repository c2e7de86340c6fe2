//! Values of expressions in a prime field, to compute with.

use super::exprs::Exprs;
use super::field;
use super::fingerprint::{GENERIC, POISON};
use super::node::Expr;

/// The value of an expression in a prime field, where every symbol has a random value. Sums and products of values are
/// the values of sums and products; one that vanishes stands for an expression that is 0 (up to a probability of 2^-60).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Residue(u64);

impl Residue {
    /// The value of 0.
    pub const ZERO: Residue = Residue(0);

    /// Whether it is 0.
    pub fn vanishes(self) -> bool {
        self.0 == 0
    }
}

impl std::ops::Add for Residue {
    type Output = Residue;
    fn add(self, other: Residue) -> Residue {
        Residue(field::add(self.0, other.0))
    }
}

impl std::ops::Mul for Residue {
    type Output = Residue;
    fn mul(self, other: Residue) -> Residue {
        Residue(field::mul(self.0, other.0))
    }
}

impl Exprs {
    /// The value of an expression in the prime field; `None` where it has none.
    pub fn residue(&self, e: Expr) -> Option<Residue> {
        Some(self.fingerprint(e)[GENERIC.start]).filter(|&v| v != POISON).map(Residue)
    }
}
