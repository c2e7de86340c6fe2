//! Elementary functions: the same bits on every machine, in constants and in programs.

use super::Function;

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
        Sin => libm::sin(x),
        Cos => libm::cos(x),
        Tan => libm::tan(x),
        Asin => libm::asin(x),
        Acos => libm::acos(x),
        Atan => libm::atan(x),
        Exp => libm::exp(x),
        Log => libm::log(x),
        Log10 => libm::log10(x),
        Sqrt => x.sqrt(), // exact by the standard
        Abs => x.abs(),
        Sign if x == 0.0 => 0.0,
        Sign => x.signum(),
        Sinh => libm::sinh(x),
        Cosh => libm::cosh(x),
        Tanh => libm::tanh(x),
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
        Atan2 => libm::atan2(x, y),
        Min => x.min(y),
        Max => x.max(y),
        Mod => x - y * (x / y).floor(),
        _ => panic!("{} takes one argument", f.name()),
    }
}

/// `x` to the power `y`.
pub fn pow(x: f64, y: f64) -> f64 {
    libm::pow(x, y)
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

/// Logarithm of `x` to the base 2.
pub fn log2(x: f64) -> f64 {
    libm::log2(x)
}

/// Derivative of [`call`] by its argument; `value` is `call(f, x)`.
pub fn slope(f: Function, x: f64, value: f64) -> f64 {
    use Function::*;
    match f {
        Sin => libm::cos(x),
        Cos => -libm::sin(x),
        Tan => 1.0 + value * value,
        Asin => 1.0 / (1.0 - x * x).sqrt(),
        Acos => -1.0 / (1.0 - x * x).sqrt(),
        Atan => 1.0 / (1.0 + x * x),
        Exp => value,
        Log => 1.0 / x,
        Log10 => 1.0 / (x * std::f64::consts::LN_10),
        Sqrt => 0.5 / value,
        Abs => call(Sign, x),
        Sinh => libm::cosh(x),
        Cosh => libm::sinh(x),
        Tanh => 1.0 - value * value,
        Sign | Floor | Atan2 | Min | Max | Mod => 0.0,
    }
}

/// Derivative of [`call2`] along `(dx, dy)`.
pub fn slope2(f: Function, (x, dx): (f64, f64), (y, dy): (f64, f64)) -> f64 {
    use Function::*;
    match f {
        Atan2 => (y * dx - x * dy) / (x * x + y * y),
        Min => [dy, dx][usize::from(x < y)],
        Max => [dy, dx][usize::from(x > y)],
        Mod => dx - dy * (x / y).floor(),
        _ => 0.0,
    }
}
