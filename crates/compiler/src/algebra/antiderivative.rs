//! Antiderivatives in closed form, of what can be undone by the chain rule.

use super::exprs::{Exprs, ONE};
use super::node::{Expr, Facts, Function, Node, Parts, Symbol};
use super::rational::Rational;
use rustc_hash::FxHashMap;
use smallvec::smallvec;
use std::collections::BTreeMap;

/// Substitutions inside each other at most.
const DEEP: usize = 3;

/// Factors with their exponents, and the number before them.
type Powers = (Rational, BTreeMap<Expr, Expr>);

impl Exprs {
    /// An expression whose derivative by the symbol this is; `None` if none is found: sums term by term, powers, sine,
    /// cosine, exponential and hyperbolic functions, and whatever becomes one of these when a part of it is the variable.
    /// What is given is proven: its derivative less the expression is zero.
    ///
    /// ```
    /// use halfarrow_compiler::algebra::{Exprs, Facts, Function};
    /// let mut x = Exprs::default();
    /// let q = x.symbol("q", Facts::default());
    /// let e = x.sym(q);
    /// let (sine, cosine) = (x.call(Function::Sin, &[e]), x.call(Function::Cos, &[e]));
    /// assert_eq!(x.antiderivative(cosine, q), Some(sine));
    /// ```
    pub fn antiderivative(&mut self, e: Expr, symbol: Symbol) -> Option<Expr> {
        let found = self.integrated(e, symbol, 0)?;
        let slope = self.derivative(found, symbol);
        let left = self.sub(slope, e);
        self.is_zero(left).then_some(found)
    }

    /// A function of several symbols whose derivatives by these are the coefficients; `None` if the coefficients are no
    /// gradient, or none is found.
    pub fn potential(&mut self, gradient: &[(Symbol, Expr)]) -> Option<Expr> {
        let mut terms = Vec::new();
        for &(symbol, coefficient) in gradient {
            let known = self.add(&terms);
            let slope = self.derivative(known, symbol);
            let left = self.sub(coefficient, slope);
            let left = self.simplify(left);
            if !self.is_zero(left) {
                terms.push(self.antiderivative(left, symbol)?);
            }
        }
        let potential = self.add(&terms);
        let holds = gradient.iter().all(|&(symbol, coefficient)| {
            let slope = self.derivative(potential, symbol);
            let left = self.sub(slope, coefficient);
            self.is_zero(left)
        });
        holds.then_some(potential)
    }

    fn integrated(&mut self, e: Expr, symbol: Symbol, depth: usize) -> Option<Expr> {
        if !self.depends_on(e, symbol) {
            let own = self.sym(symbol);
            return Some(self.mul(&[e, own]));
        }
        if let Node::Add(terms) = self.node(e) {
            let terms = terms.clone();
            return self.integrated_sum(&terms, symbol, depth);
        }
        let factors: Parts = match self.node(e) {
            Node::Mul(factors) => factors.clone(),
            _ => smallvec![e],
        };
        let (varying, fixed): (Parts, Parts) = factors.into_iter().partition(|&f| self.depends_on(f, symbol));
        let product = self.mul(&varying);
        let found = self
            .integrated_plainly(product, symbol)
            .or_else(|| self.integrated_by_substitution(&varying, symbol, depth))
            .or_else(|| self.integrated_multiplied_out(&varying, symbol, depth))?;
        let fixed = self.mul(&fixed);
        Some(self.mul(&[fixed, found]))
    }

    fn integrated_sum(&mut self, terms: &[Expr], symbol: Symbol, depth: usize) -> Option<Expr> {
        let terms: Option<Vec<Expr>> = terms.iter().map(|&t| self.integrated(t, symbol, depth)).collect();
        terms.map(|terms| self.add(&terms))
    }

    /// Powers and functions of the symbol with a constant factor and a constant added.
    fn integrated_plainly(&mut self, e: Expr, symbol: Symbol) -> Option<Expr> {
        let (argument, power) = match self.node(e).clone() {
            Node::Symbol(_) => (e, Some(ONE)),
            Node::Pow(base, n) if !self.depends_on(n, symbol) => (base, Some(n)),
            Node::Call(_, arguments) if arguments.len() == 1 => (arguments[0], None),
            _ => return None,
        };
        let slope = self.derivative(argument, symbol);
        if self.depends_on(slope, symbol) || self.is_zero(slope) {
            return None;
        }
        let whole = match (power, self.node(e).clone()) {
            (Some(n), _) => {
                let more = self.add(&[n, ONE]);
                match self.is_zero(more) {
                    // Of what may be negative there is no logarithm.
                    true if self.positive(argument) => self.call(Function::Log, &[argument]),
                    true => return None,
                    false => {
                        let raised = self.pow(argument, more);
                        self.div(raised, more)
                    }
                }
            }
            (None, Node::Call(function, _)) => {
                let (other, sign) = match function {
                    Function::Sin => (Function::Cos, -1),
                    Function::Cos => (Function::Sin, 1),
                    Function::Exp => (Function::Exp, 1),
                    Function::Sinh => (Function::Cosh, 1),
                    Function::Cosh => (Function::Sinh, 1),
                    _ => return None,
                };
                let value = self.call(other, &[argument]);
                self.scale(&Rational::from(sign), value)
            }
            _ => return None,
        };
        Some(self.div(whole, slope))
    }

    /// By the chain rule: a part of the product is the variable, and its slope is a factor of it.
    fn integrated_by_substitution(&mut self, factors: &[Expr], symbol: Symbol, depth: usize) -> Option<Expr> {
        if depth == DEEP {
            return None;
        }
        for part in self.inner_parts(factors, symbol) {
            let slope = self.derivative(part, symbol);
            let slope = self.simplify(slope);
            let Some(quotient) = self.divided_by_factors(factors, slope) else { continue };
            let variable = self.fresh("part", Facts::default());
            let own = self.sym(variable);
            let renamed = self.with_part(quotient, part, own);
            if self.depends_on(renamed, symbol) {
                continue;
            }
            if let Some(found) = self.integrated(renamed, variable, depth + 1) {
                return Some(self.substitute(found, &BTreeMap::from([(variable, part)])));
            }
        }
        None
    }

    /// A sum among the factors, multiplied out.
    fn integrated_multiplied_out(&mut self, factors: &[Expr], symbol: Symbol, depth: usize) -> Option<Expr> {
        let at = factors.iter().position(|&f| matches!(self.node(f), Node::Add(_)))?;
        if factors.len() < 2 || depth == DEEP {
            return None;
        }
        let Node::Add(terms) = self.node(factors[at]).clone() else { return None };
        let others: Vec<Expr> = factors.iter().enumerate().filter(|(k, _)| *k != at).map(|f| *f.1).collect();
        let products: Vec<Expr> = terms
            .iter()
            .map(|&term| {
                let product: Vec<Expr> = others.iter().copied().chain([term]).collect();
                self.mul(&product)
            })
            .collect();
        self.integrated_sum(&products, symbol, depth + 1)
    }

    /// What could be the variable: what stands in functions and under powers, and functions themselves.
    fn inner_parts(&self, factors: &[Expr], symbol: Symbol) -> Vec<Expr> {
        let mut parts: Vec<Expr> = Vec::new();
        for part in self.below(factors, &|e| self.depends_on(e, symbol)) {
            let inner: Parts = match self.node(part) {
                Node::Pow(base, _) => smallvec![*base],
                Node::Call(_, arguments) => arguments.iter().copied().chain([part]).collect(),
                _ => continue,
            };
            let varies = |e: &Expr| self.depends_on(*e, symbol) && !matches!(self.node(*e), Node::Symbol(_));
            parts.extend(inner.into_iter().filter(varies));
        }
        parts.dedup();
        // The greatest first: what it leaves is least.
        parts.reverse();
        parts
    }

    /// A product of factors divided by another product, if that divides it factor by factor.
    fn divided_by_factors(&mut self, factors: &[Expr], by: Expr) -> Option<Expr> {
        let whole = self.mul(factors);
        let (mut number, mut powers) = self.powers(whole);
        let (divisor, others) = self.powers(by);
        if divisor.signum() == 0 {
            return None;
        }
        number = &number * &divisor.recip()?;
        for (base, n) in others {
            let minus = self.neg(n);
            let left = match powers.get(&base) {
                Some(&own) => self.add(&[own, minus]),
                None => minus,
            };
            powers.insert(base, left);
        }
        let mut product = vec![self.number(number)];
        for (base, n) in powers {
            if !self.is_zero(n) {
                product.push(self.pow(base, n));
            }
        }
        Some(self.mul(&product))
    }

    fn powers(&self, e: Expr) -> Powers {
        let factors: Parts = match self.node(e) {
            Node::Mul(factors) => factors.clone(),
            _ => smallvec![e],
        };
        let (mut number, mut powers) = (Rational::from(1), BTreeMap::new());
        for factor in factors {
            match *self.node(factor) {
                Node::Number(ref own) => number = &number * own,
                // A base stands there once for each kind of exponent.
                Node::Pow(base, n) if !powers.contains_key(&base) => _ = powers.insert(base, n),
                _ => _ = powers.insert(factor, ONE),
            }
        }
        (number, powers)
    }

    /// The expression with another one in the place of a part.
    fn with_part(&mut self, e: Expr, part: Expr, other: Expr) -> Expr {
        let mut new: FxHashMap<Expr, Expr> = FxHashMap::from_iter([(part, other)]);
        for below in self.below(&[e], &|e| e != part) {
            let rebuilt = self.rebuild(below, &|c| new.get(&c).copied().unwrap_or(c));
            if rebuilt != below {
                new.insert(below, rebuilt);
            }
        }
        new.get(&e).copied().unwrap_or(e)
    }
}
