//! Elementary functions: the same bits on every machine, in constants and in programs, one at a time, in lanes and in C.
//!
//! They use `+ - * /` and square roots of doubles and integers of 64 bits, never a fused multiplication, no table beyond
//! 7 kB and no memory. Bounds on their errors, in units of the last place of the result, met by every point of the tests
//! (`tests/math.rs`), which compare with 320 bits:
//!
//! | `sin cos` | `tan` | `exp` | `log log2 log10` | `pow` | `sinh` | `cosh` | `tanh asin acos atan atan2` |
//! |---|---|---|---|---|---|---|---|
//! | 0.80 | 0.90 | 0.55 | 0.51 | 0.55 | 0.80 | 0.90 | 0.60 |
//!
//! Of `exp` and `pow`, results below twice the least normal number are rounded twice: 0.80. NaN is NaN, whatever its bits.
//!
//! [`C_SOURCE`] holds the same functions in C99, line by line, with the same bits.

mod arc;
#[rustfmt::skip]
pub mod constants;
mod double;
mod exponential;
mod lanes;
mod logarithm;
mod trigonometric;

pub use arc::{acos, asin, atan, atan2};
pub use exponential::{cosh, exp, sinh, tanh};
pub use lanes::{call_lanes, pow_lanes};
pub use logarithm::{log, log2, log10, pow};
pub use trigonometric::{cos, sin, sin_cos, tan};

use super::Function;

/// These functions in C99, all `static`, named `ha_` and the name of the function: one argument as in `ha_sin(x)`, two as
/// in `ha_atan2(y, x)`, `ha_pow(x, y)`, and `ha_powi(x, n)` for [`powi`].
/// It includes `<math.h>` (for `sqrt`, `fabs`, `floor`), `<stdint.h>` and `<string.h>`, and must be compiled without
/// contraction of `a * b + c` (`-std=c99`, or `-ffp-contract=off`).
///
/// A line `//item name: others` stands before each function, table and macro, with the others that it reads, `//always` before
/// what goes with all of them: who needs a few of them can take these alone.
pub const C_SOURCE: &str = concat!(include_str!("head.c"), include_str!("constants.c"), include_str!("kernels.c"));

/// The same functions in single precision, with an `f` behind their names, and `ha_turnf` for sine and cosine at once; after
/// [`C_SOURCE`], to which they leave what is far from the ordinary. Bounds on their errors in units of the last place, met by
/// every point of the tests (`emit/tests/single.rs`):
///
/// | `sin cos` | `tan` | `exp` | `log log2 log10` | `pow` | `sinh cosh tanh` | `asin acos` | `atan atan2` |
/// |---|---|---|---|---|---|---|---|
/// | 0.9 | 2.3 | 0.9 | 0.6 | 1.5 | 1.7 | 1.2 | 2.4 |
pub const C_SOURCE_SINGLE: &str = concat!(include_str!("single_constants.c"), include_str!("single.c"));

/// A function of one argument; NaN outside its domain.
///
/// ```
/// use halfarrow_compiler::algebra::{Function, math};
/// assert_eq!(math::call(Function::Sqrt, 9.0), 3.0);
/// assert!(math::call(Function::Log, -1.0).is_nan());
/// ```
///
/// # Panics
/// If the function takes two arguments.
pub fn call(f: Function, x: f64) -> f64 {
    use Function::*;
    match f {
        Sin => sin(x),
        Cos => cos(x),
        Tan => tan(x),
        Asin => asin(x),
        Acos => acos(x),
        Atan => atan(x),
        Exp => exp(x),
        Log => log(x),
        Log10 => log10(x),
        Sqrt => x.sqrt(), // exact by the standard
        Abs => x.abs(),
        Sign => sign(x),
        Sinh => sinh(x),
        Cosh => cosh(x),
        Tanh => tanh(x),
        Floor => x.floor(),
        Atan2 | Min | Max | Mod => panic!("{} takes two arguments", f.name()),
    }
}

/// A function of two arguments.
///
/// # Panics
/// If the function takes one argument.
pub fn call2(f: Function, x: f64, y: f64) -> f64 {
    use Function::*;
    match f {
        Atan2 => atan2(x, y),
        Min => min(x, y),
        Max => max(x, y),
        Mod => x - y * (x / y).floor(),
        _ => panic!("{} takes one argument", f.name()),
    }
}

/// 1 above 0, -1 below, 0 at 0; NaN is NaN.
#[inline]
pub fn sign(x: f64) -> f64 {
    match () {
        () if x > 0.0 => 1.0,
        () if x < 0.0 => -1.0,
        () if x == 0.0 => 0.0,
        () => x,
    }
}

/// The lesser one; the other one of a NaN; the first of equal ones.
#[inline]
pub fn min(x: f64, y: f64) -> f64 {
    if y < x || x.is_nan() { y } else { x }
}

/// The greater one; the other one of a NaN; the first of equal ones.
#[inline]
pub fn max(x: f64, y: f64) -> f64 {
    if y > x || x.is_nan() { y } else { x }
}

/// `x` to the power `n` by repeated squaring.
///
/// ```
/// assert_eq!(halfarrow_compiler::algebra::math::powi(3.0, 5), 243.0);
/// ```
pub fn powi(x: f64, n: u32) -> f64 {
    let (mut result, mut square, mut left) = (1.0, x, n);
    while left > 0 {
        if left & 1 == 1 {
            result *= square;
        }
        square *= square;
        left >>= 1;
    }
    result
}

/// `x` to the power `n` of any sign.
///
/// ```
/// assert_eq!(halfarrow_compiler::algebra::math::whole_power(2.0, -3), 0.125);
/// ```
pub fn whole_power(x: f64, n: i64) -> f64 {
    match u32::try_from(n.unsigned_abs()) {
        Ok(size) if n < 0 => 1.0 / powi(x, size),
        Ok(size) => powi(x, size),
        Err(_) => pow(x, n as f64),
    }
}
