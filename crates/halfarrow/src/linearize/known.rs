//! Numbers of which is known what roundings make of them. Source: \[Vignes\].

use crate::linear_algebra::scatter;

/// How many values each number has besides its own: those that it takes if the entries of matrices are rounded otherwise.
pub(super) const TRIALS: usize = 3;
/// Roundings that every entry of a matrix has seen.
const ROUNDINGS: f64 = 8.0;
/// A difference below so many times what roundings make of it is none.
const NOISE: f64 = 16.0;

/// A number, and what it would be in other trials: how far these are from it is how far it is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Known([f64; TRIALS + 1]);

impl Known {
    /// Nothing at all, in every trial.
    pub(super) const ZERO: Known = Known([0.0; TRIALS + 1]);

    /// A number that has seen roundings, scattered by a generator.
    pub(super) fn rounded(value: f64, noise: &mut u32) -> Known {
        let mut values = [value; TRIALS + 1];
        for value in &mut values[1..] {
            *value *= 1.0 + ROUNDINGS * f64::EPSILON * scatter(noise);
        }
        Known(values)
    }

    /// Its value in a trial; 0 is its own.
    pub(super) fn in_trial(&self, trial: usize) -> f64 {
        self.0[trial]
    }

    /// Whether it is nothing.
    pub(super) fn is_zero(&self) -> bool {
        *self == Known::ZERO
    }

    /// Whether it is a number in every trial.
    pub(super) fn is_finite(&self) -> bool {
        self.0.iter().all(|value| value.is_finite())
    }

    /// Its magnitude.
    pub(super) fn size(&self) -> f64 {
        self.0[0].abs()
    }

    /// With the other sign.
    pub(super) fn negative(self) -> Known {
        Known(self.0.map(|value| -value))
    }

    /// Divided by another one, which is not nothing.
    pub(super) fn over(self, other: Known) -> Known {
        Known(std::array::from_fn(|i| self.0[i] / other.0[i]))
    }

    /// Less a product; nothing if what is left is no more than roundings make of it.
    pub(super) fn less(self, factor: Known, of: Known) -> Known {
        if factor.is_zero() || of.is_zero() {
            return self;
        }
        let values: [f64; TRIALS + 1] = std::array::from_fn(|i| self.0[i] - factor.0[i] * of.0[i]);
        let apart = values.iter().map(|value| (value - values[0]).abs()).fold(0.0, f64::max);
        if values[0].abs() <= NOISE * apart { Known::ZERO } else { Known(values) }
    }
}
