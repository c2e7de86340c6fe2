//! Logarithms and powers.
//!
//! `x = 2^k m`; `m c = 1 + r` exactly, with `c` of a table a short number near `1/m`, so that `ln x = k ln 2 - ln c +
//! ln(1 + r)`. The sum is kept to some 68 bits: enough for a power, whose exponent multiplies the error by up to 700.

use super::constants::*;
use super::double::{Double, fast_two_sum, leading, product, times};
use super::exponential::{PLAIN, parts};

const BIAS: u64 = 1023 << 52;
/// Bits of `2^52`.
const INTEGERS: u64 = 0x4330_0000_0000_0000;
const SIGN: u64 = 1 << 63;
const INFINITE: u64 = 0x7ff << 52;
/// Exponents up to this are multiplied without overflow; beyond, every power but that of 1 is 0 or infinite.
const GREATEST_EXPONENT: f64 = 1180591620717411303424.0; // 2^70

/// Whether it is a positive normal number.
#[inline(always)]
pub fn is_plain(x: f64) -> bool {
    x.to_bits().wrapping_sub(1 << 52) < INFINITE - (1 << 52)
}

/// `ln(x 2^-shift)` of a positive normal number.
#[inline(always)]
pub fn parts_of_log(x: f64, shift: f64) -> Double {
    let bits = x.to_bits();
    let place = bits.wrapping_sub(BINS_START).wrapping_add(BIAS);
    let power = place >> 52;
    let k = (f64::from_bits(power | INTEGERS) - 4503599627371519.0) - shift;
    let m = f64::from_bits(bits.wrapping_sub(power << 52).wrapping_add(BIAS));
    let [c, log, log_rest] = LOGARITHMS[((place >> 45) & 127) as usize];
    let head = leading(m);
    let (r, r_rest) = fast_two_sum(head * c - 1.0, (m - head) * c); // both exact
    let short = leading(r);
    let tail = r - short;
    let square = 0.5 * (short * short); // exact
    let square_rest = tail * (short + 0.5 * tail);
    let (s, lost) = fast_two_sum(k * LN2_SHORT + log, r);
    let (s, more) = fast_two_sum(s, -square);
    let rr = r * r;
    let low = LOGARITHM[0] + LOGARITHM[1] * r;
    let high = (LOGARITHM[2] + LOGARITHM[3] * r) + rr * ((LOGARITHM[4] + LOGARITHM[5] * r) + rr * LOGARITHM[6]);
    let cube = (r * rr) * (low + rr * high);
    let rests = ((k * LN2_REST + log_rest) + (r_rest - r * r_rest)) + (lost + more);
    fast_two_sum(s, rests + (cube - square_rest))
}

/// The logarithm of any positive finite number.
fn positive(x: f64) -> Double {
    if is_plain(x) { parts_of_log(x, 0.0) } else { parts_of_log(x * 18014398509481984.0, 54.0) } // 2^54
}

/// Natural logarithm.
#[inline]
pub fn log(x: f64) -> f64 {
    if is_plain(x) { parts_of_log(x, 0.0).0 } else { extreme_log(x, (1.0, 0.0)) }
}

/// Logarithm to the base 10.
pub fn log10(x: f64) -> f64 {
    extreme_log(x, (LOG10_E_HI, LOG10_E_LO))
}

/// Logarithm to the base 2.
pub fn log2(x: f64) -> f64 {
    extreme_log(x, (LOG2_E_HI, LOG2_E_LO))
}

/// A multiple of the logarithm of any number.
fn extreme_log(x: f64, factor: Double) -> f64 {
    match () {
        () if x.is_nan() => x,
        () if x == 0.0 => f64::NEG_INFINITY,
        () if x < 0.0 => f64::NAN,
        () if x == f64::INFINITY => x,
        () => product(positive(x), factor).0,
    }
}

/// `x` to the power `y`.
#[inline]
pub fn pow(x: f64, y: f64) -> f64 {
    if is_plain(x) & (y.abs() <= GREATEST_EXPONENT) {
        let (hi, lo) = times(parts_of_log(x, 0.0), y);
        if hi.abs() <= PLAIN {
            return parts(hi, lo).value();
        }
    }
    extreme_pow(x, y)
}

#[cold]
#[inline(never)]
fn extreme_pow(x: f64, y: f64) -> f64 {
    if y == 0.0 || x == 1.0 {
        return 1.0;
    }
    if x.is_nan() || y.is_nan() {
        return x + y;
    }
    let size = x.abs();
    let value = match () {
        () if y.is_infinite() && size == 1.0 => return 1.0,
        () if y.is_infinite() => [0.0, f64::INFINITY][usize::from((size > 1.0) == (y > 0.0))],
        () if size == 0.0 || size == f64::INFINITY => [0.0, f64::INFINITY][usize::from((size > 1.0) == (y > 0.0))],
        () => {
            let y = y.clamp(-GREATEST_EXPONENT, GREATEST_EXPONENT);
            let (hi, lo) = times(positive(size), y);
            match () {
                () if hi > 710.0 => f64::INFINITY,
                () if hi < -746.0 => 0.0,
                () => parts(hi, lo).extreme_value(),
            }
        }
    };
    let negative = x.to_bits() & SIGN != 0;
    let whole = y.floor() == y;
    if negative && !whole && x != 0.0 && size != f64::INFINITY && y.is_finite() {
        return f64::NAN;
    }
    // Numbers beyond 2^53 are even.
    let odd = negative && whole && y.abs() < 9007199254740992.0 && (0.5 * y).floor() != 0.5 * y;
    if odd { -value } else { value }
}
