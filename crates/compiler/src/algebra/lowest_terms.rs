//! Fractions in lowest terms. Sines and cosines are written in powers of `exp(i angle)`: there every identity of
//! angles is arithmetic, and common factors show by division.

use super::exprs::Exprs;
use super::node::{Expr, Function, Node};
use super::rational::Rational;
use rustc_hash::FxHashMap;
use std::collections::BTreeMap;

/// More terms than this are not worked with.
const MOST_TERMS: usize = 400;
const HIGHEST_POWER: i64 = 8;
const DEEPEST: u32 = 48;

/// A fraction without common factors.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LowestTerms {
    /// The numerator.
    pub above: Expr,
    /// The factors of the denominator with their powers; numbers and symbols stand in the numerator.
    pub below: Vec<(Expr, u32)>,
}

impl Exprs {
    /// The expression as one fraction from which common factors of numerator and denominator are gone, also where they
    /// may be zero: the caller knows that the value is continuous there. `None` if that takes too many terms, or if
    /// the expression is not built from sums, products, powers, sines and cosines.
    ///
    /// ```
    /// use halfarrow_compiler::algebra::{Exprs, Function};
    /// let mut x = Exprs::default();
    /// let a = x.symbol("a", Default::default());
    /// let a = x.sym(a);
    /// let double = x.add(&[a, a]);
    /// let (above, below) = (x.call(Function::Sin, &[double]), x.call(Function::Cos, &[a]));
    /// let fraction = x.div(above, below);
    /// let sine = x.call(Function::Sin, &[a]);
    /// let lowest = x.lowest_terms(fraction).unwrap();
    /// assert!(lowest.below.is_empty() && x.scale(&2.into(), sine) == lowest.above);
    /// ```
    pub fn lowest_terms(&mut self, e: Expr) -> Option<LowestTerms> {
        if self.entry(e).depth > DEEPEST {
            return None;
        }
        let mut ring = Ring::of(self, e)?;
        let mut fraction = ring.fraction(self, e)?;
        ring.cancel(&mut fraction);
        let above = ring.to_expr(self, &fraction.above)?;
        let above = self.simplify(above);
        let mut below = Vec::new();
        for (factor, power) in fraction.below {
            below.push((ring.to_expr(self, &ring.factors[factor].clone())?, power));
        }
        Some(LowestTerms { above, below })
    }
}

/// A complex number with rational parts.
#[derive(Debug, Clone, PartialEq)]
struct Gaussian(Rational, Rational);

impl Gaussian {
    fn real(value: Rational) -> Gaussian {
        Gaussian(value, Rational::from(0))
    }
    fn is_zero(&self) -> bool {
        self.0.is_zero() && self.1.is_zero()
    }
    fn plus(&self, other: &Gaussian) -> Gaussian {
        Gaussian(&self.0 + &other.0, &self.1 + &other.1)
    }
    fn times(&self, other: &Gaussian) -> Gaussian {
        let (a, b) = (&(&self.0 * &other.0), &(&self.1 * &other.1));
        let (c, d) = (&(&self.0 * &other.1), &(&self.1 * &other.0));
        Gaussian(a - b, c + d)
    }
    fn recip(&self) -> Option<Gaussian> {
        let size = &(&self.0 * &self.0) + &(&self.1 * &self.1);
        let inverse = size.recip()?;
        Some(Gaussian(&self.0 * &inverse, &-&self.1 * &inverse))
    }
}

/// Exponents by generator, of any sign, without zeros at the end.
type Exponents = Vec<i64>;

fn product(a: &[i64], b: &[i64], sign: i64) -> Exponents {
    let at = |m: &[i64], i: usize| m.get(i).copied().unwrap_or(0);
    let mut sum: Exponents = (0..a.len().max(b.len())).map(|i| at(a, i) + sign * at(b, i)).collect();
    while sum.last() == Some(&0) {
        sum.pop();
    }
    sum
}

/// A sum of products of powers of the generators.
#[derive(Debug, Clone, Default, PartialEq)]
struct Laurent(BTreeMap<Exponents, Gaussian>);

impl Laurent {
    fn term(exponents: Exponents, coefficient: Gaussian) -> Laurent {
        let mut sum = Laurent::default();
        sum.add(exponents, &coefficient);
        sum
    }
    fn one() -> Laurent {
        Laurent::term(Vec::new(), Gaussian::real(Rational::from(1)))
    }
    fn add(&mut self, exponents: Exponents, coefficient: &Gaussian) {
        let entry = self.0.entry(exponents).or_insert_with(|| Gaussian::real(Rational::from(0)));
        *entry = entry.plus(coefficient);
    }
    fn tidy(mut self) -> Option<Laurent> {
        self.0.retain(|_, c| !c.is_zero());
        (self.0.len() <= MOST_TERMS).then_some(self)
    }
    fn plus(mut self, other: &Laurent) -> Option<Laurent> {
        other.0.iter().for_each(|(m, c)| self.add(m.clone(), c));
        self.tidy()
    }
    fn times(&self, other: &Laurent) -> Option<Laurent> {
        if self.0.len() * other.0.len() > 16 * MOST_TERMS {
            return None;
        }
        let mut result = Laurent::default();
        for (m, a) in &self.0 {
            for (n, b) in &other.0 {
                result.add(product(m, n, 1), &a.times(b));
            }
        }
        result.tidy()
    }
    fn power(&self, n: u32) -> Option<Laurent> {
        (0..n).try_fold(Laurent::one(), |power, _| power.times(self))
    }
    /// The inverse of a single term.
    fn inverse(&self) -> Option<Laurent> {
        let (exponents, coefficient) = self.0.first_key_value().filter(|_| self.0.len() == 1)?;
        Some(Laurent::term(product(&[], exponents, -1), coefficient.recip()?))
    }
    /// The least exponent of each generator.
    fn lowest(&self) -> Exponents {
        let width = self.0.keys().map(Vec::len).max().unwrap_or(0);
        let least = |i: usize| self.0.keys().map(|m| m.get(i).copied().unwrap_or(0)).min().unwrap_or(0);
        product(&(0..width).map(least).collect::<Vec<_>>(), &[], 1)
    }
    fn shifted(&self, by: &[i64]) -> Laurent {
        Laurent(self.0.iter().map(|(m, c)| (product(m, by, -1), c.clone())).collect())
    }
    /// The quotient, if there is no remainder.
    fn divided_by(&self, divisor: &Laurent) -> Option<Laurent> {
        let shifts = (self.lowest(), divisor.lowest());
        let (mut rest, divisor) = (self.shifted(&shifts.0), divisor.shifted(&shifts.1));
        let (lead, scale) = divisor.0.last_key_value()?;
        let scale = scale.recip()?;
        let mut quotient = Laurent::default();
        while let Some((exponents, coefficient)) = rest.0.pop_last() {
            let factor = product(&exponents, lead, -1);
            if factor.iter().any(|&n| n < 0) || quotient.0.len() > MOST_TERMS {
                return None;
            }
            let coefficient = coefficient.times(&scale);
            let minus = coefficient.times(&Gaussian::real(Rational::from(-1)));
            for (m, c) in divisor.0.iter().filter(|t| t.0 != lead) {
                rest.add(product(m, &factor, 1), &c.times(&minus));
            }
            rest = rest.tidy()?;
            quotient.add(factor, &coefficient);
        }
        Some(quotient.shifted(&product(&shifts.1, &shifts.0, -1)))
    }
}

/// A polynomial over powers of factors.
#[derive(Debug, Clone)]
struct Fraction {
    above: Laurent,
    below: BTreeMap<usize, u32>,
}

/// What an expression is built from.
#[derive(Debug, Default)]
struct Ring {
    /// A symbol or the like as itself, an angle as the angle of which the generator is `exp(i angle)`.
    generators: Vec<(Expr, bool)>,
    index: FxHashMap<(Expr, bool), usize>,
    /// By what a part of an angle is divided so that all its multiples are whole.
    shares: FxHashMap<Expr, i64>,
    factors: Vec<Laurent>,
}

impl Ring {
    /// The ring for an expression; `None` if its angles have absurd parts.
    fn of(x: &Exprs, e: Expr) -> Option<Ring> {
        let mut ring = Ring::default();
        for part in x.below(&[e], &|_| true) {
            let Node::Call(Function::Sin | Function::Cos, angle) = x.node(part) else { continue };
            for (multiple, part) in parts_of_angle(x, angle[0]) {
                let (_, denominator) = multiple.small().filter(|m| m.0.abs() <= 64 && m.1 <= 64)?;
                let share = ring.shares.entry(part).or_insert(1);
                *share = num_integer::lcm(*share, denominator);
                if *share > 64 {
                    return None;
                }
            }
        }
        Some(ring)
    }

    fn generator(&mut self, e: Expr, angle: bool) -> usize {
        *self.index.entry((e, angle)).or_insert_with(|| {
            self.generators.push((e, angle));
            self.generators.len() - 1
        })
    }

    fn single(&mut self, e: Expr) -> Laurent {
        let index = self.generator(e, false);
        let mut exponents = vec![0; index];
        exponents.push(1);
        Laurent::term(exponents, Gaussian::real(Rational::from(1)))
    }

    fn fraction(&mut self, x: &Exprs, e: Expr) -> Option<Fraction> {
        let whole = |above: Laurent| Some(Fraction { above, below: BTreeMap::new() });
        match x.node(e) {
            Node::Number(value) => whole(Laurent::term(Vec::new(), Gaussian::real(value.clone())).tidy()?),
            Node::Add(terms) => {
                let terms: Option<Vec<Fraction>> = terms.iter().map(|&t| self.fraction(x, t)).collect();
                self.sum(terms?)
            }
            Node::Mul(factors) => {
                let mut result = Fraction { above: Laurent::one(), below: BTreeMap::new() };
                for &factor in factors {
                    let factor = self.fraction(x, factor)?;
                    result.above = result.above.times(&factor.above)?;
                    factor.below.into_iter().for_each(|(f, n)| *result.below.entry(f).or_insert(0) += n);
                }
                Some(result)
            }
            Node::Pow(base, n) => match x.is_number(*n).and_then(Rational::as_integer) {
                Some(n) if n.abs() <= HIGHEST_POWER => {
                    let base = self.fraction(x, *base)?;
                    self.power(base, n)
                }
                _ => whole(self.single(e)),
            },
            Node::Call(f @ (Function::Sin | Function::Cos), angle) => {
                let above = self.sine_or_cosine(x, *f, angle[0])?;
                whole(above)
            }
            _ => whole(self.single(e)),
        }
    }

    /// `sin a = (z - 1/z)/2i`, `cos a = (z + 1/z)/2` with `z = exp(i a)`.
    fn sine_or_cosine(&mut self, x: &Exprs, f: Function, angle: Expr) -> Option<Laurent> {
        let mut exponents: Exponents = Vec::new();
        for (multiple, part) in parts_of_angle(x, angle) {
            let index = self.generator(part, true);
            let mut one = vec![0; index];
            one.push((&multiple * &Rational::from(self.shares[&part])).as_integer()?);
            exponents = product(&exponents, &one, 1);
        }
        let half = Rational::new(1, 2);
        let (plus, minus) = match f {
            Function::Cos => (Gaussian::real(half.clone()), Gaussian::real(half)),
            _ => (Gaussian(Rational::from(0), -&half), Gaussian(Rational::from(0), half)),
        };
        let mut sum = Laurent::term(product(&[], &exponents, -1), minus);
        sum.add(exponents, &plus);
        sum.tidy()
    }

    fn sum(&mut self, terms: Vec<Fraction>) -> Option<Fraction> {
        let mut below: BTreeMap<usize, u32> = BTreeMap::new();
        for (&factor, &power) in terms.iter().flat_map(|t| &t.below) {
            let most = below.entry(factor).or_insert(0);
            *most = power.max(*most);
        }
        let mut above = Laurent::default();
        for term in terms {
            let mut scaled = term.above;
            for (factor, power) in &below {
                let missing = power - term.below.get(factor).copied().unwrap_or(0);
                scaled = scaled.times(&self.factors[*factor].power(missing)?)?;
            }
            above = above.plus(&scaled)?;
        }
        Some(Fraction { above, below })
    }

    fn power(&mut self, base: Fraction, n: i64) -> Option<Fraction> {
        let size = u32::try_from(n.unsigned_abs()).ok()?;
        if n >= 0 {
            let below = base.below.into_iter().map(|(f, power)| (f, power * size)).filter(|p| p.1 > 0).collect();
            return Some(Fraction { above: base.above.power(size)?, below });
        }
        let mut above = Laurent::one();
        for (factor, power) in base.below {
            above = above.times(&self.factors[factor].power(power * size)?)?;
        }
        let mut below = BTreeMap::new();
        match base.above.inverse() {
            Some(inverse) => above = above.times(&inverse.power(size)?)?,
            None if base.above.0.is_empty() => return None,
            None => {
                let (factor, unit) = self.factor(base.above)?;
                above = above.times(&unit.power(size)?)?;
                below.insert(factor, size);
            }
        }
        Some(Fraction { above, below })
    }

    /// The factor of which this is a multiple by a single real term, and the inverse of that term.
    fn factor(&mut self, polynomial: Laurent) -> Option<(usize, Laurent)> {
        for (i, known) in self.factors.iter().enumerate() {
            let quotient = (known.0.len() == polynomial.0.len()).then(|| polynomial.divided_by(known)).flatten();
            if let Some(unit) = quotient.and_then(|q| q.inverse())
                && !self.turns(&unit)
            {
                return Some((i, unit));
            }
        }
        // The symbols that all terms have in common stand apart.
        let mut common = polynomial.lowest();
        common.iter_mut().enumerate().filter(|(i, _)| self.generators[*i].1).for_each(|(_, n)| *n = 0);
        let common = product(&common, &[], 1);
        self.factors.push(polynomial.shifted(&common));
        let unit = Laurent::term(product(&[], &common, -1), Gaussian::real(Rational::from(1)));
        Some((self.factors.len() - 1, unit))
    }

    /// Whether angles stand in a single term.
    fn turns(&self, term: &Laurent) -> bool {
        term.0.keys().any(|m| m.iter().enumerate().any(|(i, &n)| n != 0 && self.generators[i].1))
    }

    fn cancel(&self, fraction: &mut Fraction) {
        for (&factor, power) in &mut fraction.below {
            while *power > 0
                && let Some(quotient) = fraction.above.divided_by(&self.factors[factor])
            {
                fraction.above = quotient;
                *power -= 1;
            }
        }
        fraction.below.retain(|_, power| *power > 0);
    }

    /// The polynomial with sines and cosines; `None` if it is not real.
    fn to_expr(&self, x: &mut Exprs, polynomial: &Laurent) -> Option<Expr> {
        let mut terms = Vec::new();
        for (exponents, coefficient) in &polynomial.0 {
            let is_angle = |i: usize| self.generators[i].1;
            let turn: Exponents = exponents.iter().enumerate().map(|(i, &n)| if is_angle(i) { n } else { 0 }).collect();
            let turn = product(&turn, &[], 1);
            let conjugate = product(exponents, &turn.iter().map(|n| 2 * n).collect::<Vec<_>>(), -1);
            let mut factors: Vec<Expr> = Vec::new();
            for (i, &n) in exponents.iter().enumerate().filter(|(i, n)| **n != 0 && !is_angle(*i)) {
                factors.push(x.powi(self.generators[i].0, n));
            }
            let rest = x.mul(&factors);
            if turn.is_empty() {
                if !coefficient.1.is_zero() {
                    return None;
                }
                terms.push(x.scale(&coefficient.0, rest));
                continue;
            }
            let other = polynomial.0.get(&conjugate)?;
            if other.0 != coefficient.0 || other.1 != -&coefficient.1 {
                return None;
            }
            if turn.iter().find(|n| **n != 0).is_some_and(|&n| n < 0) {
                continue; // stands with its conjugate
            }
            let parts = turn.iter().enumerate().filter(|t| *t.1 != 0);
            let parts: Vec<Expr> = parts
                .map(|(i, &n)| {
                    let part = self.generators[i].0;
                    let share = Rational::from(n).over(&Rational::from(self.shares[&part]))?;
                    Some(x.scale(&share, part))
                })
                .collect::<Option<_>>()?;
            let angle = x.add(&parts);
            for (f, number) in [(Function::Cos, &coefficient.0), (Function::Sin, &-&coefficient.1)] {
                let value = x.call(f, &[angle]);
                let value = x.mul(&[rest, value]);
                terms.push(x.scale(&(&Rational::from(2) * number), value));
            }
        }
        Some(x.add(&terms))
    }
}

/// A sum of multiples of angles.
fn parts_of_angle(x: &Exprs, angle: Expr) -> Vec<(Rational, Expr)> {
    match x.node(angle) {
        Node::Add(terms) => terms.iter().map(|&t| x.coefficient(t)).collect(),
        _ => vec![x.coefficient(angle)],
    }
}
