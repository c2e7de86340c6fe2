//! Points at which functions are tried, and their values to 320 bits and more.

use astro_float_num::{BigFloat, Consts, RoundingMode};
use halfarrow_compiler::algebra::{Function, math};

/// A function to try.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kernel {
    One(Function),
    Two(Function),
    Log2,
    Power,
}

impl Kernel {
    pub fn value(self, x: f64, y: f64) -> f64 {
        match self {
            Kernel::One(f) => math::call(f, x),
            Kernel::Two(f) => math::call2(f, x, y),
            Kernel::Log2 => math::log2(x),
            Kernel::Power => math::pow(x, y),
        }
    }
}

/// Numbers that follow from each other. Source: [SplitMix].
struct Random(u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e3779b97f4a7c15);
        let a = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58476d1ce4e5b9);
        let b = (a ^ (a >> 27)).wrapping_mul(0x94d049bb133111eb);
        b ^ (b >> 31)
    }
    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * ((self.bits() >> 11) as f64 / 9007199254740992.0)
    }
    /// A number of either sign whose magnitude may be any power of two between these.
    fn magnitude(&mut self, low: i64, high: i64) -> f64 {
        let power = low + (self.bits() % (high - low) as u64) as i64;
        let size = f64::from_bits(((power + 1023) as u64) << 52 | self.bits() >> 12);
        if self.bits() & 1 == 0 { size } else { -size }
    }
}

const SPECIAL: [f64; 22] = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    0.5,
    -2.0,
    3.0,
    1e300,
    -1e22,
    f64::INFINITY,
    f64::NEG_INFINITY,
    f64::NAN,
    f64::MAX,
    f64::MIN_POSITIVE,
    5e-324,
    -1e-310,
    std::f64::consts::FRAC_PI_4,
    std::f64::consts::FRAC_PI_2,
    std::f64::consts::PI,
    1e5,
    708.0,
    -745.1,
];

/// Special values, then numbers near where the function changes its way, then any number.
pub fn points(kernel: Kernel, count: usize) -> Vec<(f64, f64)> {
    let mut all: Vec<(f64, f64)> = SPECIAL.iter().flat_map(|&x| SPECIAL.iter().map(move |&y| (x, y))).collect();
    let mut random = Random(kernel.value(0.3, 0.7).to_bits());
    while all.len() < SPECIAL.len() * SPECIAL.len() + count {
        let x = match all.len() % 8 {
            0 => random.between(-4.0, 4.0),
            1 => random.between(-1.0, 1.0),
            2 => random.between(-750.0, 750.0),
            3 => random.magnitude(-60, 12),
            // Near multiples of a quarter turn, and near 1.
            4 => {
                (random.bits() >> (34 + random.bits() % 28)) as f64
                    * std::f64::consts::FRAC_PI_2
                    * random.between(0.99999, 1.00001)
            }
            5 => 1.0 + random.magnitude(-53, -3),
            6 => random.between(-2e5, 2e5),
            _ => f64::from_bits(random.bits()),
        };
        let y = match all.len() % 5 {
            0 => random.between(-3.0, 3.0),
            1 => random.between(-300.0, 300.0).round(),
            2 => random.magnitude(-30, 12),
            // A power that is neither 0 nor infinite.
            3 => random.between(-744.0, 709.0) / math::log(x.abs()),
            _ => f64::from_bits(random.bits()),
        };
        all.push((x, y));
    }
    all
}

const ROUNDING: RoundingMode = RoundingMode::None;

/// The number itself; the library loses digits of those below the normal ones.
fn exact(x: f64, p: usize) -> BigFloat {
    let shift = 1.157920892373162e77; // 2^256
    match x.abs() < 1e-200 {
        true => BigFloat::from_f64(x * shift, p).div(&BigFloat::from_f64(shift, p), p, ROUNDING),
        false => BigFloat::from_f64(x, p),
    }
}

/// How far a value is from the function, in units of its last place; `None` where the function has no finite value or
/// the exact one is known (special values have a test of their own).
pub fn error_in_last_places(kernel: Kernel, (x, y): (f64, f64), value: f64) -> Option<f64> {
    use Function::*;
    if !x.is_finite() || x == 0.0 || !y.is_finite() && matches!(kernel, Kernel::Two(_) | Kernel::Power) {
        return None;
    }
    let p = if matches!(kernel, Kernel::One(Sin | Cos | Tan)) { 1300 } else { 320 };
    let c = &mut Consts::new().unwrap();
    let (a, b) = (exact(x, p), exact(y, p));
    let value_there = match kernel {
        Kernel::One(Sin) => a.sin(p, ROUNDING, c),
        Kernel::One(Cos) => a.cos(p, ROUNDING, c),
        Kernel::One(Tan) => a.tan(p, ROUNDING, c),
        Kernel::One(Exp) if x.abs() < 800.0 => a.exp(p, ROUNDING, c),
        Kernel::One(Sinh) if x.abs() < 800.0 => a.sinh(p, ROUNDING, c),
        Kernel::One(Cosh) if x.abs() < 800.0 => a.cosh(p, ROUNDING, c),
        Kernel::One(Tanh) if x.abs() < 800.0 => a.tanh(p, ROUNDING, c),
        Kernel::One(Log) if x > 0.0 && x != 1.0 => a.ln(p, ROUNDING, c),
        Kernel::One(Log10) if x > 0.0 && x != 1.0 => a.log10(p, ROUNDING, c),
        Kernel::Log2 if x > 0.0 && x != 1.0 => a.log2(p, ROUNDING, c),
        Kernel::One(Asin) if x.abs() < 1.0 => a.asin(p, ROUNDING, c),
        Kernel::One(Acos) if x.abs() < 1.0 => a.acos(p, ROUNDING, c),
        Kernel::One(Atan) => a.atan(p, ROUNDING, c),
        Kernel::Two(Atan2) if y > 0.0 => a.div(&b, p, ROUNDING).atan(p, ROUNDING, c),
        Kernel::Power if x > 0.0 && x != 1.0 && (y * math::log(x)).abs() < 800.0 => {
            a.ln(p, ROUNDING, c).mul(&b, p, ROUNDING).exp(p, ROUNDING, c)
        }
        _ => return None,
    };
    let power = value_there.exponent()? - 1;
    if power >= 1024 || !value.is_finite() {
        // The greatest number is rounded to from half a unit beyond it.
        assert!(value.is_infinite() && power >= 1023, "{kernel:?} of {x:e} {y:e} is {value:e}");
        return None;
    }
    let unit = power.max(-1022) - 52;
    let off = value_there.sub(&exact(value, p), p, ROUNDING);
    if off.is_zero() {
        return Some(0.0);
    }
    let leading = *off.mantissa_digits()?.last()? as f64 / 18446744073709551616.0;
    Some(leading * math::whole_power(2.0, (off.exponent()? - unit).clamp(-900, 900).into()))
}
