//! The same functions of several arguments at once.
//!
//! The usual way has no branch and is written as a plain loop, which the compiler turns into vector instructions; lanes
//! that need another way are computed again, one by one.

use super::exponential::{PLAIN, parts};
use super::logarithm::{is_plain, parts_of_log};
use super::trigonometric::{near, sine_cosine};
use super::{call, cos, exp, log, pow, sin};
use crate::algebra::Function;

/// [`call`] for each lane.
///
/// ```
/// use halfarrow_compiler::algebra::{Function, math};
/// let lanes = math::call_lanes(Function::Exp, &[0.0, 1.0, 800.0, -2.5]);
/// assert_eq!(lanes, [1.0, math::exp(1.0), f64::INFINITY, math::exp(-2.5)]);
/// ```
#[inline(always)]
pub fn call_lanes<const N: usize>(f: Function, x: &[f64; N]) -> [f64; N] {
    match f {
        Function::Sin => lanes(x, usual_sin, sin),
        Function::Cos => lanes(x, usual_cos, cos),
        Function::Exp => lanes(x, usual_exp, exp),
        Function::Log => lanes(x, usual_log, log),
        _ => x.map(|x| call(f, x)),
    }
}

/// [`pow`] for each lane.
#[inline(always)]
pub fn pow_lanes<const N: usize>(x: &[f64; N], y: &[f64; N]) -> [f64; N] {
    std::array::from_fn(|i| pow(x[i], y[i]))
}

#[inline(always)]
fn lanes<const N: usize>(x: &[f64; N], usual: impl Fn(f64) -> (f64, bool), any: impl Fn(f64) -> f64) -> [f64; N] {
    let (mut values, mut good) = ([0.0; N], [true; N]);
    for i in 0..N {
        (values[i], good[i]) = usual(x[i]);
    }
    if good != [true; N] {
        (0..N).filter(|&i| !good[i]).for_each(|i| values[i] = any(x[i]));
    }
    values
}

#[inline(always)]
fn usual_sin(x: f64) -> (f64, bool) {
    let (reduced, good) = near(x);
    (sine_cosine(reduced).0, good)
}

#[inline(always)]
fn usual_cos(x: f64) -> (f64, bool) {
    let (reduced, good) = near(x);
    (sine_cosine(reduced).1, good)
}

#[inline(always)]
fn usual_exp(x: f64) -> (f64, bool) {
    (parts(x, 0.0).value(), x.abs() <= PLAIN)
}

#[inline(always)]
fn usual_log(x: f64) -> (f64, bool) {
    (parts_of_log(x, 0.0).0, is_plain(x))
}
