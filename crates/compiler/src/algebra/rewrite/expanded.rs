//! Expressions multiplied out, and with common factors taken out of that.

use super::super::exprs::Exprs;
use super::super::node::{Expr, Node};
use super::super::polynomial::{Generators, Monomial, Polynomial, expand, monomial_expr};
use super::super::rational::Rational;

impl Exprs {
    /// The expression multiplied out; itself if that takes too many terms.
    pub fn expand(&mut self, e: Expr) -> Expr {
        let mut generators = Generators::default();
        match expand(self, e, &mut generators) {
            Some(polynomial) => polynomial.tidy(self, &generators).to_expr(self, &generators),
            None => e,
        }
    }

    /// Whether there is anything to multiply out, take out or bring over one denominator.
    pub(super) fn has_other_forms(&self, e: Expr) -> bool {
        let is_sum = |e: Expr| match *self.node(e) {
            Node::Add(_) => true,
            Node::Pow(base, _) => matches!(self.node(base), Node::Add(_)),
            _ => false,
        };
        match self.node(e) {
            Node::Add(terms) => terms.iter().any(|&t| {
                let monomial = self.entry(t).monomial;
                matches!(self.node(monomial), Node::Mul(_) | Node::Pow(..))
            }),
            Node::Mul(factors) => factors.iter().any(|&f| is_sum(f)),
            _ => is_sum(e),
        }
    }

    /// Multiplied out, and with common factors taken out of that.
    pub(super) fn expanded_forms(&mut self, e: Expr, forms: &mut Vec<Expr>, work: &mut u64) {
        let mut generators = Generators::within(self.search_left());
        if let Some(polynomial) = expand(self, e, &mut generators) {
            let polynomial = polynomial.tidy(self, &generators);
            let polynomial = self.reduce_trigonometric(polynomial, &mut generators);
            forms.push(polynomial.to_expr(self, &generators));
            forms.push(self.factored(&polynomial, &generators));
            forms.extend(self.grouped(&polynomial, &mut generators));
        }
        *work += generators.work;
    }

    /// Common factors in front of the sum.
    pub(super) fn factored(&mut self, polynomial: &Polynomial, generators: &Generators) -> Expr {
        let content = polynomial.content();
        let inner = polynomial.divided_by_monomial(&content).to_expr(self, generators);
        let outer = monomial_expr(self, generators, &content, &Rational::from(1));
        self.mul(&[outer, inner])
    }

    /// The sum split by whether a generator stands in the term, and common factors taken out of both halves: for the
    /// generator for which that is shortest.
    fn grouped(&mut self, polynomial: &Polynomial, generators: &mut Generators) -> Option<Expr> {
        if polynomial.0.len() < 3 || polynomial.0.len() > 24 {
            return None;
        }
        let mut best: Option<(u64, Expr)> = None;
        for i in 0..generators.list.len() {
            generators.work += 4 * polynomial.0.len() as u64;
            let holds = |m: &Monomial| m.get(i).is_some_and(|&n| n != 0);
            let (with, without): (Vec<_>, Vec<_>) = polynomial.0.clone().into_iter().partition(|(m, _)| holds(m));
            if with.len() < 2 || without.is_empty() {
                continue;
            }
            let halves = [with, without].map(|half| Polynomial(half.into_iter().collect()));
            let parts = [self.factored(&halves[0], generators), self.factored(&halves[1], generators)];
            let sum = self.add(&parts);
            let length = self.written_length(sum);
            if best.is_none_or(|b| length < b.0) {
                best = Some((length, sum));
            }
        }
        best.map(|b| b.1)
    }
}
