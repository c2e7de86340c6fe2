//! Linear forms and the inversion of laws.

use super::exprs::{Exprs, ONE, ZERO};
use super::node::{Comparison, Expr, Function, Node, Parts, Symbol};
use super::rational::Rational;
use super::table::Interpolation;
use rustc_hash::FxHashMap;
use smallvec::smallvec;
use std::collections::BTreeMap;

/// Coefficients by the index of their symbol, and the rest.
type Form = (BTreeMap<usize, Expr>, Expr);

impl Exprs {
    /// The coefficients of the symbols and the rest, `e = sum of coefficient * symbol + rest`, neither of which reads
    /// the symbols. `None` if the expression is not linear as it is written (products of sums are not multiplied out).
    pub fn linear_in(&mut self, e: Expr, symbols: &[Symbol]) -> Option<(Vec<Expr>, Expr)> {
        let (form, rest) = self.sparse_linear_in(e, symbols)?;
        let coefficients = (0..symbols.len()).map(|i| form.get(&i).copied().unwrap_or(ZERO)).collect();
        Some((coefficients, rest))
    }

    /// As `linear_in`, with the coefficients that are not zero by the index of their symbol.
    pub fn sparse_linear_in(&mut self, e: Expr, symbols: &[Symbol]) -> Option<(BTreeMap<usize, Expr>, Expr)> {
        let index: FxHashMap<Symbol, usize> = symbols.iter().enumerate().map(|(i, &s)| (s, i)).collect();
        let order = self.reading_below(&[e], &|s| index.contains_key(&s), &|_| false);
        let mut forms: FxHashMap<Expr, Form> = FxHashMap::default();
        for part in order {
            let form = self.form_of_node(part, &index, &forms);
            if let Some(form) = form {
                forms.insert(part, form);
            }
        }
        if !self.depends_on_any(e, &|s| index.contains_key(&s)) {
            return Some((BTreeMap::new(), e));
        }
        forms.remove(&e)
    }

    /// Solves `zero = 0` for a symbol where there is one solution at most: linear, odd powers and even powers of what is
    /// not negative, `exp`, `log`, roots, `sinh`, `tanh`, `atan`, `asin`, `acos`, tables of straight lines that only
    /// rise or fall, `x*abs(x)`, linear fractions, and whatever nests these. Where there is no solution (a current
    /// below `-is` in a diode) the result is undefined when evaluated, never wrong.
    ///
    /// Divisors that are not known to be nonzero are listed by [`Exprs::divisors`]: the caller watches them.
    pub fn solve_for(&mut self, zero: Expr, symbol: Symbol) -> Option<Expr> {
        if let Some((coefficient, rest)) = self.plainly_linear_in(zero, symbol) {
            let minus = self.neg(rest);
            return self.divide(minus, coefficient);
        }
        if let Some((coefficients, rest)) = self.linear_in(zero, &[symbol]) {
            let minus = self.neg(rest);
            return self.divide(minus, coefficients[0]);
        }
        self.invert(zero, ZERO, symbol)
    }

    /// Solves `left = right` for a symbol that is a factor of the right side and stands nowhere else, as in the law of a linear
    /// resistor. `None` for anything else.
    pub fn solve_product(&mut self, left: Expr, right: Expr, symbol: Symbol) -> Option<Expr> {
        if self.depends_on(left, symbol) || !matches!(self.node(right), Node::Mul(_)) {
            return None;
        }
        let coefficient = self.coefficient_of(right, symbol)?;
        self.divide(left, coefficient)
    }

    /// Whether an expression is a sum of which one term is the symbol or a product with it, and no other reads it.
    pub fn is_plainly_linear(&self, e: Expr, symbol: Symbol) -> bool {
        let Node::Add(terms) = self.node(e) else { return false };
        let mut own = terms.iter().filter(|&&t| self.depends_on(t, symbol));
        let (Some(&term), None) = (own.next(), own.next()) else { return false };
        match self.node(term) {
            Node::Symbol(_) => true,
            Node::Mul(factors) => {
                let mut own = factors.iter().filter(|&&f| self.depends_on(f, symbol));
                let (Some(&factor), None) = (own.next(), own.next()) else { return false };
                matches!(self.node(factor), Node::Symbol(_))
            }
            _ => false,
        }
    }

    /// As `linear_in` for a sum of which one term is the symbol or a product with it; `None` for anything else.
    fn plainly_linear_in(&mut self, e: Expr, symbol: Symbol) -> Option<(Expr, Expr)> {
        let Node::Add(terms) = self.node(e) else { return None };
        let own = terms.iter().position(|&t| self.depends_on(t, symbol))?;
        let (mut rest, term) = (terms.clone(), terms[own]);
        rest.remove(own);
        if rest.iter().any(|&t| self.depends_on(t, symbol)) {
            return None;
        }
        let coefficient = self.coefficient_of(term, symbol)?;
        Some((coefficient, self.add(&rest)))
    }

    /// What a symbol is multiplied by in a term that reads it: the symbol, or a product with it as one factor; `None` for anything
    /// else.
    fn coefficient_of(&mut self, term: Expr, symbol: Symbol) -> Option<Expr> {
        match self.node(term) {
            Node::Symbol(_) => Some(ONE),
            Node::Mul(factors) => {
                let is_own = |f: &Expr| *self.node(*f) == Node::Symbol(symbol);
                let (own, others): (Parts, Parts) = factors.iter().copied().partition(is_own);
                let alone = own.len() == 1 && !others.iter().any(|&f| self.depends_on(f, symbol));
                alone.then(|| self.mul(&others))
            }
            _ => None,
        }
    }

    /// The expression as a quotient: what stands over and under its line, where only factors that may vanish stand under it.
    pub fn over_and_under(&mut self, e: Expr) -> (Expr, Expr) {
        let factors: Parts = match self.node(e) {
            Node::Mul(factors) => factors.clone(),
            _ => smallvec![e],
        };
        let (mut over, mut under) = (Parts::new(), Parts::new());
        for factor in factors {
            match *self.node(factor) {
                Node::Pow(base, n) if self.is_number(n).is_some_and(|n| n.signum() < 0) && !self.nonzero(base) => {
                    let n = self.neg(n);
                    under.push(self.pow(base, n));
                }
                _ => over.push(factor),
            }
        }
        (self.mul(&over), self.mul(&under))
    }

    /// Whether the slope of the expression may be infinite: a root of what is not known to be nonzero.
    pub fn is_steep(&mut self, e: Expr) -> bool {
        let parts = self.below(&[e], &|_| true);
        parts.into_iter().any(|part| match *self.node(part) {
            Node::Pow(base, n) => {
                let root = self.is_number(n).is_some_and(|n| n.signum() > 0 && *n < Rational::from(1));
                root && !self.nonzero(base)
            }
            _ => false,
        })
    }

    /// Whether the expression may leap while what it reads moves steadily, as `if x > 0 then 1 else 2` does.
    pub fn may_leap(&self, e: Expr) -> bool {
        self.below(&[e], &|_| true).into_iter().any(|part| self.is_leap(part))
    }

    /// Whether it may leap while what these symbols stand for moves steadily.
    pub fn may_leap_by(&self, e: Expr, by: &dyn Fn(Symbol) -> bool) -> bool {
        self.below(&[e], &|_| true).into_iter().any(|part| match *self.node(part) {
            Node::Select(condition, ..) => self.depends_on_any(condition, by),
            _ => self.is_leap(part) && self.depends_on_any(part, by),
        })
    }

    /// Whether the part leaps itself.
    fn is_leap(&self, part: Expr) -> bool {
        let table = |table| self.table1d(table).interpolation();
        match *self.node(part) {
            Node::Select(..) | Node::Compare(..) | Node::And(..) | Node::Or(..) | Node::Not(_) => true,
            Node::Call(function, _) => matches!(function, Function::Sign | Function::Floor | Function::Mod),
            Node::Table(of, _) => table(of) == Interpolation::Step,
            Node::TableSlope(of, _) => table(of) != Interpolation::Cubic,
            _ => false,
        }
    }

    /// What the expression divides by that is not known to be nonzero.
    pub fn divisors(&self, e: Expr) -> Vec<Expr> {
        let mut found = Vec::new();
        for part in self.below(&[e], &|_| true) {
            if let Node::Pow(base, n) = self.node(part)
                && self.is_number(*n).is_some_and(|n| n.signum() < 0)
                && !self.nonzero(*base)
            {
                found.push(*base);
            }
        }
        found.sort_by(|&a, &b| self.order(a, b));
        found.dedup();
        found
    }

    fn form_of_node(
        &mut self,
        e: Expr,
        index: &FxHashMap<Symbol, usize>,
        known: &FxHashMap<Expr, Form>,
    ) -> Option<Form> {
        let dependent = |pool: &Self, e: Expr| pool.depends_on_any(e, &|s| index.contains_key(&s));
        match self.node(e).clone() {
            Node::Symbol(s) => Some((BTreeMap::from([(index[&s], ONE)]), ZERO)),
            Node::Add(terms) => {
                let mut collected: BTreeMap<usize, Vec<Expr>> = BTreeMap::new();
                let mut rest = Vec::new();
                for term in terms {
                    if dependent(self, term) {
                        let (form, constant) = known.get(&term)?;
                        rest.push(*constant);
                        form.iter().for_each(|(&i, &c)| collected.entry(i).or_default().push(c));
                    } else {
                        rest.push(term);
                    }
                }
                let form = collected.into_iter().map(|(i, c)| (i, self.add(&c))).filter(|c| c.1 != ZERO).collect();
                Some((form, self.add(&rest)))
            }
            Node::Mul(factors) => {
                let (inside, outside): (Vec<Expr>, Vec<Expr>) = factors.into_iter().partition(|&f| dependent(self, f));
                let [inside] = inside[..] else { return None };
                let (form, rest) = known.get(&inside)?;
                let scale = self.mul(&outside);
                let form = form.iter().map(|(&i, &c)| (i, self.mul(&[scale, c]))).collect();
                Some((form, self.mul(&[scale, *rest])))
            }
            Node::Select(c, a, b) if !dependent(self, c) => {
                let one = |e: Expr| known.get(&e).cloned().unwrap_or((BTreeMap::new(), e));
                if [a, b].iter().any(|&e| dependent(self, e) && !known.contains_key(&e)) {
                    return None;
                }
                let ((a, a_rest), (b, b_rest)) = (one(a), one(b));
                let at = |form: &BTreeMap<usize, Expr>, i| form.get(&i).copied().unwrap_or(ZERO);
                let indices: std::collections::BTreeSet<usize> = a.keys().chain(b.keys()).copied().collect();
                let form = indices.into_iter().map(|i| (i, self.select(c, at(&a, i), at(&b, i)))).collect();
                Some((form, self.select(c, a_rest, b_rest)))
            }
            Node::Whole(part) => known.get(&part).cloned(),
            _ => None,
        }
    }

    fn divide(&mut self, a: Expr, b: Expr) -> Option<Expr> {
        (!self.is_zero_given(b)).then(|| self.div(a, b))
    }

    /// The symbol from `e = y`, where `y` does not read it.
    fn invert(&mut self, e: Expr, y: Expr, s: Symbol) -> Option<Expr> {
        match self.node(e).clone() {
            Node::Symbol(_) => Some(y),
            Node::Add(terms) => self.invert_sum(e, terms, y, s),
            Node::Mul(factors) => self.invert_product(e, factors, y, s),
            Node::Pow(base, n) => self.invert_power(base, n, y, s),
            Node::Call(f, x) if x.len() == 1 => {
                let y = self.invert_call(f, y)?;
                self.invert(x[0], y, s)
            }
            Node::Select(c, a, b) if !self.depends_on(c, s) => {
                let (a, b) = (self.invert(a, y, s)?, self.invert(b, y, s)?);
                Some(self.select(c, a, b))
            }
            Node::Table(t, x) => {
                let inverse = self.table1d(t).inverse()?;
                let inverse = self.add_table(inverse);
                let y = self.table(inverse, y);
                self.invert(x, y, s)
            }
            Node::Whole(part) => self.invert(part, y, s),
            _ => None,
        }
    }

    fn invert_sum(&mut self, e: Expr, terms: Parts, y: Expr, s: Symbol) -> Option<Expr> {
        let (inside, outside): (Vec<Expr>, Vec<Expr>) = terms.into_iter().partition(|&t| self.depends_on(t, s));
        let outside = self.add(&outside);
        let y = self.sub(y, outside);
        if let [single] = inside[..] {
            return self.invert(single, y, s);
        }
        // c1*g + c2*g with one g: or a fraction in which the symbol is above and below.
        let split: Vec<(Expr, Expr)> = inside.iter().map(|&t| self.split_factors(t, s)).collect();
        if split.iter().all(|p| p.1 == split[0].1) {
            let scales: Vec<Expr> = split.iter().map(|p| p.0).collect();
            let scale = self.add(&scales);
            let y = self.divide(y, scale)?;
            return self.invert(split[0].1, y, s);
        }
        if outside != ZERO {
            let inside = self.add(&inside);
            return self.invert(inside, y, s);
        }
        self.invert_fraction(e, y, s)
    }

    /// A product as what does not read the symbol and what does.
    fn split_factors(&mut self, e: Expr, s: Symbol) -> (Expr, Expr) {
        let factors = match self.node(e) {
            Node::Mul(factors) => factors.clone(),
            _ => smallvec![e],
        };
        let (inside, outside): (Vec<Expr>, Vec<Expr>) = factors.into_iter().partition(|&f| self.depends_on(f, s));
        (self.mul(&outside), self.mul(&inside))
    }

    fn invert_product(&mut self, e: Expr, factors: Parts, y: Expr, s: Symbol) -> Option<Expr> {
        let (inside, outside): (Vec<Expr>, Vec<Expr>) = factors.into_iter().partition(|&f| self.depends_on(f, s));
        if let [single] = inside[..] {
            let outside = self.mul(&outside);
            let y = self.divide(y, outside)?;
            return self.invert(single, y, s);
        }
        if let Some((base, n)) = self.odd_product(&inside) {
            let outside = self.mul(&outside);
            let y = self.divide(y, outside)?;
            let y = self.signed_root(y, &n)?;
            return self.invert(base, y, s);
        }
        self.invert_fraction(e, y, s)
    }

    /// `x*abs(x)^(n-1)`, `sign(x)*abs(x)^n` and the like as `x` and `n > 0`.
    fn odd_product(&self, factors: &[Expr]) -> Option<(Expr, Rational)> {
        let (mut base, mut odd, mut n) = (None, false, Rational::from(0));
        for &factor in factors {
            let (inner, power) = match self.node(factor) {
                Node::Pow(inner, power) => (*inner, self.is_number(*power)?.clone()),
                _ => (factor, Rational::from(1)),
            };
            let (x, changes_sign, counts) = match self.node(inner) {
                Node::Call(Function::Abs, x) => (x[0], false, true),
                Node::Call(Function::Sign, x) => (x[0], true, false),
                _ => (inner, true, true),
            };
            if *base.get_or_insert(x) != x {
                return None;
            }
            if changes_sign {
                odd ^= power.as_integer()? % 2 != 0;
            }
            if counts {
                n = n + power;
            }
        }
        Some((base?, n)).filter(|(_, n)| odd && n.signum() > 0)
    }

    /// From `(a s + b)/(c s + d) = y`, with `a d - b c` not zero.
    fn invert_fraction(&mut self, e: Expr, y: Expr, s: Symbol) -> Option<Expr> {
        let divisors = self.divisors_of_terms(e, &|x, base| x.depends_on(base, s));
        let denominators: Vec<Expr> = divisors.into_iter().filter(|(_, n)| *n == 1).map(|(base, _)| base).collect();
        if denominators.is_empty() {
            return None;
        }
        let below = self.mul(&denominators);
        let above = self.multiply_out(e, below);
        let ([a], b) = self.linear_in(above, &[s]).map(|(c, r)| ([c[0]], r))?;
        let ([c], d) = self.linear_in(below, &[s]).map(|(c, r)| ([c[0]], r))?;
        let determinant = [self.mul(&[a, d]), self.mul(&[b, c])];
        let determinant = self.sub(determinant[0], determinant[1]);
        if self.is_zero_given(determinant) {
            return None;
        }
        let (yd, yc) = (self.mul(&[y, d]), self.mul(&[y, c]));
        let (above, below) = (self.sub(yd, b), self.sub(a, yc));
        self.divide(above, below)
    }

    /// `e` times all that its terms are divided by and of which `which` says so, so that `e = 0` can be asked for where that
    /// vanishes.
    pub fn without_divisors(&mut self, e: Expr, which: &dyn Fn(&Exprs, Expr) -> bool) -> Expr {
        let divisors = self.divisors_of_terms(e, which);
        divisors.into_iter().fold(e, |e, (base, power)| {
            let divisor = self.powi(base, power);
            self.multiply_out(e, divisor)
        })
    }

    /// What the terms of a sum are divided by and of which `which` says so, each with its highest power.
    pub fn divisors_of_terms(&self, e: Expr, which: &dyn Fn(&Exprs, Expr) -> bool) -> Vec<(Expr, i64)> {
        let terms = match self.node(e) {
            Node::Add(terms) => terms.as_slice(),
            _ => &[e],
        };
        let mut divisors: Vec<(Expr, i64)> = Vec::new();
        for term in terms {
            let factors = match self.node(*term) {
                Node::Mul(factors) => factors.as_slice(),
                _ => std::slice::from_ref(term),
            };
            for &factor in factors {
                let Node::Pow(base, n) = *self.node(factor) else { continue };
                let power = self.is_number(n).and_then(|n| n.as_integer()).map_or(0, |n| -n);
                if power <= 0 || !which(self, base) {
                    continue;
                }
                match divisors.iter_mut().find(|(known, _)| *known == base) {
                    Some((_, most)) => *most = (*most).max(power),
                    None => divisors.push((base, power)),
                }
            }
        }
        divisors
    }

    /// `e * factor` term by term, with `factor` cancelled against its inverse: for solving, where the caller checks
    /// that `factor` is not zero at the solution.
    fn multiply_out(&mut self, e: Expr, factor: Expr) -> Expr {
        let terms = match self.node(e) {
            Node::Add(terms) => terms.clone(),
            _ => smallvec![e],
        };
        let inverse = self.recip(factor);
        let products: Vec<Expr> = terms
            .into_iter()
            .map(|term| match self.node(term) {
                Node::Mul(factors) if factors.contains(&inverse) => {
                    let others: Vec<Expr> = factors.iter().copied().filter(|&f| f != inverse).collect();
                    self.mul(&others)
                }
                _ if term == inverse => ONE,
                _ => {
                    let product = self.mul(&[term, factor]);
                    self.distribute(product)
                }
            })
            .collect();
        self.add(&products)
    }

    /// A product of which one factor is a sum, as a sum of products.
    fn distribute(&mut self, e: Expr) -> Expr {
        let Node::Mul(factors) = self.node(e) else { return e };
        let factors = factors.clone();
        let Some(at) = factors.iter().position(|&f| matches!(self.node(f), Node::Add(_))) else { return e };
        let Node::Add(terms) = self.node(factors[at]).clone() else { return e };
        let products: Vec<Expr> = terms
            .into_iter()
            .map(|t| {
                let mut parts = factors.clone();
                parts[at] = t;
                self.mul(&parts)
            })
            .collect();
        self.add(&products)
    }

    fn invert_power(&mut self, base: Expr, n: Expr, y: Expr, s: Symbol) -> Option<Expr> {
        let Some(n) = self.is_number(n).cloned() else { return self.invert_exponent(base, n, y, s) };
        let inverse = n.recip()?;
        let y = if !n.is_integer() {
            // A root is not negative: the half power leaves the result undefined for y below 0.
            let half = if inverse.is_integer() && !self.nonnegative(y) { self.sqrt(y) } else { y };
            let n = if half == y { inverse } else { &inverse + &inverse };
            self.pow_number(half, &n)
        } else if self.nonnegative(base) {
            self.pow_number(y, &inverse)
        } else if !n.is_even() {
            let root = self.signed_root(y, &n.abs())?;
            if n.signum() < 0 { self.recip(root) } else { root }
        } else {
            return None;
        };
        self.invert(base, y, s)
    }

    fn invert_exponent(&mut self, base: Expr, n: Expr, y: Expr, s: Symbol) -> Option<Expr> {
        let less = self.sub(base, ONE);
        if self.depends_on(base, s) || !self.positive(base) || self.is_zero_given(less) {
            return None;
        }
        let logs = [self.call(Function::Log, &[y]), self.call(Function::Log, &[base])];
        let y = self.div(logs[0], logs[1]);
        self.invert(n, y, s)
    }

    /// The odd function `sign(y) * abs(y)^(1/n)`.
    fn signed_root(&mut self, y: Expr, n: &Rational) -> Option<Expr> {
        let inverse = n.recip()?;
        let sign = self.call(Function::Sign, &[y]);
        let size = self.call(Function::Abs, &[y]);
        let root = self.pow_number(size, &inverse);
        Some(self.mul(&[sign, root]))
    }

    /// `x` from `f(x) = y`.
    fn invert_call(&mut self, f: Function, y: Expr) -> Option<Expr> {
        use Function::*;
        match f {
            Exp => Some(self.call(Log, &[y])),
            Log => Some(self.call(Exp, &[y])),
            Log10 => {
                let ten = self.int(10);
                Some(self.pow(ten, y))
            }
            Sinh => {
                let square = self.powi(y, 2);
                let sum = self.add(&[square, ONE]);
                let root = self.sqrt(sum);
                let sum = self.add(&[y, root]);
                Some(self.call(Log, &[sum]))
            }
            Tanh => {
                let (above, below) = (self.add(&[ONE, y]), self.sub(ONE, y));
                let ratio = self.div(above, below);
                let log = self.call(Log, &[ratio]);
                Some(self.scale(&Rational::new(1, 2), log))
            }
            Atan | Asin => {
                let size = self.call(Abs, &[y]);
                let pi = self.pi();
                let quarter = self.scale(&Rational::new(1, 2), pi);
                let (relation, inverse) = if f == Atan { (Comparison::Lt, Tan) } else { (Comparison::Le, Sin) };
                let inside = self.compare(relation, size, quarter);
                let value = self.call(inverse, &[y]);
                Some(self.only_if(inside, value))
            }
            Acos => {
                let pi = self.pi();
                let bounds = [self.compare(Comparison::Le, ZERO, y), self.compare(Comparison::Le, y, pi)];
                let inside = self.and(bounds[0], bounds[1]);
                let value = self.call(Cos, &[y]);
                Some(self.only_if(inside, value))
            }
            _ => None,
        }
    }

    /// The value if the condition holds, else undefined.
    fn only_if(&mut self, condition: Expr, value: Expr) -> Expr {
        let undefined = self.div(ZERO, ZERO);
        self.select(condition, value, undefined)
    }
}
