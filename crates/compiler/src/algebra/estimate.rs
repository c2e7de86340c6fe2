//! Values of expressions at two points, with bounds of their rounding errors, to compute with where a prime field does not
//! tell what roots and functions are.

use super::elimination::{Coefficients, NumericPoint, Quality, Zero};
use super::math;

/// What an evaluation leaves of the digits of a value.
const EVALUATED: f64 = 1e-12;
/// What an operation leaves.
const ROUNDED: f64 = f64::EPSILON;
/// A value within so many bounds of its error is 0.
const BOUNDS: f64 = 8.0;

/// Pivots whose digits differ by fewer bits are as good as each other.
const STEP_OF_DOUBT: f64 = 8.0;

/// A value with a bound of its error.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Bounded {
    value: f64,
    error: f64,
}

impl Bounded {
    fn of(value: f64) -> Bounded {
        let exact = value == value.round() && value.abs() < 1e6;
        Bounded { value, error: if exact { 0.0 } else { EVALUATED * value.abs() } }
    }
    fn rounded(value: f64, error: f64) -> Bounded {
        Bounded { value, error: error + ROUNDED * value.abs() }
    }
    /// How many digits are lost, in steps of two or three: what is divided by passes them on to all that follows.
    fn doubt(self) -> u32 {
        let lost = (self.error / self.value).abs() / EVALUATED;
        if lost > 1.0 { (math::log2(lost) / STEP_OF_DOUBT) as u32 } else { 0 }
    }
    fn vanishes(self) -> bool {
        // What has no value is no pivot.
        self.value.is_nan() || self.error.is_nan() || self.value.abs() <= BOUNDS * self.error
    }
}

/// The values of an expression where all symbols have values of their own, and where parameters are as they are given.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    generic: Bounded,
    given: Bounded,
}

impl Estimate {
    /// From the two values.
    pub fn new(generic: f64, given: f64) -> Estimate {
        Estimate { generic: Bounded::of(generic), given: Bounded::of(given) }
    }

    fn each(self, other: Estimate, by: impl Fn(Bounded, Bounded) -> Bounded) -> Estimate {
        Estimate { generic: by(self.generic, other.generic), given: by(self.given, other.given) }
    }

    fn mapped(self, by: impl Fn(Bounded) -> Bounded) -> Estimate {
        Estimate { generic: by(self.generic), given: by(self.given) }
    }
}

/// Numbers with bounds of their errors as what elimination computes with: it tells which columns follow from which.
#[derive(Debug, Clone, Copy)]
pub struct Estimates;

impl Coefficients for Estimates {
    type Entry = Estimate;
    const ONE: Estimate = {
        let one = Bounded { value: 1.0, error: 0.0 };
        Estimate { generic: one, given: one }
    };

    fn zero(&self, e: Estimate) -> Zero {
        match (e.generic.vanishes(), e.given.vanishes()) {
            (true, _) => Zero::Always,
            (false, true) => Zero::Given,
            (false, false) => Zero::No,
        }
    }
    fn quality(&self, e: Estimate) -> (Quality, u32) {
        let unit = [e.generic, e.given].iter().all(|b| b.value.abs() == 1.0 && b.error == 0.0);
        (if unit { Quality::Unit } else { Quality::Number }, e.generic.doubt().max(e.given.doubt()))
    }
    fn is_small(&self, _: &mut NumericPoint, _: &[(usize, Estimate)], _: Estimate) -> bool {
        false
    }
    fn take_pivot(&mut self, _: Estimate, _: Quality) -> Option<Estimate> {
        None
    }
    fn plus(&mut self, a: Estimate, b: Estimate) -> Estimate {
        a.each(b, |a, b| {
            Bounded::rounded(a.value + b.value, a.error + b.error + ROUNDED * (a.value.abs() + b.value.abs()))
        })
    }
    fn times(&mut self, a: Estimate, b: Estimate) -> Estimate {
        a.each(b, |a, b| Bounded::rounded(a.value * b.value, a.value.abs() * b.error + b.value.abs() * a.error))
    }
    fn minus(&mut self, e: Estimate) -> Estimate {
        e.mapped(|b| Bounded { value: -b.value, ..b })
    }
    fn inverse(&mut self, e: Estimate) -> Estimate {
        e.mapped(|b| match b.value == 0.0 {
            true => b,
            false => Bounded::rounded(1.0 / b.value, b.error / (b.value * b.value)),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::algebra::{SparseRow, eliminate};

    /// A coefficient that cancellation has left with two digits is no pivot while there are others: divided by it, the rest
    /// would count as zero.
    #[test]
    fn pivots_keep_digits() {
        let exact = |v: f64| Estimate::new(v, v);
        let doubtful = Estimates.plus(exact(1.0 + 1e-10), exact(-1.0));
        assert_eq!(Estimates.zero(doubtful), Zero::No);
        let rows = [
            [doubtful, exact(1.0), exact(0.5)],
            [exact(2.0), exact(2.0), exact(3.0)],
            [exact(2.0), exact(2.0), exact(4.0)],
        ];
        let rows = rows.map(|row| SparseRow(row.into_iter().enumerate().collect())).to_vec();
        let done = eliminate(&mut Estimates, rows, &[vec![0], vec![1], vec![2]]);
        assert_eq!((done.pivots.len(), done.rest.len()), (3, 0));
    }
}
