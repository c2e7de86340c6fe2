//! Sums, products and powers in canonical form.

use super::exprs::{Exprs, MINUS_ONE, ONE, ZERO};
use super::node::{Expr, Function, Node, Parts};
use super::rational::Rational;
use dashu_base::{Gcd, UnsignedAbs};
use dashu_int::{IBig, UBig};
use smallvec::{SmallVec, smallvec};

/// Expressions that are written no longer than this are not taken as wholes.
const SHORT: u64 = 12;

impl Exprs {
    /// The sum.
    pub fn add(&mut self, terms: &[Expr]) -> Expr {
        let mut sum = Sum { constant: Rational::from(0), terms: SmallVec::new() };
        for &term in terms {
            self.collect_term(&mut sum, term, None);
        }
        self.finish_sum(sum)
    }

    /// `a - b`.
    pub fn sub(&mut self, a: Expr, b: Expr) -> Expr {
        let b = self.neg(b);
        self.add(&[a, b])
    }

    /// `-e`.
    pub fn neg(&mut self, e: Expr) -> Expr {
        self.scale(&Rational::from(-1), e)
    }

    /// A number times an expression.
    pub fn scale(&mut self, number: &Rational, e: Expr) -> Expr {
        if number.is_one() {
            return e;
        }
        if number.is_zero() && self.total(e) {
            return ZERO;
        }
        let (own, monomial) = self.coefficient(e);
        let number = number * &own;
        if monomial == ONE {
            return self.number(number);
        }
        if number.is_one() {
            return monomial;
        }
        let factors = match self.node(monomial) {
            Node::Add(terms) if !number.is_zero() => {
                let terms = terms.clone();
                let terms = terms.into_iter().map(|t| self.scale(&number, t)).collect();
                return self.intern(Node::Add(terms));
            }
            Node::Mul(factors) => factors.clone(),
            _ => smallvec![monomial],
        };
        let number = self.number(number);
        self.intern(Node::Mul(std::iter::once(number).chain(factors).collect()))
    }

    /// The product.
    pub fn mul(&mut self, factors: &[Expr]) -> Expr {
        let mut number = Rational::from(1);
        let mut rest: Option<Expr> = None;
        let mut several = false;
        for &factor in factors {
            match (self.is_number(factor), rest) {
                (Some(value), _) => number = &number * value,
                (None, None) => rest = Some(factor),
                (None, Some(_)) => several = true,
            }
        }
        match rest {
            None => self.number(number),
            Some(single) if !several => self.scale(&number, single),
            Some(_) => self.product(factors),
        }
    }

    /// `1/e`.
    pub fn recip(&mut self, e: Expr) -> Expr {
        self.pow(e, MINUS_ONE)
    }

    /// `a/b`.
    pub fn div(&mut self, a: Expr, b: Expr) -> Expr {
        if b == ONE {
            return a;
        }
        let b = self.recip(b);
        self.mul(&[a, b])
    }

    /// `base^n`.
    pub fn powi(&mut self, base: Expr, n: i64) -> Expr {
        let n = self.int(n);
        self.pow(base, n)
    }

    /// `base^exponent`.
    pub fn pow(&mut self, base: Expr, exponent: Expr) -> Expr {
        match self.is_number(exponent) {
            Some(n) => {
                let n = n.clone();
                self.pow_number(base, &n)
            }
            None => self.pow_symbolic(base, exponent),
        }
    }

    fn collect_term(&mut self, sum: &mut Sum, term: Expr, scale: Option<&Rational>) {
        let (number, monomial) = self.coefficient(term);
        let number = scale.map_or(number.clone(), |s| s * &number);
        if monomial == ONE {
            sum.constant = &sum.constant + &number;
        } else if let Node::Add(terms) = self.node(monomial) {
            let terms = terms.clone();
            for part in terms {
                self.collect_term(sum, part, Some(&number));
            }
        } else {
            let as_it_stands = scale.is_none_or(Rational::is_one).then_some(term);
            sum.terms.push(Term { number, monomial, as_it_stands });
        }
    }

    fn finish_sum(&mut self, sum: Sum) -> Expr {
        let Sum { constant, mut terms } = sum;
        if terms.len() > 1 {
            terms.sort_by(|a, b| self.order(a.monomial, b.monomial));
            terms.dedup_by(|later, kept| {
                let like = later.monomial == kept.monomial;
                if like {
                    kept.number = &kept.number + &later.number;
                    kept.as_it_stands = None;
                }
                like
            });
        }
        terms.retain(|term| !term.number.is_zero() || !self.total(term.monomial));
        if terms.is_empty() {
            return self.number(constant);
        }
        let whole = |x: &mut Exprs, term: &Term| match term.as_it_stands {
            Some(whole) => whole,
            None => x.scale(&term.number, term.monomial),
        };
        if let ([single], true) = (&terms[..], constant.is_zero()) {
            return whole(self, single);
        }
        let mut children = Parts::with_capacity(terms.len() + 1);
        if !constant.is_zero() {
            children.push(self.number(constant));
        }
        children.extend(terms.iter().map(|term| whole(self, term)));
        self.intern(Node::Add(children))
    }

    /// A sum as a number times a sum whose first term that is no number has a positive coefficient, and whose integer
    /// coefficients have no common divisor. Anything else is 1 times itself.
    pub(crate) fn primitive(&mut self, e: Expr) -> (Rational, Expr) {
        if !matches!(self.node(e), Node::Add(_)) {
            return (Rational::from(1), e);
        }
        let terms = self.terms(e);
        let content = content(&terms);
        match content.recip() {
            Some(inverse) if !content.is_one() => (content, self.scale(&inverse, e)),
            _ => (Rational::from(1), e),
        }
    }

    /// The expression as one part: what stands around it is not multiplied into it, and nothing is taken out of it, so that
    /// what is made of many such parts stays as long as they are many. Values and zeros are what they were. Short ones stay
    /// as they are.
    ///
    /// ```
    /// use halfarrow_compiler::algebra::{Exprs, Facts};
    /// let mut x = Exprs::default();
    /// let [a, b, c] = ["a", "b", "c"].map(|name| x.symbol(name, Facts::default())).map(|s| x.sym(s));
    /// let (ab, bc) = (x.mul(&[a, b]), x.mul(&[b, c]));
    /// let sum = x.add(&[a, ab, bc, c, b]);
    /// let whole = x.whole(sum);
    /// assert_ne!(whole, sum);
    /// let difference = x.sub(whole, sum);
    /// assert!(x.is_zero(difference));
    /// ```
    pub fn whole(&mut self, e: Expr) -> Expr {
        let (number, part) = match self.primitive(e) {
            (number, part) if !number.is_one() => (number, part),
            _ => self.coefficient(e),
        };
        if matches!(self.node(part), Node::Whole(_)) || self.written_length(part) <= SHORT {
            return e;
        }
        let whole = self.intern(Node::Whole(part));
        self.scale(&number, whole)
    }

    fn product(&mut self, factors: &[Expr]) -> Expr {
        let mut product = Product { number: Rational::from(1), powers: SmallVec::new() };
        for &factor in factors {
            self.collect_factor(&mut product, factor);
        }
        let Product { mut number, mut powers } = product;
        powers.sort_by(|a, b| self.order(a.0, b.0).then_with(|| self.order(a.1, b.1)));
        let mut children = Parts::with_capacity(powers.len() + 1);
        let mut start = 0;
        let mut regroup = false;
        while start < powers.len() {
            let base = powers[start].0;
            let end = start + powers[start..].iter().take_while(|p| p.0 == base).count();
            let mut merged = Parts::new();
            self.merge_powers(base, &powers[start..end], &mut merged);
            for power in merged {
                match self.node(power) {
                    Node::Number(value) => number = &number * value,
                    Node::Mul(_) => {
                        regroup = true;
                        children.push(power);
                    }
                    _ => children.push(power),
                }
            }
            start = end;
        }
        if regroup {
            let number = self.number(number);
            children.push(number);
            return self.mul(&children);
        }
        if number.is_zero() {
            children.retain(|c| !self.total(*c));
        }
        children.sort_by(|&a, &b| self.order(a, b));
        match children[..] {
            [] => self.number(number),
            [single] => self.scale(&number, single),
            _ if number.is_one() => self.intern(Node::Mul(children)),
            _ => {
                children.insert(0, self.number(number));
                self.intern(Node::Mul(children))
            }
        }
    }

    fn collect_factor(&mut self, product: &mut Product, factor: Expr) {
        match self.node(factor) {
            Node::Number(value) => product.number = &product.number * value,
            Node::Mul(factors) => {
                let factors = factors.clone();
                for part in factors {
                    self.collect_factor(product, part);
                }
            }
            Node::Pow(base, n) => product.powers.push((*base, *n)),
            Node::Call(Function::Exp, x) => {
                let x = x[0];
                let e = self.call(Function::Exp, &[ONE]);
                product.powers.push((e, x));
            }
            Node::Add(_) => {
                let (content, primitive) = self.primitive(factor);
                product.number = &product.number * &content;
                product.powers.push((primitive, ONE));
            }
            _ => product.powers.push((factor, ONE)),
        }
    }

    /// The powers of one base, multiplied as far as that leaves alone where they are defined.
    fn merge_powers(&mut self, base: Expr, powers: &[(Expr, Expr)], merged: &mut Parts) {
        if let [(base, n)] = powers {
            merged.push(if *n == ONE { *base } else { self.pow(*base, *n) });
            return;
        }
        let whole = |n: &Expr| self.is_number(*n).is_some_and(Rational::is_integer);
        let roots = !powers.iter().all(|p| whole(&p.1));
        if roots && self.positive(base) {
            let exponents: Vec<Expr> = powers.iter().map(|p| p.1).collect();
            let n = self.add(&exponents);
            merged.push(self.pow(base, n));
            return;
        }
        let below = |p: &&(Expr, Expr)| self.is_number(p.1).is_some_and(|n| n.signum() < 0);
        let mixed = (1..powers.len()).contains(&powers.iter().filter(below).count());
        let nonzero = (roots || mixed) && self.nonzero(base);
        let nonnegative = roots && self.nonnegative(base);
        // Exponents that may be added: by sign unless the base is nonzero, whole ones apart from roots unless it is
        // not negative.
        let mut groups: [Vec<Rational>; 4] = Default::default();
        for &(_, exponent) in powers {
            match self.is_number(exponent) {
                Some(n) => {
                    let root = !n.is_integer() && !nonnegative;
                    let below = n.signum() < 0 && (root || !nonzero);
                    groups[usize::from(root) * 2 + usize::from(below)].push(n.clone());
                }
                None => merged.push(self.pow(base, exponent)),
            }
        }
        for (kind, group) in groups.into_iter().enumerate() {
            let Some(n) = group.iter().cloned().reduce(|a, b| a + b) else { continue };
            let power = if kind >= 2 && n.is_integer() {
                self.power_of_root(base, &group, &n)
            } else {
                self.pow_number(base, &n)
            };
            merged.push(power);
        }
    }

    /// `(base^(1/d))^k`: roots whose exponents add up to an integer stay roots, since the base must not be negative.
    fn power_of_root(&mut self, base: Expr, exponents: &[Rational], sum: &Rational) -> Expr {
        let lcm = |d: IBig, n: &Rational| {
            let common = (&d).gcd(&n.denominator());
            d / IBig::from(common) * n.denominator()
        };
        let d = Rational::from_big(exponents.iter().fold(IBig::ONE, lcm).into());
        let root = self.pow_number(base, &d.recip().expect("a multiple of denominators"));
        let k = self.number(sum * &d);
        self.intern(Node::Pow(root, k))
    }

    pub(super) fn pow_number(&mut self, base: Expr, n: &Rational) -> Expr {
        if n.is_one() {
            return base;
        }
        if n.is_zero() {
            // 1 where the base is defined.
            let nothing = self.mul(&[ZERO, base]);
            return self.add(&[ONE, nothing]);
        }
        let exponent = self.number(n.clone());
        match self.node(base) {
            Node::Number(value) => {
                let value = value.clone();
                self.number_to_power(base, &value, n)
            }
            Node::Mul(factors) => {
                let factors = factors.clone();
                self.product_to_power(base, factors, n)
            }
            Node::Pow(inner, m) => {
                let (inner, m) = (*inner, *m);
                self.power_to_power(base, inner, m, n)
            }
            Node::Call(Function::Exp, x) => {
                let x = x[0];
                let x = self.scale(n, x);
                self.call(Function::Exp, &[x])
            }
            Node::Call(Function::Abs, x) if is_even(n) => {
                let x = x[0];
                self.pow_number(x, n)
            }
            Node::Add(_) if n.is_integer() => match self.primitive(base) {
                (content, _) if content.is_one() => self.intern(Node::Pow(base, exponent)),
                (content, primitive) => {
                    let content = self.number(content);
                    let (a, b) = (self.pow_number(content, n), self.pow_number(primitive, n));
                    self.mul(&[a, b])
                }
            },
            _ => self.intern(Node::Pow(base, exponent)),
        }
    }

    fn number_to_power(&mut self, base: Expr, value: &Rational, n: &Rational) -> Expr {
        if value.is_one() {
            return ONE;
        }
        if let Some(whole) = n.as_integer() {
            if let Some(result) = value.powi(whole) {
                return self.number(result);
            }
        } else if let (Some((p, q)), true) = (n.small(), value.signum() > 0) {
            let root = u32::try_from(q).ok().and_then(|q| value.root(q));
            if let Some(result) = root.and_then(|r| r.powi(p)) {
                return self.number(result);
            }
            let whole = n.floor();
            if let (false, Some(outside)) = (whole.is_zero(), whole.as_integer().and_then(|w| value.powi(w))) {
                let part = self.number(n - &whole);
                let root = self.intern(Node::Pow(base, part));
                return self.scale(&outside, root);
            }
        } else if value.is_zero() && n.signum() > 0 {
            return ZERO;
        }
        let exponent = self.number(n.clone());
        self.intern(Node::Pow(base, exponent))
    }

    fn product_to_power(&mut self, base: Expr, factors: Parts, n: &Rational) -> Expr {
        if n.is_integer() {
            let powers: Vec<Expr> = factors.into_iter().map(|f| self.pow_number(f, n)).collect();
            return self.mul(&powers);
        }
        // Out of a root come the factors that are positive and leave no root behind.
        let (mut outside, mut inside) = (Vec::new(), Vec::new());
        for factor in factors {
            let power = if self.positive(factor) { self.pow_number(factor, n) } else { factor };
            let rooted =
                matches!(self.node(power), Node::Pow(_, m) if self.is_number(*m).is_none_or(|m| !m.is_integer()));
            if self.positive(factor) && !rooted && !matches!(self.node(power), Node::Mul(_)) {
                outside.push(power);
            } else {
                inside.push(factor);
            }
        }
        let exponent = self.number(n.clone());
        if outside.is_empty() {
            return self.intern(Node::Pow(base, exponent));
        }
        let inside = self.mul(&inside);
        outside.push(self.pow_number(inside, n));
        self.mul(&outside)
    }

    /// `(inner^m)^n`, with the exponents multiplied where that leaves alone where it is defined.
    fn power_to_power(&mut self, base: Expr, inner: Expr, m: Expr, n: &Rational) -> Expr {
        let exponent = self.number(n.clone());
        let Some(m_number) = self.is_number(m).cloned() else {
            if self.positive(inner) {
                let m = self.scale(n, m);
                return self.pow(inner, m);
            }
            return self.intern(Node::Pow(base, exponent));
        };
        let both = &m_number * n;
        let zero_stays_out = m_number.signum() > 0 || n.signum() > 0 || self.nonzero(inner);
        let sign_stays = (m_number.is_integer() && n.is_integer())
            || (!m_number.is_integer() && !both.is_integer())
            || self.nonnegative(inner);
        if sign_stays && zero_stays_out {
            return self.pow_number(inner, &both);
        }
        if m_number.is_integer() && n.is_integer() && !zero_stays_out && m != MINUS_ONE {
            let inverse = self.pow_number(inner, &Rational::from(-1));
            return self.pow_number(inverse, &-&both);
        }
        if is_even(&m_number) && !n.is_integer() && zero_stays_out {
            let size = self.call(Function::Abs, &[inner]);
            return self.pow_number(size, &both);
        }
        self.intern(Node::Pow(base, exponent))
    }

    fn pow_symbolic(&mut self, base: Expr, exponent: Expr) -> Expr {
        match self.node(base) {
            Node::Number(one) if one.is_one() && self.total(exponent) => ONE,
            Node::Call(Function::Exp, x) => {
                let x = x[0];
                let x = self.mul(&[x, exponent]);
                self.call(Function::Exp, &[x])
            }
            Node::Pow(inner, m) if self.positive(*inner) => {
                let (inner, m) = (*inner, *m);
                let n = self.mul(&[m, exponent]);
                self.pow(inner, n)
            }
            _ => self.intern(Node::Pow(base, exponent)),
        }
    }
}

struct Sum {
    constant: Rational,
    terms: SmallVec<[Term; 4]>,
}

/// A term of a sum: a number times a product.
struct Term {
    number: Rational,
    monomial: Expr,
    /// The same as one expression, where there is one.
    as_it_stands: Option<Expr>,
}

struct Product {
    number: Rational,
    powers: SmallVec<[(Expr, Expr); 8]>,
}

fn is_even(n: &Rational) -> bool {
    n.is_integer() && n.is_even()
}

/// The number that `primitive` takes out.
fn content(terms: &[(Rational, Expr)]) -> Rational {
    let leading = terms.iter().find(|t| t.1 != ONE).unwrap_or(&terms[0]);
    &Rational::from(i64::from(leading.0.signum())) * &content_size(terms.iter().map(|t| &t.0))
}

/// The same without its sign, of the numbers before the terms.
pub(super) fn content_size<'a>(numbers: impl Iterator<Item = &'a Rational> + Clone) -> Rational {
    let size = numbers.clone().next().map_or(Rational::from(1), Rational::abs);
    if numbers.clone().all(|n| n.abs() == size) {
        return size;
    }
    if !numbers.clone().all(Rational::is_integer) {
        return Rational::from(1);
    }
    let mut numerators = numbers.map(|n| n.numerator().unsigned_abs());
    let first = numerators.next().unwrap_or(UBig::ONE);
    Rational::from_big(numerators.fold(first, |g, n| if n.is_zero() { g } else { g.gcd(n) }).into())
}
