//! Inverse trigonometric functions: all are the angle of a vector.
//!
//! `atan(n/d) = atan(j/8) + atan(t)`, `t = (n - d j/8)/(d + n j/8)`, with `j` the integer nearest to `8 n/d`. For one number
//! `x`: `atan(x) = atan(c) + atan(t)`, `t = (x - c)/(1 + x c)`, with `c` the middle of the quarter of its octave.

use super::constants::*;
use super::double::{Double, fast_two_sum, leading, product, quotient, sum, two_product, two_sum};
use super::trigonometric::ROUNDER;

/// Below this the arc is its sine: 2^-27.
const TINY: f64 = 1.0 / 134217728.0;
/// Below this the arc needs no other arc beside it.
const SMALL: f64 = 1.0 / 16.0;
const QUARTER: Double = (PIO2_HI, PIO2_LO);
const HALF: Double = (PI_HI, PI_LO);

/// The angle of the vector `(d, n)` in the first quadrant, of numbers far from the ends of the range.
fn angle(n: Double, d: Double) -> Double {
    if n.0 > d.0 {
        let rest = below_diagonal(d, n);
        return sum(QUARTER, (-rest.0, -rest.1));
    }
    below_diagonal(n, d)
}

fn below_diagonal(n: Double, d: Double) -> Double {
    let rounded = 8.0 * (n.0 / d.0) + ROUNDER;
    let j = rounded - ROUNDER;
    let c = (0.125 * j, 0.0);
    let (down, across) = (product(d, c), product(n, c));
    let t = quotient(sum(n, (-down.0, -down.1)), sum(d, across));
    let z = t.0 * t.0;
    let p = short_arc(z);
    let [arc, arc_rest] = ARCS[(rounded.to_bits() & 15) as usize];
    let (hi, lo) = two_sum(arc, t.0);
    fast_two_sum(hi, lo + (arc_rest + (t.1 - (t.0 * z) * p)))
}

/// `sqrt((1 - x) (1 + x))` for `x` between 0 and 1, not near 1 to the last bits of a zero.
fn complement(x: f64) -> Double {
    let (low, high) = (two_sum(1.0, -x), two_sum(1.0, x));
    let (v, v_rest) = product(low, high);
    let root = v.sqrt();
    if root == 0.0 {
        return (0.0, 0.0);
    }
    let (hi, lo) = two_product(root, root);
    fast_two_sum(root, (((v - hi) - lo) + v_rest) / (2.0 * root))
}

/// Inverse sine.
pub fn asin(x: f64) -> f64 {
    let size = x.abs();
    if size < TINY || x.is_nan() {
        return x;
    }
    if size > 1.0 {
        return f64::NAN;
    }
    let value = angle((size, 0.0), complement(size)).0;
    if x < 0.0 { -value } else { value }
}

/// Inverse cosine.
pub fn acos(x: f64) -> f64 {
    let size = x.abs();
    if x.is_nan() {
        return x;
    }
    if size > 1.0 {
        return f64::NAN;
    }
    if size < 1.0 / 1152921504606846976.0 {
        return PIO2_HI;
    }
    let value = angle(complement(size), (size, 0.0));
    if x < 0.0 { sum(HALF, (-value.0, -value.1)).0 } else { value.0 }
}

/// Inverse tangent.
pub fn atan(x: f64) -> f64 {
    let size = x.abs();
    if size < TINY || x.is_nan() {
        return x;
    }
    let value = match () {
        () if size < SMALL => size - size * (size * size) * short_arc(size * size),
        () if size > 1e18 => PIO2_HI,
        () if size >= 16.0 => arc_beyond([PIO2_HI, PIO2_LO], -1.0, (size, 0.0)),
        () => {
            let quarter = size.to_bits() >> 50;
            let c = f64::from_bits(quarter << 50 | 1 << 49);
            let across = two_product(size, c);
            let (d, rest) = two_sum(1.0, across.0);
            arc_beyond(ARCS_OF_QUARTERS[(quarter - (SMALL.to_bits() >> 50)) as usize], size - c, (d, rest + across.1))
        }
    };
    if x < 0.0 { -value } else { value }
}

/// `(t - atan t)/t^3` by `t^2`.
#[inline(always)]
fn short_arc(z: f64) -> f64 {
    let zz = z * z;
    (ARC[0] + ARC[1] * z) + zz * ((ARC[2] + ARC[3] * z) + zz * ARC[4])
}

/// An arc that is known, and `atan(n/d)` for a small `n/d`.
#[inline(always)]
fn arc_beyond([arc, arc_rest]: [f64; 2], n: f64, (d, d_rest): Double) -> f64 {
    let inverse = 1.0 / d;
    let (hi, front) = (leading(n * inverse), leading(d));
    let lo = ((n - hi * front) - hi * ((d - front) + d_rest)) * inverse;
    let t = hi + lo;
    let z = t * t;
    let (sum, rest) = fast_two_sum(arc, hi);
    sum + (rest + (arc_rest + (lo - (t * z) * short_arc(z))))
}

/// The angle of the vector `(x, y)`, above `-pi` and up to `pi`.
pub fn atan2(y: f64, x: f64) -> f64 {
    if x.is_nan() || y.is_nan() {
        return x + y;
    }
    let (n, d) = (y.abs(), x.abs());
    let behind = x.to_bits() >> 63 == 1;
    let value = match () {
        () if n == 0.0 => [0.0, PI_HI][usize::from(behind)],
        () if d == 0.0 => PIO2_HI,
        () if n == d && n == f64::INFINITY => [0.25, 0.75][usize::from(behind)] * PI_HI,
        () if n == f64::INFINITY => PIO2_HI,
        () if d == f64::INFINITY => [0.0, PI_HI][usize::from(behind)],
        () => finite_angle(n, d, behind),
    };
    if y.to_bits() >> 63 == 1 { -value } else { value }
}

/// The angle of `(d, n)`, or of `(-d, n)`, for any positive numbers.
fn finite_angle(n: f64, d: f64, behind: bool) -> f64 {
    // To numbers around 1: a power of two, in two steps as it may be beyond the range.
    let most = if n > d { n } else { d };
    let power = (((most.to_bits() >> 52) & 0x7ff) as i64).max(1) - 1023;
    let first = -power >> 1;
    let scale = |power: i64| f64::from_bits(((power + 1023) as u64) << 52);
    let (one, other) = (scale(first), scale(-power - first));
    let (up, along) = (n * one * other, d * one * other);
    if up < TINY * along && !behind {
        return n / d;
    }
    let flat = 1.0 / 1267650600228229401496703205376.0; // 2^-100
    let (up, along) = (if up < flat { 0.0 } else { up }, if along < flat { 0.0 } else { along });
    let value = angle((up, 0.0), (along, 0.0));
    if behind { sum(HALF, (-value.0, -value.1)).0 } else { value.0 }
}
