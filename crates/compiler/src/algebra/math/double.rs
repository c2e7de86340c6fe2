//! Numbers as the sum of two: some 104 bits.

/// A sum `hi + lo`, `lo` small against `hi`.
pub type Double = (f64, f64);

/// The low 27 bits of a mantissa.
const LOW: u64 = (1 << 27) - 1;

/// `a + b` exactly, where `|a| >= |b|` or `a` is 0. Source: [Dekker].
#[inline(always)]
pub fn fast_two_sum(a: f64, b: f64) -> Double {
    let sum = a + b;
    (sum, b - (sum - a))
}

/// `a + b` exactly. Source: [Knuth].
#[inline(always)]
pub fn two_sum(a: f64, b: f64) -> Double {
    let sum = a + b;
    let part = sum - a;
    (sum, (a - (sum - part)) + (b - part))
}

/// The leading 26 bits.
#[inline(always)]
pub fn leading(a: f64) -> f64 {
    f64::from_bits(a.to_bits() & !LOW)
}

/// `a b` to 104 bits, where no part of it underflows. Source: [Dekker].
#[inline(always)]
pub fn two_product(a: f64, b: f64) -> Double {
    let (product, ah, bh) = (a * b, leading(a), leading(b));
    let (al, bl) = (a - ah, b - bh);
    (product, (((ah * bh - product) + ah * bl) + al * bh) + al * bl)
}

/// `a b` for a number `b`.
#[inline(always)]
pub fn times(a: Double, b: f64) -> Double {
    let (hi, lo) = two_product(a.0, b);
    fast_two_sum(hi, lo + a.1 * b)
}

/// `a b`.
#[inline(always)]
pub fn product(a: Double, b: Double) -> Double {
    let (hi, lo) = two_product(a.0, b.0);
    fast_two_sum(hi, lo + (a.0 * b.1 + a.1 * b.0))
}

/// `a + b`.
#[inline(always)]
pub fn sum(a: Double, b: Double) -> Double {
    let (hi, lo) = two_sum(a.0, b.0);
    fast_two_sum(hi, lo + (a.1 + b.1))
}

/// `a / b`.
#[inline(always)]
pub fn quotient(a: Double, b: Double) -> Double {
    let first = a.0 / b.0;
    let (hi, lo) = two_product(first, b.0);
    let rest = ((a.0 - hi) - lo) + (a.1 - first * b.1);
    fast_two_sum(first, rest / b.0)
}
