//! Expressions multiplied out: polynomials in whatever is no sum, product or power.

use super::exprs::Exprs;
use super::node::{Expr, Node};
use super::rational::Rational;
use rustc_hash::FxHashMap;
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

/// What a polynomial is made of.
#[derive(Debug)]
pub(super) struct Generators {
    pub list: Vec<Expr>,
    index: FxHashMap<Expr, usize>,
    /// How many terms have been formed or looked at.
    pub work: u64,
    /// How many may be.
    limit: u64,
}

impl Default for Generators {
    fn default() -> Self {
        Generators::within(u64::MAX)
    }
}

impl Generators {
    /// None yet; so many terms may be formed.
    pub fn within(limit: u64) -> Self {
        Generators { list: Vec::new(), index: FxHashMap::default(), work: 0, limit }
    }

    /// Whether so many terms more may be formed.
    pub fn affords(&self, terms: u64) -> bool {
        self.work.saturating_add(terms) <= self.limit
    }

    pub fn index_of(&mut self, e: Expr) -> usize {
        *self.index.entry(e).or_insert_with(|| {
            self.list.push(e);
            self.list.len() - 1
        })
    }

    /// The product; see [`Polynomial::times`]. `None` too if that is beyond the limit.
    pub fn product(&mut self, a: &Polynomial, b: &Polynomial) -> Option<Polynomial> {
        self.work += (a.0.len() * b.0.len()) as u64;
        if self.affords(0) { a.times(b) } else { None }
    }
}

/// Exponents by generator, without zeros at the end. Negative ones only of generators that are nonzero.
pub(super) type Monomial = Vec<i64>;

/// A sum of monomials. A coefficient of zero is kept where dropping it would change where the sum is defined.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Polynomial(pub BTreeMap<Monomial, Rational>);

/// More terms than this are not multiplied out.
const MOST_TERMS: usize = 160;
const HIGHEST_POWER: i64 = 8;
const DEEPEST: u32 = 64;

impl Polynomial {
    pub fn constant(value: Rational) -> Self {
        Polynomial(BTreeMap::from([(Vec::new(), value)]))
    }

    pub fn generator(index: usize, exponent: i64) -> Self {
        let mut monomial = vec![0; index];
        monomial.push(exponent);
        Polynomial(BTreeMap::from([(monomial, Rational::from(1))]))
    }

    /// A single term.
    fn term(monomial: Monomial, coefficient: Rational) -> Self {
        Polynomial(BTreeMap::from([(trimmed(monomial), coefficient)]))
    }

    pub fn add_term(&mut self, monomial: Monomial, coefficient: Rational) {
        match self.0.entry(monomial) {
            Entry::Vacant(place) => {
                place.insert(coefficient);
            }
            Entry::Occupied(mut term) => *term.get_mut() = term.get() + &coefficient,
        }
    }

    pub fn plus(mut self, other: Polynomial) -> Self {
        for (monomial, coefficient) in other.0 {
            self.add_term(monomial, coefficient);
        }
        self
    }

    pub fn times(&self, other: &Polynomial) -> Option<Self> {
        if self.0.len() * other.0.len() > 4 * MOST_TERMS {
            return None;
        }
        let mut product = Polynomial::default();
        for (p, a) in &self.0 {
            for (q, b) in &other.0 {
                product.add_term(times(p, q), a * b);
            }
        }
        (product.0.len() <= MOST_TERMS).then_some(product)
    }

    /// Without the terms that cancelled and are defined everywhere.
    pub fn tidy(mut self, x: &Exprs, generators: &Generators) -> Self {
        self.0.retain(|monomial, coefficient| !coefficient.is_zero() || !is_total(x, generators, monomial));
        self
    }

    pub fn to_expr(&self, x: &mut Exprs, generators: &Generators) -> Expr {
        let terms: Vec<Expr> = self.0.iter().map(|(m, c)| monomial_expr(x, generators, m, c)).collect();
        x.add(&terms)
    }

    /// The greatest monomial that divides all terms.
    pub fn content(&self) -> Monomial {
        Polynomial::content_of(self.0.keys())
    }

    /// The greatest monomial that divides all these.
    pub fn content_of<'a>(mut monomials: impl Iterator<Item = &'a Monomial>) -> Monomial {
        let Some(first) = monomials.next() else { return Vec::new() };
        let mut common = first.clone();
        for monomial in monomials {
            let len = common.len().max(monomial.len());
            common.resize(len, 0);
            for (i, n) in common.iter_mut().enumerate() {
                *n = (*n).min(monomial.get(i).copied().unwrap_or(0));
            }
        }
        trimmed(common)
    }

    pub fn divided_by_monomial(&self, monomial: &[i64]) -> Self {
        let inverse: Monomial = monomial.iter().map(|n| -n).collect();
        Polynomial(self.0.iter().map(|(m, c)| (times(m, &inverse), c.clone())).collect())
    }

    /// Whether a term is kept only for the sake of where it is defined.
    pub fn has_zeros(&self) -> bool {
        self.0.values().any(Rational::is_zero)
    }

    /// The quotient, if there is no remainder. Exponents are not negative. `None` also where terms of the divisor have
    /// cancelled: the quotient would be defined where the divisor is not.
    pub fn divided_by(&self, divisor: &Polynomial) -> Option<Self> {
        if divisor.has_zeros() {
            return None;
        }
        let (lead, scale) = divisor.0.last_key_value()?;
        let inverse = scale.recip()?;
        let (mut rest, mut quotient) = (self.clone(), Polynomial::default());
        rest.0.retain(|_, c| !c.is_zero());
        while let Some((monomial, coefficient)) = rest.0.last_key_value() {
            let factor = quotient_of(monomial, lead)?;
            let coefficient = coefficient * &inverse;
            for (m, c) in &divisor.0 {
                let product = &coefficient * c;
                rest.add_term(times(m, &factor), -&product);
            }
            rest.0.retain(|_, c| !c.is_zero());
            quotient.add_term(factor, coefficient);
            if quotient.0.len() > MOST_TERMS {
                return None;
            }
        }
        Some(quotient)
    }
}

fn trimmed(mut monomial: Monomial) -> Monomial {
    while monomial.last() == Some(&0) {
        monomial.pop();
    }
    monomial
}

pub(super) fn times(a: &[i64], b: &[i64]) -> Monomial {
    let at = |m: &[i64], i: usize| m.get(i).copied().unwrap_or(0);
    trimmed((0..a.len().max(b.len())).map(|i| at(a, i) + at(b, i)).collect())
}

pub(super) fn quotient_of(a: &[i64], b: &[i64]) -> Option<Monomial> {
    let inverse: Monomial = b.iter().map(|n| -n).collect();
    Some(times(a, &inverse)).filter(|q| q.iter().all(|&n| n >= 0))
}

fn is_total(x: &Exprs, generators: &Generators, monomial: &[i64]) -> bool {
    monomial.iter().enumerate().all(|(i, &n)| n == 0 || x.total(generators.list[i]))
}

pub(super) fn monomial_expr(x: &mut Exprs, generators: &Generators, monomial: &[i64], coefficient: &Rational) -> Expr {
    let mut factors = vec![x.number(coefficient.clone())];
    for (i, &n) in monomial.iter().enumerate().filter(|p| *p.1 != 0) {
        factors.push(x.powi(generators.list[i], n));
    }
    x.mul(&factors)
}

/// The expression multiplied out; `None` if that takes too many terms.
pub(super) fn expand(x: &Exprs, e: Expr, generators: &mut Generators) -> Option<Polynomial> {
    if x.entry(e).depth > DEEPEST {
        return None;
    }
    let factors = match x.node(e) {
        Node::Add(terms) => return expand_sum(x, terms, generators),
        Node::Mul(factors) => &factors[..],
        _ => &[e],
    };
    // Up to the first sum, if there is one, the product is a single term.
    let (mut coefficient, mut monomial) = (Rational::from(1), Monomial::new());
    for (at, &factor) in factors.iter().enumerate() {
        match expand_factor(x, factor, generators) {
            Factor::Number(value) => coefficient = if at == 0 { value.clone() } else { &coefficient * value },
            Factor::Power(generator, n) => {
                monomial.resize(monomial.len().max(generator + 1), 0);
                monomial[generator] += n;
            }
            Factor::Sum(base, n) => {
                let power = expand_power(x, base, n, generators)?;
                let product = match at {
                    0 => power,
                    _ => generators.product(&Polynomial::term(monomial, coefficient), &power)?,
                };
                return expand_rest(x, product, &factors[at + 1..], generators);
            }
        }
        generators.work += 1;
    }
    generators.affords(0).then(|| Polynomial::term(monomial, coefficient))
}

fn expand_sum(x: &Exprs, terms: &[Expr], generators: &mut Generators) -> Option<Polynomial> {
    let mut sum = Polynomial::default();
    for &term in terms {
        let term = expand(x, term, generators)?;
        generators.work += term.0.len() as u64;
        sum = sum.plus(term);
        if sum.0.len() > MOST_TERMS {
            return None;
        }
    }
    Some(sum)
}

/// A product with the factors that follow.
fn expand_rest(
    x: &Exprs,
    mut product: Polynomial,
    factors: &[Expr],
    generators: &mut Generators,
) -> Option<Polynomial> {
    for &factor in factors {
        let factor = match expand_factor(x, factor, generators) {
            Factor::Number(value) => Polynomial::constant(value.clone()),
            Factor::Power(generator, n) => Polynomial::generator(generator, n),
            Factor::Sum(base, n) => expand_power(x, base, n, generators)?,
        };
        product = generators.product(&product, &factor)?;
    }
    Some(product)
}

/// What a factor of a product is.
enum Factor<'a> {
    Number(&'a Rational),
    /// A power of a generator.
    Power(usize, i64),
    /// A positive power of a sum.
    Sum(Expr, i64),
}

fn expand_factor<'a>(x: &'a Exprs, e: Expr, generators: &mut Generators) -> Factor<'a> {
    match *x.node(e) {
        Node::Number(ref value) => Factor::Number(value),
        Node::Add(_) => Factor::Sum(e, 1),
        Node::Pow(base, n) => match x.is_number(n).and_then(|n| n.as_integer()) {
            // The inverse of what may be zero never cancels.
            Some(n) if n < 0 && !x.nonzero(base) => Factor::Power(generators.index_of(e), 1),
            Some(n) if n > 0 && matches!(x.node(base), Node::Add(_)) => Factor::Sum(base, n),
            Some(n) => Factor::Power(generators.index_of(base), n),
            None => Factor::Power(generators.index_of(e), 1),
        },
        _ => Factor::Power(generators.index_of(e), 1),
    }
}

fn expand_power(x: &Exprs, base: Expr, n: i64, generators: &mut Generators) -> Option<Polynomial> {
    if n > HIGHEST_POWER {
        return None;
    }
    let base = expand(x, base, generators)?;
    match n {
        1 => Some(base),
        _ => (1..n).try_fold(base.clone(), |power, _| generators.product(&power, &base)),
    }
}
