//! Expressions multiplied out, and with common factors taken out of that.

use super::super::exprs::Exprs;
use super::super::node::{Expr, Node};
use super::super::polynomial::{Generators, Polynomial, expand, monomial_expr};
use super::super::rational::Rational;
use super::least_length::{Lengths, Term};

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

    /// Multiplied out, and with common factors taken out of that, where that is shorter.
    pub(super) fn expanded_forms(&mut self, e: Expr, forms: &mut Vec<Expr>, work: &mut u64) {
        let mut generators = Generators::within(self.search_left());
        if let Some(polynomial) = expand(self, e, &mut generators) {
            let polynomial = polynomial.tidy(self, &generators);
            let polynomial = self.reduce_trigonometric(polynomial, &mut generators);
            let lengths = self.lengths(&generators);
            let mut shortest = self.written_length(e);
            let least = lengths.of_sum(&polynomial);
            if least < shortest {
                let form = polynomial.to_expr(self, &generators);
                shortest = shortest.min(self.checked_length(form, least));
                forms.push(form);
            }
            let least = lengths.of_factored(&polynomial);
            if least < shortest {
                let form = self.factored(&polynomial, &generators);
                shortest = shortest.min(self.checked_length(form, least));
                forms.push(form);
            }
            forms.extend(self.grouped(&polynomial, &mut generators, &lengths, shortest));
        }
        *work += generators.work;
    }

    /// How long a form is, which was told to be no shorter than this.
    fn checked_length(&self, form: Expr, least: u64) -> u64 {
        let length = self.written_length(form);
        debug_assert!(
            length >= least,
            "a form of length {length} was to be no shorter than {least}: {}",
            super::super::ascii(self, form, &super::super::PlainNames(self))
        );
        length
    }

    /// Common factors in front of the sum.
    pub(super) fn factored(&mut self, polynomial: &Polynomial, generators: &Generators) -> Expr {
        let content = polynomial.content();
        let inner = polynomial.divided_by_monomial(&content).to_expr(self, generators);
        let outer = monomial_expr(self, generators, &content, &Rational::from(1));
        self.mul(&[outer, inner])
    }

    /// The sum split by whether a generator stands in the term, and common factors taken out of both halves: for the
    /// generator for which that is shortest, if it is shorter than this.
    fn grouped(
        &mut self,
        polynomial: &Polynomial,
        generators: &mut Generators,
        lengths: &Lengths,
        shortest: u64,
    ) -> Option<Expr> {
        if polynomial.0.len() < 3 || polynomial.0.len() > 24 {
            return None;
        }
        let split = |i: usize| -> (Vec<Term>, Vec<Term>) {
            polynomial.0.iter().partition(|(monomial, _)| monomial.get(i).is_some_and(|&n| n != 0))
        };
        let mut candidates = Vec::new();
        for i in 0..generators.list.len() {
            generators.work += 4 * polynomial.0.len() as u64;
            let (with, without) = split(i);
            if with.len() >= 2 && !without.is_empty() {
                let least = lengths.of_halves([&with, &without]);
                candidates.extend((least < shortest).then_some((least, i)));
            }
        }
        // What is short at least may be the shortest; most others then need not be formed.
        candidates.sort_unstable();
        let mut best: Option<(u64, usize, Expr)> = None;
        for (least, i) in candidates {
            if best.is_some_and(|(length, first, _)| (length, first) < (least, i)) {
                continue;
            }
            let (with, without) = split(i);
            let parts = [with, without].map(|half| {
                let half = half.into_iter().map(|(m, c)| (m.clone(), c.clone()));
                self.factored(&Polynomial(half.collect()), generators)
            });
            let sum = self.add(&parts);
            let length = self.checked_length(sum, least);
            if length < shortest && best.is_none_or(|(known, first, _)| (length, i) < (known, first)) {
                best = Some((length, i, sum));
            }
        }
        best.map(|(.., sum)| sum)
    }
}
