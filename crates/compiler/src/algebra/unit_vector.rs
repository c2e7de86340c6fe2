//! Vectors of length 1 whose numbers are exact.

use super::rational::Rational;

/// Digits beyond those of a float: what lies nearer to a number is taken for it.
const NEAR: i64 = 1 << 56;

/// The direction of a vector as numbers whose squares add up to 1 exactly, within rounding of floats. `None` if it has no
/// direction that floats tell.
///
/// Numbers with finitely many digits are seldom the entries of a vector of length 1, so that what is turned about them would
/// be stretched by its last digit. On a sphere, seen from one of its points, all that is rational is the image of what is
/// rational in a plane: there, of what is near enough, the fractions with the least divisors are taken.
///
/// ```
/// use halfarrow_compiler::algebra::{Rational, unit_vector};
/// let of = |text: [&str; 2]| unit_vector(&text.map(|t| Rational::from_decimal(t).unwrap()));
/// assert_eq!(of(["3", "-4"]), Some(vec![Rational::new(3, 5), Rational::new(-4, 5)]));
/// let [x, y] = &of(["0.7071067811865476", "0.7071067811865476"]).unwrap()[..] else { unreachable!() };
/// assert_eq!(&(x * x) + &(y * y), Rational::from(1));
/// ```
pub fn unit_vector(a: &[Rational]) -> Option<Vec<Rational>> {
    let one = Rational::from(1);
    let square = a.iter().fold(Rational::from(0), |sum, v| &sum + &(v * v));
    if square == one {
        return Some(a.to_vec());
    }
    let rough = square.to_f64().sqrt();
    if !rough.is_normal() {
        return None;
    }
    let rough = Rational::from_f64(rough)?;
    if &rough * &rough == square {
        return a.iter().map(|v| v.over(&rough)).collect();
    }
    // A step of Newton's doubles the digits.
    let length = &(&rough + &square.over(&rough)?) * &Rational::new(1, 2);
    let (at, most) = a.iter().enumerate().max_by_key(|(_, v)| v.abs())?;
    let from = &length + &most.abs();
    let mut image = a.iter().map(|v| Some(near(&v.over(&from)?))).collect::<Option<Vec<Rational>>>()?;
    image[at] = Rational::from(0);
    let square = image.iter().fold(Rational::from(0), |sum, v| &sum + &(v * v));
    let whole = &one + &square;
    let twice = Rational::from(2);
    let mut found = image.iter().map(|v| (v * &twice).over(&whole)).collect::<Option<Vec<Rational>>>()?;
    let rest = (&one - &square).over(&whole)?;
    found[at] = if most.signum() < 0 { -&rest } else { rest };
    Some(found)
}

/// The number with the least divisor within rounding.
fn near(value: &Rational) -> Rational {
    let (size, little) = (value.abs(), Rational::new(1, NEAR));
    let low = &size - &little;
    if low.signum() <= 0 {
        return Rational::from(0);
    }
    let found = simplest(&low, &(&size + &little));
    if value.signum() < 0 { -&found } else { found }
}

/// The number with the least divisor between two that are positive, the second greater, by continued fractions.
fn simplest(low: &Rational, high: &Rational) -> Rational {
    let whole = low.floor();
    if whole == *low {
        return whole;
    }
    let next = &whole + &Rational::from(1);
    if next <= *high {
        return next;
    }
    // Both lie between `whole` and `next`, and so does what lies between them.
    match [high, low].map(|v| (v - &whole).recip()) {
        [Some(low), Some(high)] => simplest(&low, &high).recip().map_or(next, |part| &whole + &part),
        _ => next,
    }
}
