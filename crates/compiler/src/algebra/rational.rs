//! Exact numbers: machine integers where they suffice, big ones behind them.

use dashu_base::{BitTest, Signed, UnsignedAbs};
use dashu_int::{IBig, UBig};
use dashu_ratio::RBig;
use num_integer::Integer;
use std::cmp::Ordering;
use std::fmt;
use std::hash::{Hash, Hasher};
use std::ops::{Add, Mul, Neg, Sub};

/// An exact rational number.
///
/// Invariant: in lowest terms, the denominator positive; held as big integers only if either part does not fit `i64`.
///
/// ```
/// use halfarrow_compiler::algebra::Rational;
/// let third = Rational::new(1, 3);
/// assert_eq!(&(&third + &third) + &third, Rational::from(1));
/// ```
#[derive(Clone, PartialEq, Eq, Hash)]
pub struct Rational(Repr);

#[derive(Clone, PartialEq, Eq)]
enum Repr {
    Small(i64, i64),
    Big(Box<RBig>),
}

/// Of parts in lowest terms.
impl Hash for Repr {
    fn hash<H: Hasher>(&self, state: &mut H) {
        match self {
            Repr::Small(n, d) => (n, d).hash(state),
            Repr::Big(big) => (big.numerator(), big.denominator()).hash(state),
        }
    }
}

impl Rational {
    /// `numerator / denominator`, for numbers that stand in the program; others are divided by [`over`](Rational::over).
    /// Panics if the denominator is zero.
    pub fn new(numerator: i64, denominator: i64) -> Self {
        assert!(denominator != 0, "a rational needs a denominator that is not zero");
        Self::reduced(i128::from(numerator), i128::from(denominator))
    }

    /// The number of a big rational.
    pub fn from_big(value: RBig) -> Self {
        match (i64::try_from(value.numerator()), i64::try_from(value.denominator())) {
            (Ok(n), Ok(d)) if n != i64::MIN => Rational(Repr::Small(n, d)),
            _ => Rational(Repr::Big(Box::new(value))),
        }
    }

    /// The same number as a big rational.
    pub fn to_big(&self) -> RBig {
        match &self.0 {
            Repr::Small(n, d) => RBig::from_parts(IBig::from(*n), UBig::from(d.unsigned_abs())),
            Repr::Big(big) => (**big).clone(),
        }
    }

    /// The exact value of a decimal such as `1.4e-13`, `9.81` or `12`; `None` if the text is none.
    pub fn from_decimal(text: &str) -> Option<Self> {
        let (mantissa, exponent) = match text.find(['e', 'E']) {
            Some(at) => (&text[..at], text[at + 1..].parse::<i32>().ok()?),
            None => (text, 0),
        };
        let (sign, mantissa) = match mantissa.strip_prefix('-') {
            Some(rest) => (-1, rest),
            None => (1, mantissa.strip_prefix('+').unwrap_or(mantissa)),
        };
        let (whole, part) = mantissa.split_once('.').unwrap_or((mantissa, ""));
        let digits = format!("{whole}{part}");
        if digits.is_empty() || !digits.bytes().all(|b| b.is_ascii_digit()) || exponent.abs() > 5000 {
            return None;
        }
        let value = IBig::from_str_radix(&digits, 10).ok()? * IBig::from(sign);
        let shift = exponent - i32::try_from(part.len()).ok()?;
        let power = UBig::from(10u8).pow(shift.unsigned_abs() as usize);
        let exact = if shift < 0 { RBig::from_parts(value, power) } else { RBig::from(value * power) };
        Some(Self::from_big(exact))
    }

    /// The exact value of a float; `None` if it is not finite.
    pub fn from_f64(value: f64) -> Option<Self> {
        RBig::try_from(value).ok().map(Self::from_big)
    }

    /// The nearest float (infinite beyond their range).
    pub fn to_f64(&self) -> f64 {
        const EXACT: u64 = 1 << 53;
        match &self.0 {
            Repr::Small(n, d) if n.unsigned_abs() <= EXACT && d.unsigned_abs() <= EXACT => *n as f64 / *d as f64,
            _ => self.to_big().to_f64().value(),
        }
    }

    /// Numerator and denominator, if both fit `i64`.
    pub fn small(&self) -> Option<(i64, i64)> {
        match &self.0 {
            Repr::Small(n, d) => Some((*n, *d)),
            Repr::Big(_) => None,
        }
    }

    /// The number as a machine integer, if it is one.
    pub fn as_integer(&self) -> Option<i64> {
        match &self.0 {
            Repr::Small(n, 1) => Some(*n),
            _ => None,
        }
    }

    /// The bits of numerator and denominator together.
    pub fn bits(&self) -> u64 {
        match &self.0 {
            Repr::Small(n, d) => {
                u64::from(u64::BITS * 2 - n.unsigned_abs().leading_zeros() - d.unsigned_abs().leading_zeros())
            }
            Repr::Big(big) => (big.numerator().bit_len() + big.denominator().bit_len()) as u64,
        }
    }

    /// The numerator.
    pub fn numerator(&self) -> IBig {
        match &self.0 {
            Repr::Small(n, _) => IBig::from(*n),
            Repr::Big(big) => big.numerator().clone(),
        }
    }

    /// The denominator, positive.
    pub fn denominator(&self) -> IBig {
        match &self.0 {
            Repr::Small(_, d) => IBig::from(*d),
            Repr::Big(big) => IBig::from(big.denominator().clone()),
        }
    }

    /// Whether it is an integer, of whatever size.
    pub fn is_integer(&self) -> bool {
        match &self.0 {
            Repr::Small(_, d) => *d == 1,
            Repr::Big(big) => big.is_int(),
        }
    }

    /// Whether its numerator is even.
    pub fn is_even(&self) -> bool {
        match &self.0 {
            Repr::Small(n, _) => n % 2 == 0,
            Repr::Big(big) => !big.numerator().bit(0),
        }
    }

    /// Whether it is 0.
    pub fn is_zero(&self) -> bool {
        matches!(self.0, Repr::Small(0, _))
    }

    /// Whether it is 1.
    pub fn is_one(&self) -> bool {
        matches!(self.0, Repr::Small(1, 1))
    }

    /// -1, 0 or 1.
    pub fn signum(&self) -> i32 {
        match &self.0 {
            Repr::Small(n, _) => n.signum() as i32,
            Repr::Big(big) => {
                if big.is_negative() {
                    -1
                } else {
                    1
                }
            }
        }
    }

    /// The distance from zero.
    pub fn abs(&self) -> Self {
        if self.signum() < 0 { -self } else { self.clone() }
    }

    /// `1/self`; `None` for 0.
    pub fn recip(&self) -> Option<Self> {
        match &self.0 {
            Repr::Small(0, _) => None,
            Repr::Small(n, d) => Some(Rational(Repr::Small(d * n.signum(), n.abs()))),
            Repr::Big(big) => {
                let (n, d) = (**big).clone().into_parts();
                Some(Self::from_big(RBig::from_parts(IBig::from_parts(n.sign(), d), n.unsigned_abs())))
            }
        }
    }

    /// `self/other`; `None` if that is 0. There is no operator for it: who divides says what becomes of a divisor of 0.
    pub fn over(&self, other: &Self) -> Option<Self> {
        other.recip().map(|inverse| self * &inverse)
    }

    /// `self^exponent`; `None` for a negative power of 0, or if the result has more than about 4,000 digits.
    pub fn powi(&self, exponent: i64) -> Option<Self> {
        if self.is_one() || exponent == 0 {
            return Some(Self::from(1));
        }
        if exponent < 0 {
            return self.recip()?.powi(exponent.checked_neg()?);
        }
        let bits = self.numerator().bit_len().max(self.denominator().bit_len());
        if (bits as u64).checked_mul(exponent as u64)? > 13_000 {
            return None;
        }
        Some(Self::from_big(self.to_big().pow(exponent as usize)))
    }

    /// The exact root of this order, 2 or more, if it is rational. Of a negative number there is none.
    pub fn root(&self, order: u32) -> Option<Self> {
        if self.signum() < 0 {
            return None;
        }
        let order = order as usize;
        let exact = |n: UBig| Some(n.nth_root(order)).filter(|r| r.pow(order) == n);
        let (n, d) = (exact(self.numerator().unsigned_abs())?, exact(self.denominator().unsigned_abs())?);
        Some(Self::from_big(RBig::from_parts(n.into(), d)))
    }

    /// The greatest integer not above it.
    pub fn floor(&self) -> Self {
        match &self.0 {
            Repr::Small(n, d) => Self::from(n.div_floor(d)),
            Repr::Big(big) => Self::from_big(big.floor().into()),
        }
    }

    #[inline]
    fn reduced(n: i128, d: i128) -> Self {
        let g = if d == 1 { 1 } else { gcd(n.unsigned_abs(), d.unsigned_abs()) as i128 } * d.signum();
        let (n, d) = if g == 1 { (n, d) } else { (n / g, d / g) };
        match (i64::try_from(n), i64::try_from(d)) {
            (Ok(n), Ok(d)) if n != i64::MIN => Rational(Repr::Small(n, d)),
            _ => Rational(Repr::Big(Box::new(RBig::from_parts(IBig::from(n), UBig::from(d.unsigned_abs()))))),
        }
    }
}

fn gcd(a: u128, b: u128) -> u128 {
    match (u64::try_from(a), u64::try_from(b)) {
        (Ok(a), Ok(b)) => u128::from(a.gcd(&b)),
        _ => a.gcd(&b),
    }
}

impl From<i64> for Rational {
    fn from(n: i64) -> Self {
        match n {
            i64::MIN => Self::reduced(i128::from(n), 1),
            _ => Rational(Repr::Small(n, 1)),
        }
    }
}

macro_rules! operator {
    ($trait:ident, $method:ident, |$a:ident, $b:ident, $c:ident, $d:ident| $small:expr) => {
        impl $trait<&Rational> for &Rational {
            type Output = Rational;
            fn $method(self, other: &Rational) -> Rational {
                match (&self.0, &other.0) {
                    (Repr::Small($a, $b), Repr::Small($c, $d)) => {
                        let ($a, $b, $c, $d) = (i128::from(*$a), i128::from(*$b), i128::from(*$c), i128::from(*$d));
                        $small
                    }
                    _ => Rational::from_big($trait::$method(self.to_big(), other.to_big())),
                }
            }
        }
    };
}

// The products stay below 2^127: each factor is at most 2^63 - 1 in size.
operator!(Add, add, |a, b, c, d| if b == 1 && d == 1 {
    Rational::reduced(a + c, 1)
} else {
    Rational::reduced(a * d + c * b, b * d)
});
operator!(Sub, sub, |a, b, c, d| if b == 1 && d == 1 {
    Rational::reduced(a - c, 1)
} else {
    Rational::reduced(a * d - c * b, b * d)
});
operator!(Mul, mul, |a, b, c, d| if b == 1 && d == 1 {
    Rational::reduced(a * c, 1)
} else {
    Rational::reduced(a * c, b * d)
});

impl Neg for &Rational {
    type Output = Rational;
    fn neg(self) -> Rational {
        match &self.0 {
            Repr::Small(n, d) => Rational(Repr::Small(-n, *d)),
            Repr::Big(big) => Rational::from_big(-(**big).clone()),
        }
    }
}

impl Ord for Rational {
    fn cmp(&self, other: &Self) -> Ordering {
        match (&self.0, &other.0) {
            (Repr::Small(a, b), Repr::Small(c, d)) => {
                (i128::from(*a) * i128::from(*d)).cmp(&(i128::from(*c) * i128::from(*b)))
            }
            _ => self.to_big().cmp(&other.to_big()),
        }
    }
}

impl PartialOrd for Rational {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl fmt::Display for Rational {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.to_big().fmt(f)
    }
}

impl fmt::Debug for Rational {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl Add for Rational {
    type Output = Rational;
    fn add(self, other: Rational) -> Rational {
        &self + &other
    }
}

impl Mul for Rational {
    type Output = Rational;
    fn mul(self, other: Rational) -> Rational {
        &self * &other
    }
}
