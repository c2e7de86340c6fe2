//! How long the forms of a polynomial are written at least, told without forming them: most of them are not shorter than what
//! there is.

use super::super::construct::content_size;
use super::super::exprs::Exprs;
use super::super::node::{Expr, Function, Node};
use super::super::polynomial::{Generators, Monomial, Polynomial};
use super::super::rational::Rational;

/// How long the powers of generators are written, where products of them are written as they stand.
pub(super) struct Lengths(Option<Vec<PowerLength>>);

/// Of `base^inner`: the length of the base, how many terms it has if it is a sum, and whether its inverse is a fraction within a fraction.
struct PowerLength {
    base: u64,
    inner: i64,
    sum: usize,
    holds_fraction: bool,
}

/// A term: its monomial without what is taken out, and its coefficient without the number that is.
pub(super) type Term<'a> = (&'a Monomial, &'a Rational);

impl Exprs {
    /// Of the generators of a polynomial. Nothing is known of roots, exponentials and magnitudes, whose products are merged, of
    /// powers of one base that are generators of their own, and of sums out of which a number is taken.
    pub(super) fn lengths(&mut self, generators: &Generators) -> Lengths {
        let mut bases: Vec<Expr> = Vec::new();
        let mut length = |&e: &Expr| {
            let (base, inner) = match *self.node(e) {
                Node::Pow(base, n) => {
                    let n = self.is_number(n)?.as_integer()?;
                    if bases.contains(&base) {
                        return None;
                    }
                    bases.push(base);
                    (base, n)
                }
                Node::Call(Function::Exp | Function::Abs, _) => return None,
                _ => (e, 1),
            };
            let sum = if let Node::Add(terms) = self.node(base) { terms.len() } else { 0 };
            if sum > 0 && !self.primitive(base).0.is_one() {
                return None;
            }
            let holds_fraction = self.holds_fraction(base);
            Some(PowerLength { base: self.written_length(base), inner, sum, holds_fraction })
        };
        Lengths(generators.list.iter().map(&mut length).collect())
    }
}

impl Lengths {
    /// Of all terms as they stand.
    pub fn of_sum(&self, polynomial: &Polynomial) -> u64 {
        self.least(polynomial, |powers, terms| Some(as_they_stand(powers, terms)?.in_a_sum()))
    }

    /// With the common factors of all terms in front.
    pub fn of_factored(&self, polynomial: &Polynomial) -> u64 {
        self.least(polynomial, |powers, terms| {
            let part = factored(powers, terms)?;
            Some(if part.terms > 1 { part.in_a_sum() } else { part.length })
        })
    }

    /// With the common factors of two parts in front of each.
    pub fn of_halves(&self, halves: [&[Term]; 2]) -> u64 {
        let length = |powers: &[PowerLength]| {
            let [a, b] = halves.map(|half| factored(powers, half));
            Some(a?.in_a_sum() + b?.in_a_sum())
        };
        self.0.as_deref().and_then(length).unwrap_or(0)
    }

    fn least(&self, polynomial: &Polynomial, length: impl Fn(&[PowerLength], &[Term]) -> Option<u64>) -> u64 {
        let terms: Vec<Term> = polynomial.0.iter().collect();
        let several = if terms.len() > 1 { self.0.as_deref() } else { None };
        several.and_then(|powers| length(powers, &terms)).unwrap_or(0)
    }
}

/// What stands in a sum: so many terms, whose lengths add up to this.
struct Part {
    terms: u64,
    length: u64,
}

impl Part {
    /// What it adds to the length of a sum.
    fn in_a_sum(&self) -> u64 {
        self.length + self.terms
    }
}

fn as_they_stand(powers: &[PowerLength], terms: &[Term]) -> Option<Part> {
    let lengths = terms.iter().map(|t| term(powers, t.0, &[], t.1));
    Some(Part { terms: terms.len() as u64, length: lengths.sum::<Option<u64>>()? })
}

/// A sum with its common factors in front; its own terms where there are none.
fn factored(powers: &[PowerLength], terms: &[Term]) -> Option<Part> {
    let common = Polynomial::content_of(terms.iter().map(|t| t.0));
    if terms.len() == 1 || common.is_empty() {
        return as_they_stand(powers, terms);
    }
    // What is divided by may be the sum itself.
    if common.iter().zip(powers).any(|(&n, of)| n != 0 && of.sum == terms.len()) {
        return None;
    }
    let number = content_size(terms.iter().map(|t| t.1));
    let inverse = number.recip()?;
    let scaled: Vec<Rational> = terms.iter().map(|t| t.1 * &inverse).collect();
    let inner = terms.iter().zip(&scaled).map(|(t, c)| term(powers, t.0, &common, c)).sum::<Option<u64>>()?;
    // The sign of the first term goes in front, whichever that is.
    let with_sign = |sign: i64| {
        let one = Rational::from(sign);
        2 * terms.iter().zip(&scaled).filter(|(t, c)| **c == one && *t.0 != common).count() as u64
    };
    let (as_it_is, turned) = (with_sign(-1), with_sign(1) + if number.is_one() { 2 } else { 0 });
    let inner = inner - as_it_is + as_it_is.min(turned) + terms.len() as u64;
    let factors = common.iter().filter(|&&n| n != 0).count() as u64;
    let outer = common.iter().zip(powers).map(|(&n, of)| power(of, n)).sum::<Option<u64>>()?;
    let number = if number.is_one() { 0 } else { 3 };
    Some(Part { terms: 1, length: inner + outer + factors + number })
}

/// A term without common factors. Terms that have cancelled are not known.
fn term(powers: &[PowerLength], monomial: &[i64], common: &[i64], coefficient: &Rational) -> Option<u64> {
    if coefficient.is_zero() {
        return None;
    }
    let at = |m: &[i64], i: usize| m.get(i).copied().unwrap_or(0);
    let (mut factors, mut length) = (0, 0);
    for (i, of) in powers.iter().enumerate().take(monomial.len().max(common.len())) {
        let n = at(monomial, i) - at(common, i);
        factors += u64::from(n != 0);
        length += power(of, n)?;
    }
    Some(match (factors, coefficient.abs().is_one()) {
        (0, true) => 1,
        (0, false) => 2,
        (_, true) if coefficient.signum() > 0 => length + factors - 1,
        (_, true) => length + factors + 1,
        (_, false) => length + factors + 2,
    })
}

/// A power of a generator, 0 for none. Sums are written into the sums around them.
fn power(of: &PowerLength, n: i64) -> Option<u64> {
    match n * of.inner {
        0 => Some(0),
        n if n > 0 && of.sum > 0 => None,
        1 => Some(of.base),
        -1 => Some(of.base + 3 + 4 * u64::from(of.holds_fraction)),
        _ => Some(of.base + 2),
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::Facts;
    use super::super::super::polynomial::expand;
    use super::*;

    /// Without quotients they are what the forms have, but for a sign that may go in front of a sum.
    #[test]
    fn of_polynomials_they_are_those_of_the_forms() {
        let mut x = Exprs::default();
        let [a, b, c, d] = ["a", "b", "c", "d"].map(|name| x.symbol(name, Facts::default())).map(|s| x.sym(s));
        let (ab, bc, bd) = (x.mul(&[a, b]), x.mul(&[b, c]), x.mul(&[b, d, d]));
        let [two, third, minus] = [(2, 1), (1, 3), (-1, 1)].map(|(p, q)| x.number(Rational::new(p, q)));
        let mut seen = 0;
        for numbers in [[two, two, two], [two, third, minus], [minus, minus, two], [two, minus, minus]] {
            for last in [bd, b, d] {
                let terms: Vec<Expr> = [ab, bc, last].into_iter().zip(numbers).map(|(t, n)| x.mul(&[t, n])).collect();
                let sum = x.add(&terms);
                let mut generators = Generators::default();
                let polynomial = expand(&x, sum, &mut generators).expect("few terms");
                let lengths = x.lengths(&generators);
                assert_eq!(lengths.of_sum(&polynomial), x.written_length(sum));
                let factored = x.factored(&polynomial, &generators);
                let over = x.written_length(factored) - lengths.of_factored(&polynomial);
                assert!(over == 0 || over == 2, "{over}");
                seen += u64::from(over == 0);
            }
        }
        assert!(seen >= 10, "{seen}");
    }

    /// A sum over itself is a number, which no length of its terms tells.
    #[test]
    fn what_may_cancel_has_no_length() {
        let mut x = Exprs::default();
        let positive = Facts { positive: true, ..Facts::default() };
        let [a, b] = ["a", "b"].map(|name| x.symbol(name, positive)).map(|s| x.sym(s));
        let sum = x.add(&[a, b]);
        let inverse = x.recip(sum);
        let (p, q) = (x.mul(&[a, inverse]), x.mul(&[b, inverse]));
        let one = x.add(&[p, q]);
        let mut generators = Generators::default();
        let polynomial = expand(&x, one, &mut generators).expect("two terms");
        assert_eq!(x.lengths(&generators).of_factored(&polynomial), 0);
        assert_eq!(x.factored(&polynomial, &generators), super::super::super::ONE);
    }
}
