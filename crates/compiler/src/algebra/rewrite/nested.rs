//! Fractions within fractions over one denominator, with common factors and squares of sums found in the numerators.

use super::super::exprs::{Exprs, ONE};
use super::super::node::{Expr, Node};
use super::super::polynomial::{Generators, Polynomial, monomial_expr};
use super::super::rational::Rational;
use super::factor;

const DEEPEST: u32 = 64;
const HIGHEST_POWER: i64 = 8;

/// A fraction: a polynomial over powers of what is no product.
#[derive(Clone)]
struct Ratio {
    above: Polynomial,
    below: Vec<(Expr, i64)>,
}

impl Exprs {
    /// What stands below the bar if all is brought over one denominator, as far as it is known to be nonzero.
    pub fn denominator(&mut self, e: Expr) -> Expr {
        let e = self.over_one_within_bound(e).unwrap_or(e);
        let factors = match self.node(e) {
            Node::Mul(factors) => factors.to_vec(),
            _ => vec![e],
        };
        let mut below = Vec::new();
        for factor in factors {
            if let Node::Pow(base, n) = *self.node(factor)
                && self.is_number(n).is_some_and(|n| n.is_integer() && n.signum() < 0)
                && self.nonzero(base)
            {
                below.push(self.recip(factor));
            }
        }
        self.mul(&below)
    }

    /// What all of them that are not 0 have as a factor and is known to be nonzero, numbers left out.
    pub fn common_factor(&mut self, of: &[Expr]) -> Expr {
        let of: Vec<Expr> = of.iter().copied().filter(|&e| e != super::super::ZERO).collect();
        let mut common: Option<Vec<(Expr, i64)>> = None;
        for e in of {
            let powers = self.nonzero_powers(e);
            common = Some(match common {
                None => powers,
                Some(known) => known
                    .into_iter()
                    .filter_map(|(base, n)| powers.iter().find(|p| p.0 == base).map(|p| (base, n.min(p.1))))
                    .collect(),
            });
        }
        let powers: Vec<Expr> = common.unwrap_or_default().into_iter().map(|(b, n)| self.powi(b, n)).collect();
        self.mul(&powers)
    }

    /// The factors of a product, or of all terms of a sum, that are known to be nonzero.
    fn nonzero_powers(&mut self, e: Expr) -> Vec<(Expr, i64)> {
        let factored = self.over_one_within_bound(e).unwrap_or(e);
        let factors = match self.node(factored) {
            Node::Mul(factors) => factors.to_vec(),
            _ => vec![factored],
        };
        let mut powers = Vec::new();
        for factor in factors {
            let (base, n) = match *self.node(factor) {
                Node::Pow(base, n) => (base, self.is_number(n).and_then(|n| n.as_integer()).unwrap_or(0)),
                Node::Number(_) => continue,
                _ => (factor, 1),
            };
            if n > 0 && self.nonzero(base) {
                powers.push((base, n));
            }
        }
        powers
    }

    /// The terms with equal denominators taken together.
    pub(super) fn by_denominators(&mut self, e: Expr, work: &mut u64) -> Expr {
        let Node::Add(terms) = self.node(e) else { return e };
        let mut groups: Vec<(Vec<Expr>, Vec<Expr>)> = Vec::new();
        for term in terms.clone() {
            let below = self.divisors_of_term(term);
            match groups.iter_mut().find(|g| g.0 == below) {
                Some(group) => group.1.push(term),
                None => groups.push((below, vec![term])),
            }
        }
        let mut parts = Vec::with_capacity(groups.len());
        for (_, terms) in groups {
            let sum = self.add(&terms);
            let mut best = (self.printed_length(sum), sum);
            for open in [true, false] {
                if let Some(form) = self.over_one(sum, open, work) {
                    let length = self.printed_length(form);
                    best = best.min((length, form));
                }
            }
            parts.push(best.1);
        }
        self.add(&parts)
    }

    fn divisors_of_term(&self, term: Expr) -> Vec<Expr> {
        let factors = match self.node(term) {
            Node::Mul(factors) => factors.as_slice(),
            _ => &[term],
        };
        factors.iter().copied().filter(|f| self.divides(*f)).collect()
    }

    /// Everything over one denominator, unless the search for short forms is over.
    fn over_one_within_bound(&mut self, e: Expr) -> Option<Expr> {
        if self.search_is_over() {
            return None;
        }
        let mut work = u64::from(self.entry(e).size);
        let form = self.over_one(e, false, &mut work);
        self.spend(work);
        form
    }

    /// Everything over one denominator. `open`: powers of sums are multiplied out.
    pub(super) fn over_one(&mut self, e: Expr, open: bool, work: &mut u64) -> Option<Expr> {
        let mut generators = Generators::within(self.search_left());
        let form = self.over_one_in(e, open, &mut generators);
        *work += generators.work;
        form
    }

    fn over_one_in(&mut self, e: Expr, open: bool, generators: &mut Generators) -> Option<Expr> {
        let ratio = self.quotient(e, open, generators)?;
        let above = self.numerator(&ratio.above, generators);
        let mut parts = vec![above];
        for (base, n) in ratio.below {
            let base = match self.quotient(base, open, generators) {
                Some(own) if own.below.is_empty() => self.factored_deep(&own.above, generators),
                _ => base,
            };
            parts.push(self.powi(base, -n));
        }
        Some(self.mul(&parts))
    }

    fn quotient(&mut self, e: Expr, open: bool, generators: &mut Generators) -> Option<Ratio> {
        if self.entry(e).depth > DEEPEST {
            return None;
        }
        match self.node(e).clone() {
            Node::Number(value) => Some(Ratio::whole(Polynomial::constant(value))),
            Node::Add(terms) => {
                let mut sum: Option<Ratio> = None;
                for term in terms {
                    let term = self.quotient(term, open, generators)?;
                    sum = Some(match sum {
                        Some(sum) => self.quotient_sum(sum, term, open, generators)?,
                        None => term,
                    });
                }
                Some(self.cancelled(sum?, open, generators))
            }
            Node::Mul(factors) => {
                let mut product = Ratio::whole(Polynomial::constant(Rational::from(1)));
                for factor in factors {
                    let factor = self.quotient(factor, open, generators)?;
                    product.above = generators.product(&product.above, &factor.above)?;
                    factor.below.into_iter().for_each(|(base, n)| product.divide(base, n));
                }
                Some(self.cancelled(product, open, generators))
            }
            Node::Pow(base, n) => match self.is_number(n).and_then(|n| n.as_integer()) {
                Some(n) if n < 0 => self.inverse(base, -n, open, generators),
                Some(n) if (1..=HIGHEST_POWER).contains(&n) && (open || !matches!(self.node(base), Node::Add(_))) => {
                    let base = self.quotient(base, open, generators)?;
                    let above =
                        (1..n).try_fold(base.above.clone(), |power, _| generators.product(&power, &base.above))?;
                    Some(Ratio { above, below: base.below.into_iter().map(|(b, m)| (b, m * n)).collect() })
                }
                _ => Some(Ratio::whole(Polynomial::generator(generators.index_of(e), 1))),
            },
            _ => Some(Ratio::whole(Polynomial::generator(generators.index_of(e), 1))),
        }
    }

    /// `1/base^n`.
    fn inverse(&mut self, base: Expr, n: i64, open: bool, generators: &mut Generators) -> Option<Ratio> {
        let one = Polynomial::constant(Rational::from(1));
        let opaque = Ratio { above: one.clone(), below: vec![(base, n)] };
        if !matches!(self.node(base), Node::Add(_)) {
            return Some(opaque);
        }
        let inner = self.quotient(base, open, generators)?;
        // 1/(a/b) is b/a only where b is not zero.
        if inner.below.is_empty() || !inner.below.iter().all(|b| self.nonzero(b.0)) {
            return Some(opaque);
        }
        let mut above = one;
        for &(b, m) in &inner.below {
            let power = self.polynomial_power(b, m * n, open, generators)?;
            above = generators.product(&above, &power)?;
        }
        let content = inner.above.content();
        let rest = inner.above.divided_by_monomial(&content).to_expr(self, generators);
        let (number, rest) = self.primitive(rest);
        let scale = number.powi(-n)?;
        let mut ratio = Ratio { above: above.times(&Polynomial::constant(scale))?, below: Vec::new() };
        for (i, &m) in content.iter().enumerate().filter(|c| *c.1 != 0) {
            ratio.divide(generators.list[i], m * n);
        }
        match self.is_number(rest) {
            Some(value) => {
                let scale = value.powi(-n)?;
                ratio.above = ratio.above.times(&Polynomial::constant(scale))?;
            }
            None => ratio.divide(rest, n),
        }
        Some(ratio)
    }

    fn polynomial_power(&mut self, base: Expr, n: i64, open: bool, generators: &mut Generators) -> Option<Polynomial> {
        let own = self.quotient(base, open, generators)?;
        if !own.below.is_empty() || n > HIGHEST_POWER {
            return None;
        }
        let one = Polynomial::constant(Rational::from(1));
        (0..n).try_fold(one, |power, _| generators.product(&power, &own.above))
    }

    fn quotient_sum(&mut self, a: Ratio, b: Ratio, open: bool, generators: &mut Generators) -> Option<Ratio> {
        let mut below = a.below.clone();
        for &(base, n) in &b.below {
            match below.iter_mut().find(|d| d.0 == base) {
                Some(known) => known.1 = known.1.max(n),
                None => below.push((base, n)),
            }
        }
        let mut above = Polynomial::default();
        for part in [a, b] {
            let mut product = part.above;
            for &(base, n) in &below {
                let has = part.below.iter().find(|d| d.0 == base).map_or(0, |d| d.1);
                if n > has {
                    let power = self.polynomial_power(base, n - has, open, generators)?;
                    product = generators.product(&product, &power)?;
                }
            }
            above = above.plus(product);
        }
        Some(Ratio { above: above.tidy(self, generators), below })
    }

    /// Without what stands above and below and is known to be nonzero.
    fn cancelled(&mut self, mut ratio: Ratio, open: bool, generators: &mut Generators) -> Ratio {
        for k in 0..ratio.below.len() {
            let base = ratio.below[k].0;
            if !self.nonzero(base) {
                continue;
            }
            let Some(divisor) = self.quotient(base, open, generators).filter(|r| r.below.is_empty()) else { continue };
            while ratio.below[k].1 > 0 {
                generators.work += (ratio.above.0.len() * divisor.above.0.len()) as u64;
                let Some(quotient) = ratio.above.divided_by(&divisor.above) else { break };
                ratio.above = quotient;
                ratio.below[k].1 -= 1;
            }
        }
        ratio.below.retain(|b| b.1 > 0);
        ratio
    }

    /// A polynomial with common factors taken out again and again, where that makes it shorter.
    fn factored_deep(&mut self, polynomial: &Polynomial, generators: &mut Generators) -> Expr {
        let content = polynomial.content();
        let inner = polynomial.divided_by_monomial(&content);
        let outer = monomial_expr(self, generators, &content, &Rational::from(1));
        let work = factor::work_of_split(&inner);
        let split = if generators.affords(work) { self.best_split(&inner, generators) } else { None };
        generators.work += work;
        let inner = match split {
            Some(split) => {
                let mut product = vec![self.factored_deep(&split.factors.0, generators)];
                product.push(self.factored_deep(&split.factors.1, generators));
                let product = self.mul(&product);
                let rest = self.factored_deep(&split.rest, generators);
                self.add(&[product, rest])
            }
            None => inner.to_expr(self, generators),
        };
        if outer == ONE { inner } else { self.mul(&[outer, inner]) }
    }

    /// The shorter of: factors taken out wherever that helps; one product for each variable, which people like better.
    fn numerator(&mut self, polynomial: &Polynomial, generators: &mut Generators) -> Expr {
        let deep = self.factored_deep(polynomial, generators);
        if polynomial.has_zeros() {
            return deep;
        }
        let content = polynomial.content();
        let inner = polynomial.divided_by_monomial(&content);
        let products = factor::collected(&inner, &self.varying(generators));
        let mut terms = Vec::with_capacity(products.len());
        for (factor, variables) in &products {
            let (a, b) = (self.factored_deep(factor, generators), self.factored_deep(variables, generators));
            terms.push(self.mul(&[a, b]));
        }
        let (sum, outer) = (self.add(&terms), monomial_expr(self, generators, &content, &Rational::from(1)));
        let by_variable = self.mul(&[outer, sum]);
        let better = self.printed_length(by_variable) <= self.printed_length(deep) + 2;
        if better { by_variable } else { deep }
    }

    fn varying(&self, generators: &Generators) -> Vec<bool> {
        let varies = |&e: &Expr| self.depends_on_any(e, &|s| self.facts(s).given.is_none());
        generators.list.iter().map(varies).collect()
    }

    fn best_split(&self, polynomial: &Polynomial, generators: &Generators) -> Option<factor::Split> {
        let length = |e: Expr| self.printed_length(e) + u64::from(matches!(self.node(e), Node::Add(_)));
        let base = |e: Expr| match *self.node(e) {
            Node::Pow(base, n) if self.is_number(n).is_some_and(|n| n.is_integer()) => length(base),
            _ => length(e),
        };
        let lengths: Vec<u64> = generators.list.iter().map(|&e| base(e)).collect();
        factor::best_split(polynomial, &lengths, &self.varying(generators))
    }
}

impl Ratio {
    fn whole(above: Polynomial) -> Self {
        Ratio { above, below: Vec::new() }
    }

    fn divide(&mut self, base: Expr, n: i64) {
        match self.below.iter_mut().find(|b| b.0 == base) {
            Some(known) => known.1 += n,
            None => self.below.push((base, n)),
        }
    }
}
