//! Linear equations that are solved again and again: matrices of one pattern, whose entries change.

mod complex;
mod dense;
mod pivoting;
mod sparse;
mod static_order;

pub(crate) use complex::ComplexLu;
pub(crate) use dense::Lu;
pub(crate) use sparse::SparseLu;

use faer::c64;
use std::ops::{AddAssign, Mul, Sub, SubAssign};

/// What matrices are made of: real or complex numbers.
pub(crate) trait Number:
    faer::traits::ComplexField + Copy + Default + AddAssign + SubAssign + Sub<Output = Self> + Mul<Output = Self>
{
    /// One over it.
    fn reciprocal(self) -> Self;

    /// Its magnitude, but for a factor below 2.
    fn magnitude(self) -> f64;
}

impl Number for f64 {
    fn reciprocal(self) -> f64 {
        1.0 / self
    }
    fn magnitude(self) -> f64 {
        self.abs()
    }
}

impl Number for c64 {
    fn reciprocal(self) -> c64 {
        self.inv()
    }
    fn magnitude(self) -> f64 {
        self.l1_norm()
    }
}
