//! Vectors of length 1 whose numbers are exact.

use super::rational::Rational;

/// Directions nearer to each other than one in this are the same to floats.
const NEAR: i64 = 1 << 55;

/// A complex number with rational parts.
#[derive(Debug, Clone)]
struct Complex(Rational, Rational);

impl Complex {
    fn whole(n: i64) -> Complex {
        Complex(Rational::from(n), Rational::from(0))
    }
    fn plus(&self, other: &Complex) -> Complex {
        Complex(&self.0 + &other.0, &self.1 + &other.1)
    }
    fn minus(&self, other: &Complex) -> Complex {
        Complex(&self.0 - &other.0, &self.1 - &other.1)
    }
    fn times(&self, other: &Complex) -> Complex {
        Complex(&(&self.0 * &other.0) - &(&self.1 * &other.1), &(&self.0 * &other.1) + &(&self.1 * &other.0))
    }
    /// The square of its magnitude.
    fn square(&self) -> Rational {
        &(&self.0 * &self.0) + &(&self.1 * &self.1)
    }
    fn conjugate(&self) -> Complex {
        Complex(self.0.clone(), -&self.1)
    }
    fn recip(&self) -> Option<Complex> {
        let inverse = self.square().recip()?;
        let Complex(re, im) = self.conjugate();
        Some(Complex(&re * &inverse, &im * &inverse))
    }
    /// The nearest one with whole parts.
    fn rounded(&self) -> Complex {
        let half = Rational::new(1, 2);
        Complex((&self.0 + &half).floor(), (&self.1 + &half).floor())
    }
}

/// The direction of a vector of up to three entries as numbers whose squares add up to 1 exactly, within rounding of floats.
/// `None` if it has no direction that floats tell.
///
/// Numbers with finitely many digits are seldom the entries of a vector of length 1, so that what is turned about them would
/// be stretched by its last digit. Seen from one of its points, a sphere is the plane of complex numbers, and its points with
/// rational entries are the quotients `p/q` of whole complex numbers. Continued fractions give those near a number whose
/// `|p|^2 + |q|^2` is least: it is what the entries are divided by, and has no more digits than floats have.
///
/// ```
/// use halfarrow_compiler::algebra::{Rational, unit_vector};
/// let of = |text: &[&str]| {
///     let numbers: Vec<Rational> = text.iter().map(|t| Rational::from_decimal(t).unwrap()).collect();
///     unit_vector(&numbers)
/// };
/// assert_eq!(of(&["3", "-4"]), Some(vec![Rational::new(3, 5), Rational::new(-4, 5)]));
/// let axis = of(&["0.2672612419124244", "0.5345224838248488", "0.8017837257372732"]).unwrap();
/// assert_eq!(axis.iter().fold(Rational::from(0), |sum, v| &sum + &(v * v)), Rational::from(1));
/// assert!(axis.iter().all(|v| v.small().is_some()));
/// ```
pub fn unit_vector(a: &[Rational]) -> Option<Vec<Rational>> {
    let one = Rational::from(1);
    let square = a.iter().fold(Rational::from(0), |sum, v| &sum + &(v * v));
    if square == one {
        return Some(a.to_vec());
    }
    let rough = square.to_f64().sqrt();
    if !rough.is_normal() || a.len() > 3 {
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
    let others: Vec<usize> = (0..a.len()).filter(|&i| i != at).collect();
    let part = |i: usize| others.get(i).map_or(Some(Rational::from(0)), |&i| a[i].over(&from));
    let (p, q) = quotient(Complex(part(0)?, part(1)?))?;
    let divisor = (&p.square() + &q.square()).recip()?;
    let Complex(re, im) = p.times(&q.conjugate());
    let twice = &Rational::from(2) * &divisor;
    let rest = &(&q.square() - &p.square()) * &divisor;
    let mut found = a.to_vec();
    found[at] = if most.signum() < 0 { -&rest } else { rest };
    for (&i, part) in others.iter().zip([re, im]) {
        found[i] = &part * &twice;
    }
    Some(found)
}

/// Whole complex numbers whose quotient is near: the first convergent that is, of the continued fraction by nearest whole
/// numbers.
fn quotient(value: Complex) -> Option<(Complex, Complex)> {
    let near = Rational::new(1, NEAR);
    let near = &near * &near;
    let (mut before, mut now) = ((Complex::whole(0), Complex::whole(1)), (Complex::whole(1), Complex::whole(0)));
    let mut rest = value.clone();
    loop {
        let whole = rest.rounded();
        let next = (whole.times(&now.0).plus(&before.0), whole.times(&now.1).plus(&before.1));
        (before, now) = (now, next);
        let off = now.0.times(&now.1.recip()?).minus(&value);
        if off.square() < near {
            return Some(now);
        }
        rest = rest.minus(&whole).recip()?;
    }
}
