//! Values of expressions in a prime field, to compute with.

use super::elimination::{Coefficients, NumericPoint, Quality, Zero};
use super::exprs::Exprs;
use super::field::{self, P};
use super::fingerprint::{GENERIC, GIVEN, LANES, POISON, random};
use super::node::Expr;

/// The value of an expression in a prime field, where every symbol has a random value. Sums and products of values are
/// the values of sums and products; one that vanishes stands for an expression that is 0 (up to a probability of 2^-60).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Residue(u64);

impl Residue {
    /// The value of 0.
    pub const ZERO: Residue = Residue(0);

    /// One of the field, by a number: as good as random, and no value of a symbol.
    pub fn random(key: u64) -> Residue {
        Residue(random(LANES, key))
    }

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

    /// The quotient of the values of an expression at two random points of the prime field: what is a number times the
    /// expression has the same, and products have the products. `None` where it has none, and of numbers.
    pub fn proportion(&self, e: Expr) -> Option<Residue> {
        let [first, second] = [0, 1].map(|lane| self.fingerprint(e)[GENERIC.start + lane]);
        let known = ![0, POISON].iter().any(|v| [first, second].contains(v)) && first != second;
        known.then(|| field::inverse(second).map(|inverse| Residue(field::mul(first, inverse))))?
    }
}

/// The values of an expression in a prime field: with all symbols random, and with parameters as they are given.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Residues {
    generic: u64,
    given: u64,
}

impl Residues {
    fn each(self, other: Residues, by: impl Fn(u64, u64) -> u64) -> Residues {
        Residues { generic: by(self.generic, other.generic), given: by(self.given, other.given) }
    }
}

impl Exprs {
    /// The values of an expression in the prime field; `None` where they do not decide whether it is zero.
    pub fn residues(&self, e: Expr) -> Option<Residues> {
        let properties = &self.entry(e).properties;
        let lanes = self.fingerprint(e);
        let (generic, given) = (lanes[GENERIC.start], lanes[GIVEN.start]);
        let decides = !properties.radical && properties.opaque == [false; 2] && generic != POISON && given != POISON;
        decides.then_some(Residues { generic, given })
    }
}

/// The prime field as what elimination computes with: it tells which columns follow from which, and what each row is
/// divided by is left open.
#[derive(Debug, Clone, Copy)]
pub struct PrimeField;

impl Coefficients for PrimeField {
    type Entry = Residues;
    const ONE: Residues = Residues { generic: 1, given: 1 };

    fn zero(&self, e: Residues) -> Zero {
        match (e.generic, e.given) {
            (0, _) => Zero::Always,
            (_, 0) => Zero::Given,
            _ => Zero::No,
        }
    }
    fn quality(&self, e: Residues) -> (Quality, u32) {
        let unit = e == Self::ONE || e == Residues { generic: P - 1, given: P - 1 };
        (if unit { Quality::Unit } else { Quality::Number }, 0)
    }
    fn is_small(&self, _: &mut NumericPoint, _: &[(usize, Residues)], _: Residues) -> bool {
        false
    }
    fn take_pivot(&mut self, _: Residues, _: Quality) -> Option<Residues> {
        None
    }
    fn plus(&mut self, a: Residues, b: Residues) -> Residues {
        a.each(b, field::add)
    }
    fn times(&mut self, a: Residues, b: Residues) -> Residues {
        a.each(b, field::mul)
    }
    fn minus(&mut self, e: Residues) -> Residues {
        Residues { generic: field::neg(e.generic), given: field::neg(e.given) }
    }
    fn inverse(&mut self, e: Residues) -> Residues {
        let inverse = |v| field::inverse(v).unwrap_or(0);
        Residues { generic: inverse(e.generic), given: inverse(e.given) }
    }
}
