//! Fractions of which the parts are short already: the terms of a sum over one denominator, `1/(a/b + c)` turned.

use super::super::exprs::Exprs;
use super::super::node::{Expr, Node};
use super::super::polynomial::{Generators, Polynomial, expand};
use smallvec::smallvec;

impl Exprs {
    /// All terms over one denominator, cancelled where the divisor is known to be nonzero.
    pub(super) fn over_one_denominator(&mut self, e: Expr, work: &mut u64) -> Option<Expr> {
        let (above, below) = self.fraction(e, work)?;
        let below: Vec<Expr> = below.into_iter().map(|(b, n)| self.powi(b, n)).collect();
        let below = self.mul(&below);
        Some(self.div(above, below))
    }

    /// `1/(a/b + c)` as `b/(a + b c)`, where `b` is nonzero.
    pub(super) fn turned_fraction(&mut self, e: Expr, work: &mut u64) -> Option<Expr> {
        let factors = match self.node(e) {
            Node::Mul(factors) => factors.clone(),
            _ => smallvec![e],
        };
        let mut changed = false;
        let mut parts = Vec::new();
        for factor in factors {
            let turned = match *self.node(factor) {
                Node::Pow(base, n) if matches!(self.node(base), Node::Add(_)) => self.turned_power(base, n, work),
                _ => None,
            };
            changed |= turned.is_some();
            parts.push(turned.unwrap_or(factor));
        }
        changed.then(|| {
            let product = self.mul(&parts);
            self.over_one_denominator(product, work).unwrap_or(product)
        })
    }

    fn turned_power(&mut self, base: Expr, n: Expr, work: &mut u64) -> Option<Expr> {
        let n = self.is_number(n)?.as_integer().filter(|&n| n < 0)?;
        let (above, below) = self.fraction(base, work)?;
        if !below.iter().all(|&(b, _)| self.nonzero(b)) {
            return None;
        }
        let below: Vec<Expr> = below.into_iter().map(|(b, power)| self.powi(b, power)).collect();
        let below = self.mul(&below);
        let (above, below) = (self.powi(above, n), self.powi(below, -n));
        Some(self.mul(&[above, below]))
    }

    /// A sum or product as a polynomial above and powers below.
    fn fraction(&mut self, e: Expr, work: &mut u64) -> Option<(Expr, Vec<(Expr, i64)>)> {
        let mut generators = Generators::within(self.search_left());
        let fraction = self.fraction_in(e, &mut generators);
        *work += generators.work;
        fraction
    }

    fn fraction_in(&mut self, e: Expr, generators: &mut Generators) -> Option<(Expr, Vec<(Expr, i64)>)> {
        let terms = match self.node(e) {
            Node::Add(terms) => terms.clone(),
            _ => smallvec![e],
        };
        if !terms.iter().any(|&term| self.is_fraction(term)) {
            return None;
        }
        let split: Vec<(Expr, Vec<(Expr, i64)>)> = terms.iter().map(|&t| self.split_fraction(t)).collect();
        let mut below: Vec<(Expr, i64)> = Vec::new();
        for &(base, n) in split.iter().flat_map(|s| &s.1) {
            match below.iter_mut().find(|b| b.0 == base) {
                Some(known) => known.1 = known.1.max(n),
                None => below.push((base, n)),
            }
        }
        if below.is_empty() {
            return None;
        }
        let mut above = Polynomial::default();
        for (numerator, own) in &split {
            let mut product = expand(self, *numerator, generators)?;
            for &(base, n) in &below {
                let has = own.iter().find(|b| b.0 == base).map_or(0, |b| b.1);
                let power = self.powi(base, n - has);
                let power = expand(self, power, generators)?;
                product = generators.product(&product, &power)?;
            }
            above = above.plus(product);
        }
        let mut above = above.tidy(self, generators);
        above = self.reduce_trigonometric(above, generators);
        for (base, n) in &mut below {
            above = self.cancel(above, *base, n, generators);
        }
        below.retain(|b| b.1 > 0);
        Some((self.factored(&above, generators), below))
    }

    fn cancel(&self, mut above: Polynomial, base: Expr, n: &mut i64, generators: &mut Generators) -> Polynomial {
        if !self.nonzero(base) {
            return above;
        }
        let Some(divisor) = expand(self, base, generators) else { return above };
        let whole = |p: &Polynomial| p.0.keys().flatten().all(|&n| n >= 0);
        while *n > 0 && whole(&above) && whole(&divisor) {
            generators.work += (above.0.len() * divisor.0.len()) as u64;
            let Some(quotient) = above.divided_by(&divisor) else { break };
            above = quotient;
            *n -= 1;
        }
        above
    }

    /// A product as what stands above and below the bar.
    fn split_fraction(&mut self, e: Expr) -> (Expr, Vec<(Expr, i64)>) {
        let factors = match self.node(e) {
            Node::Mul(factors) => factors.clone(),
            _ => smallvec![e],
        };
        let (mut above, mut below) = (Vec::new(), Vec::new());
        for factor in factors {
            match *self.node(factor) {
                Node::Pow(base, n) => match self.is_number(n).and_then(|n| n.as_integer()) {
                    Some(n) if n < 0 => below.push((base, -n)),
                    _ => above.push(factor),
                },
                _ => above.push(factor),
            }
        }
        (self.mul(&above), below)
    }
}
