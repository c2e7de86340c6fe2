//! Exponential and hyperbolic functions.
//!
//! `e^x = 2^(k/64) e^r` with `|r| <= ln 2/128`; powers of two are in a table, with what their nearest numbers lack.

use super::constants::*;
use super::double::{Double, fast_two_sum, quotient, two_sum};
use super::trigonometric::ROUNDER;

/// Arguments up to this have normal results.
pub const PLAIN: f64 = 708.0;
/// Beyond, results are infinite.
const MOST: f64 = 709.782712893384;
/// Below, results are 0.
const LEAST: f64 = -745.1332191019412;
const BIAS: u64 = 1023 << 52;

/// `e^(a + b)` as `2^power (t + rest)`.
#[derive(Debug, Clone, Copy)]
pub struct Exponential {
    /// Between 1 and 2.
    pub t: f64,
    /// Small against it.
    pub rest: f64,
    /// The power of two in its low 12 bits.
    power: u64,
}

/// For `|a| < 1e5`, `b` small against it.
#[inline(always)]
pub fn parts(a: f64, b: f64) -> Exponential {
    let rounded = a * STEPS_PER_E + ROUNDER;
    let k = rounded - ROUNDER;
    let r = ((a - k * STEP_SHORT) - k * STEP_REST) + b;
    let bits = rounded.to_bits();
    let [t, lack] = POWERS[(bits & 63) as usize];
    let rr = r * r;
    let p = r + rr * ((EXPONENTIAL[0] + EXPONENTIAL[1] * r) + rr * (EXPONENTIAL[2] + EXPONENTIAL[3] * r));
    Exponential { t, rest: lack + t * p, power: bits >> 6 }
}

impl Exponential {
    /// The value, where it and the power are normal numbers.
    #[inline(always)]
    pub fn value(self) -> f64 {
        f64::from_bits((self.power << 52).wrapping_add(BIAS)) * (self.t + self.rest)
    }

    /// The value, which may be beyond the normal numbers by a factor of 2^1000.
    pub fn extreme_value(self) -> f64 {
        let power = ((self.power << 52) as i64) >> 52;
        let first = power >> 1;
        let scale = |power: i64| f64::from_bits(((power + 1023) as u64) << 52);
        (self.t + self.rest) * scale(first) * scale(power - first)
    }

    fn halved(self) -> Exponential {
        Exponential { power: self.power.wrapping_sub(1), ..self }
    }

    /// Half of the value as a sum.
    #[inline(always)]
    fn half(self) -> Double {
        let scale = f64::from_bits((self.power << 52).wrapping_add(BIAS - (1 << 52)));
        (scale * self.t, scale * self.rest)
    }
}

/// `e^x`.
#[inline]
pub fn exp(x: f64) -> f64 {
    if x.abs() <= PLAIN { parts(x, 0.0).value() } else { extreme_exp(x) }
}

#[cold]
#[inline(never)]
fn extreme_exp(x: f64) -> f64 {
    match () {
        () if x.is_nan() => x,
        () if x > MOST => f64::INFINITY,
        () if x < LEAST => 0.0,
        () => parts(x, 0.0).extreme_value(),
    }
}

/// Hyperbolic sine.
pub fn sinh(x: f64) -> f64 {
    let size = x.abs();
    if size < 1.0 {
        return if size < 1.0 / 134217728.0 { x } else { x + sinh_rest(x, x * x) };
    }
    if size > 711.0 || x.is_nan() {
        return x * f64::INFINITY;
    }
    let value = if size > PLAIN {
        parts(size, 0.0).halved().extreme_value()
    } else {
        let (hi, lo) = parts(size, 0.0).half();
        hi + (lo - 0.25 / (hi + lo))
    };
    if x < 0.0 { -value } else { value }
}

#[inline(always)]
fn sinh_rest(x: f64, z: f64) -> f64 {
    let zz = z * z;
    let low = SINH[0] + SINH[1] * z;
    let high = (SINH[2] + SINH[3] * z) + zz * ((SINH[4] + SINH[5] * z) + zz * SINH[6]);
    (x * z) * (low + zz * high)
}

/// Hyperbolic cosine.
pub fn cosh(x: f64) -> f64 {
    let size = x.abs();
    if size > 711.0 || x.is_nan() {
        return size * f64::INFINITY;
    }
    if size > PLAIN {
        return parts(size, 0.0).halved().extreme_value();
    }
    let (hi, lo) = parts(size, 0.0).half();
    hi + (lo + 0.25 / (hi + lo))
}

/// Hyperbolic tangent.
pub fn tanh(x: f64) -> f64 {
    let size = x.abs();
    if size < 1.0 / 134217728.0 || x.is_nan() {
        return x;
    }
    let value = if size < 0.35 {
        let z = size * size;
        let zz = z * z;
        let p = (COSH[0] + COSH[1] * z) + zz * ((COSH[2] + COSH[3] * z) + zz * (COSH[4] + COSH[5] * z));
        quotient(fast_two_sum(size, sinh_rest(size, z)), fast_two_sum(1.0, z * p)).0
    } else if size < 20.0 {
        let (hi, lo) = parts(2.0 * size, 0.0).half();
        let (below, rest_below) = two_sum(hi, -0.5);
        let (above, rest_above) = two_sum(hi, 0.5);
        quotient(fast_two_sum(below, rest_below + lo), fast_two_sum(above, rest_above + lo)).0
    } else {
        1.0
    };
    if x < 0.0 { -value } else { value }
}
