//! Linear equations that are solved again and again: matrices of one pattern, whose entries change.

mod complex;
mod dense;
mod pivoting;
mod sparse;
mod static_order;

pub(crate) use complex::ComplexLu;
pub(crate) use dense::Lu;
pub use sparse::SparseLu;

use faer::c64;
use std::ops::{AddAssign, Mul, Range, Sub, SubAssign};

/// The diagonal of a full matrix stays the pivot while it is at least this fraction of the best one in its column.
const THRESHOLD: f64 = 0.1;

/// The row to bring to the first place of these, up to the last of the matrix: the one that stands there if it is good
/// enough. `None` if all are 0 to rounding.
fn pivot_row(places: Range<usize>, weight: impl Fn(usize) -> f64) -> Option<usize> {
    let (first, size) = (places.start, places.end);
    let mut best = first;
    for row in first + 1..size {
        if weight(row) > weight(best) || weight(row).is_nan() {
            best = row;
        }
    }
    let best = if weight(first) >= THRESHOLD * weight(best) { first } else { best };
    (weight(best) > f64::EPSILON * size as f64).then_some(best)
}

/// What matrices are made of: real or complex numbers.
pub trait Number:
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
