//! Sine, cosine and tangent.
//!
//! An angle is taken to `a + b` within an eighth of a turn around 0 and a number of quarter turns. Up to [`NEAR`] that is
//! done by `pi/2` in three parts; beyond, all digits of `2/pi` that matter are multiplied in integers. Source: [Payne-Hanek], [Cody-Waite].

use super::constants::*;
use super::double::{Double, fast_two_sum, quotient, two_product, two_sum};

/// Greatest angle, in rad, that is reduced by floats.
const NEAR: f64 = 1e5;
/// Added to a number it leaves the integer nearest to it in the low bits: `1.5 2^52`.
pub const ROUNDER: f64 = 6755399441055744.0;
const SIGN: u64 = 1 << 63;
const LIMB: u64 = 0xffff_ffff;

/// An angle `a + b`, and quarter turns, of which the last two bits count.
#[derive(Debug, Clone, Copy)]
pub struct Reduced {
    a: f64,
    b: f64,
    quarters: u64,
}

/// By floats; false where that does not do. The error of `a + b` is below 2^-63 of it, for the doubles nearest to each
/// multiple of a quarter turn as well.
#[inline(always)]
pub fn near(x: f64) -> (Reduced, bool) {
    let rounded = x * TWO_OVER_PI + ROUNDER;
    let k = rounded - ROUNDER;
    let t = x - k * PIO2_SHORT; // exact
    let (a, lost) = two_sum(t, -(k * PIO2_MIDDLE)); // exact
    (Reduced { a, b: lost - k * PIO2_REST, quarters: rounded.to_bits() }, x.abs() <= NEAR)
}

/// Any angle of at least 1/2.
#[cold]
#[inline(never)]
pub fn far(x: f64) -> Reduced {
    if !x.is_finite() {
        return Reduced { a: f64::NAN, b: 0.0, quarters: 0 };
    }
    // x = mantissa 2^exponent. Multiples of 4 quarter turns are left out: those are the pieces of 2/pi before the first.
    let bits = x.to_bits();
    let exponent = ((bits >> 52) & 0x7ff) as i32 - 1075;
    let mantissa = (bits & ((1 << 52) - 1)) | (1 << 52);
    let first = ((exponent + 62) / 32) as usize;
    let shift = (exponent - 32 * (first as i32 - 1) + 30) as u32;
    let mut product = [0u64; 9];
    for (place, half) in [mantissa & LIMB, mantissa >> 32].into_iter().enumerate() {
        let mut carry = 0;
        for piece in 0..7 {
            let sum = half * u64::from(TWO_OVER_PI_BITS[first + 6 - piece]) + product[place + piece] + carry;
            product[place + piece] = sum & LIMB;
            carry = sum >> 32;
        }
        product[place + 7] = carry;
    }
    // The point is put before the 30th bit of piece 6.
    for piece in (1..7).rev() {
        product[piece] = ((((product[piece] << 32) | product[piece - 1]) << shift) >> 32) & LIMB;
    }
    let mut quarters = product[6] >> 30;
    product[6] &= 0x3fff_ffff;
    let over = product[6] >> 29 == 1;
    if over {
        quarters += 1;
        product[1..6].iter_mut().for_each(|piece| *piece = !*piece & LIMB);
        product[6] = !product[6] & 0x3fff_ffff;
    }
    let (mut hi, mut lo, mut weight) = (0.0, 0.0, 1.0 / 1073741824.0);
    for piece in (2..7).rev() {
        let (sum, rest) = fast_two_sum(hi, product[piece] as f64 * weight);
        (hi, lo) = (sum, lo + rest);
        weight *= 1.0 / 4294967296.0;
    }
    let (p, q) = two_product(hi, PIO2_HI);
    let (a, b) = fast_two_sum(p, q + (hi * PIO2_LO + lo * PIO2_HI));
    let negative = x < 0.0;
    let quarters = if negative { 4 - quarters } else { quarters };
    if negative != over { Reduced { a: -a, b: -b, quarters } } else { Reduced { a, b, quarters } }
}

/// What is added to `a` for the sine of `a + b`; `z` is `a^2`.
#[inline(always)]
fn sine_rest(r: Reduced, z: f64) -> f64 {
    let zz = z * z;
    let low = (SINE[0] + SINE[1] * z) + zz * (SINE[2] + SINE[3] * z);
    let p = low + (zz * zz) * (SINE[4] + SINE[5] * z);
    r.b * (1.0 - 0.5 * z) - (r.a * z) * p
}

/// Cosine of `a + b` as a sum, the second small.
#[inline(always)]
fn cosine_parts(r: Reduced, z: f64) -> Double {
    let zz = z * z;
    let low = (COSINE[0] + COSINE[1] * z) + zz * (COSINE[2] + COSINE[3] * z);
    let p = low + (zz * zz) * (COSINE[4] + COSINE[5] * z);
    let half = 0.5 * z;
    let w = 1.0 - half;
    (w, ((1.0 - w) - half) + (zz * p - r.a * r.b))
}

/// Sine and cosine of `a + b`.
#[inline(always)]
fn both(r: Reduced) -> (u64, u64) {
    let z = r.a * r.a;
    let sine = r.a + sine_rest(r, z);
    let (w, rest) = cosine_parts(r, z);
    // The sign is that of the angle, for an angle of -0 too.
    (sine.to_bits() | (r.a.to_bits() & SIGN), (w + rest).to_bits())
}

/// The sine of a reduced angle, or with one quarter turn more its cosine.
#[inline(always)]
fn turned(sine: u64, cosine: u64, quarters: u64) -> f64 {
    let odd = 0u64.wrapping_sub(quarters & 1);
    f64::from_bits(((sine & !odd) | (cosine & odd)) ^ ((quarters & 2) << 62))
}

/// Sine and cosine of a reduced angle.
#[inline(always)]
pub fn sine_cosine(r: Reduced) -> (f64, f64) {
    let (sine, cosine) = both(r);
    (turned(sine, cosine, r.quarters), turned(sine, cosine, r.quarters.wrapping_add(1)))
}

#[inline(always)]
fn reduce(x: f64) -> Reduced {
    let (reduced, good) = near(x);
    if good { reduced } else { far(x) }
}

/// Sine.
#[inline]
pub fn sin(x: f64) -> f64 {
    sine_cosine(reduce(x)).0
}

/// Cosine.
#[inline]
pub fn cos(x: f64) -> f64 {
    sine_cosine(reduce(x)).1
}

/// Sine and cosine.
#[inline]
pub fn sin_cos(x: f64) -> (f64, f64) {
    sine_cosine(reduce(x))
}

/// Tangent.
pub fn tan(x: f64) -> f64 {
    if x.abs() < 1.0 / 134217728.0 {
        return x;
    }
    let r = reduce(x);
    let z = r.a * r.a;
    let sine = fast_two_sum(r.a, sine_rest(r, z));
    let (w, rest) = cosine_parts(r, z);
    let cosine = fast_two_sum(w, rest);
    let (value, _) = if r.quarters & 1 == 0 { quotient(sine, cosine) } else { quotient(cosine, (-sine.0, -sine.1)) };
    value
}
