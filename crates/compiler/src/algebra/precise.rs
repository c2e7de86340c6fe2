//! Values with a bound on their error, in floats of 53 bits and of 320: the slow half of the zero test.

use super::exprs::Exprs;
use super::math;
use super::node::{Comparison, Expr, Function, Node, Symbol};
use super::rational::Rational;
use astro_float_num::{BigFloat, Consts, Radix, RoundingMode, Sign, Word};
use rustc_hash::FxHashMap;
use std::sync::MutexGuard;

/// Real numbers of some precision.
pub(super) trait Real: Clone + Sized {
    /// Bits that a single operation gets right.
    const BITS: f64;
    fn rational(value: &Rational, constants: &mut Consts) -> Self;
    fn pi(constants: &mut Consts) -> Self;
    fn add(&self, other: &Self) -> Self;
    fn mul(&self, other: &Self) -> Self;
    fn recip(&self) -> Self;
    fn pow(&self, n: &Self, constants: &mut Consts) -> Self;
    fn call(&self, f: Function, constants: &mut Consts) -> Self;
    /// Functions whose values are kept, if they cost so much.
    fn calls(pool: &Exprs) -> Option<MutexGuard<'_, Kept<Self>>> {
        let _ = pool;
        None
    }
    /// The logarithm to base 2 of its size: minus infinity for 0, NaN if it is no finite number.
    fn size(&self) -> f64;
    fn negative(&self) -> bool;
}

impl Real for f64 {
    const BITS: f64 = 51.0;

    fn rational(value: &Rational, _: &mut Consts) -> Self {
        value.to_f64()
    }
    fn pi(_: &mut Consts) -> Self {
        std::f64::consts::PI
    }
    fn add(&self, other: &Self) -> Self {
        self + other
    }
    fn mul(&self, other: &Self) -> Self {
        self * other
    }
    fn recip(&self) -> Self {
        1.0 / self
    }
    fn pow(&self, n: &Self, _: &mut Consts) -> Self {
        math::pow(*self, *n)
    }
    fn call(&self, f: Function, _: &mut Consts) -> Self {
        f.value(*self, 0.0)
    }
    fn size(&self) -> f64 {
        if self.is_finite() { math::log2(self.abs()) } else { f64::NAN }
    }
    fn negative(&self) -> bool {
        *self < 0.0
    }
}

const P: usize = 320;
/// Without correct rounding: the search for it need not end where a result is exact.
const RM: RoundingMode = RoundingMode::None;

impl Real for BigFloat {
    const BITS: f64 = 250.0;

    fn rational(value: &Rational, constants: &mut Consts) -> Self {
        match value.small() {
            Some((n, 1)) => BigFloat::from_i64(n, P),
            Some((n, d)) => BigFloat::from_i64(n, P).div(&BigFloat::from_i64(d, P), P, RM),
            None => {
                let part = |n: dashu_int::IBig, c: &mut Consts| BigFloat::parse(&n.to_string(), Radix::Dec, P, RM, c);
                part(value.numerator(), constants).div(&part(value.denominator(), constants), P, RM)
            }
        }
    }
    fn pi(constants: &mut Consts) -> Self {
        constants.pi(P, RM)
    }
    fn add(&self, other: &Self) -> Self {
        BigFloat::add(self, other, P, RM)
    }
    fn mul(&self, other: &Self) -> Self {
        BigFloat::mul(self, other, P, RM)
    }
    fn recip(&self) -> Self {
        self.reciprocal(P, RM)
    }
    fn pow(&self, n: &Self, constants: &mut Consts) -> Self {
        self.ln(P, RM, constants).mul(n, P, RM).exp(P, RM, constants)
    }
    fn call(&self, f: Function, c: &mut Consts) -> Self {
        use Function::*;
        match f {
            Sin => self.sin(P, RM, c),
            Cos => self.cos(P, RM, c),
            Tan => self.tan(P, RM, c),
            Asin => self.asin(P, RM, c),
            Acos => self.acos(P, RM, c),
            Atan => self.atan(P, RM, c),
            Exp => self.exp(P, RM, c),
            Log => self.ln(P, RM, c),
            Log10 => self.log10(P, RM, c),
            Sqrt => self.sqrt(P, RM),
            Sinh => self.sinh(P, RM, c),
            Cosh => self.cosh(P, RM, c),
            Tanh => self.tanh(P, RM, c),
            Abs => self.abs(),
            Atan2 | Sign | Min | Max | Floor | Mod => BigFloat::nan(None),
        }
    }
    fn calls(pool: &Exprs) -> Option<MutexGuard<'_, Calls>> {
        Some(pool.told.calls())
    }
    fn size(&self) -> f64 {
        if self.is_nan() || self.is_inf() {
            f64::NAN
        } else if self.is_zero() {
            f64::NEG_INFINITY
        } else {
            // The mantissa is at least a half and less than 1; of a chain of products nothing may be given away.
            let top = self.mantissa_digits().and_then(|digits| digits.last().copied());
            let mantissa = top.map_or(0.0, |top| math::log2((top as f64 + 1.0) / Word::MAX as f64));
            self.exponent().map_or(f64::NAN, |exponent| f64::from(exponent) + mantissa)
        }
    }
    fn negative(&self) -> bool {
        self.sign() == Some(Sign::Neg) && !self.is_zero()
    }
}

/// Values of functions and of powers that are no whole ones, by point and expression.
pub(super) type Kept<R> = FxHashMap<(u64, bool, Expr), Option<Approximate<R>>>;
/// Those of many digits.
pub(super) type Calls = Kept<BigFloat>;

/// A value and the logarithm to base 2 of a bound on its error.
#[derive(Debug, Clone)]
pub(super) struct Approximate<R> {
    value: R,
    error: f64,
}

/// Values at one point; none where an expression has none.
pub(super) type Values<R> = FxHashMap<Expr, Option<Approximate<R>>>;

/// What a value says about whether it is zero.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Verdict {
    Zero,
    Nonzero,
    /// It is undefined here, or too inexact to say.
    Unknown,
}

/// A point at which expressions are evaluated.
pub(super) struct Point<'a> {
    pub pool: &'a Exprs,
    /// Which of the points.
    pub number: u64,
    /// Parameters have their given values.
    pub given: bool,
}

impl Point<'_> {
    /// Whether the expression is zero at this point; with values that are known of it already, and those that are found.
    pub fn verdict<R: Real>(&self, e: Expr, values: &mut Values<R>, constants: &mut Consts) -> Verdict {
        let Some(result) = self.value::<R>(e, values, constants) else { return Verdict::Unknown };
        if result.value.size() > result.error + 2.0 {
            return Verdict::Nonzero;
        }
        // Small among its own terms, not only small.
        let terms = match self.pool.node(e) {
            Node::Add(terms) => terms.as_slice(),
            _ => &[],
        };
        let sizes = terms.iter().filter_map(|t| values.get(t)?.as_ref().map(|v| v.value.size()));
        let greatest = sizes.fold(f64::NEG_INFINITY, f64::max);
        let exact = result.error == f64::NEG_INFINITY;
        if exact || result.error <= greatest - R::BITS * 0.6 { Verdict::Zero } else { Verdict::Unknown }
    }

    fn value<R: Real>(&self, e: Expr, values: &mut Values<R>, constants: &mut Consts) -> Option<Approximate<R>> {
        let known = &*values;
        for part in self.pool.below(&[e], &|e| !known.contains_key(&e)) {
            let place = (self.number, self.given, part);
            let keeps = match self.pool.node(part) {
                Node::Call(..) => true,
                Node::Pow(_, n) => self.pool.is_number(*n).is_none_or(|n| !n.is_integer()),
                _ => false,
            };
            if keeps && let Some(kept) = R::calls(self.pool).and_then(|calls| calls.get(&place).cloned()) {
                values.insert(part, kept);
                continue;
            }
            let value = match self.pool.node(part) {
                Node::Symbol(s) => self.symbol(*s, values, constants),
                node => self.node(node, values, constants),
            };
            let sound = |v: &Approximate<R>| !v.value.size().is_nan() && !v.error.is_nan() && v.error < 900.0;
            let value = value.filter(sound);
            if keeps && let Some(mut calls) = R::calls(self.pool) {
                calls.insert(place, value.clone());
            }
            values.insert(part, value);
        }
        values[&e].clone()
    }

    fn symbol<R: Real>(
        &self,
        symbol: Symbol,
        values: &mut Values<R>,
        constants: &mut Consts,
    ) -> Option<Approximate<R>> {
        let facts = self.pool.facts(symbol);
        if let (true, Some(given)) = (self.given, facts.given) {
            return self.value(given, values, constants);
        }
        let seed = self.pool.label(symbol).bytes().fold(self.number, |h, b| super::fingerprint::mix(h, u64::from(b)));
        let size = 300_000 + (seed >> 20) % 1_400_000;
        // The first two points have all signs alike, for functions that need that.
        let negative = match self.number {
            _ if facts.positive => false,
            0 => false,
            1 => true,
            _ => seed % 2 == 1,
        };
        let size = i64::try_from(size).unwrap_or(1);
        let value = Rational::new(if negative { -size } else { size }, 1_000_003);
        Some(rounded(R::rational(&value, constants), f64::NEG_INFINITY))
    }

    fn node<R: Real>(&self, node: &Node, values: &Values<R>, constants: &mut Consts) -> Option<Approximate<R>> {
        let at = |e: &Expr| values[e].as_ref();
        match node {
            Node::Number(value) => Some(match value.as_integer() {
                Some(n) if n.abs() < 1 << 50 => {
                    Approximate { value: R::rational(value, constants), error: f64::NEG_INFINITY }
                }
                _ => rounded(R::rational(value, constants), f64::NEG_INFINITY),
            }),
            Node::Pi => Some(rounded(R::pi(constants), f64::NEG_INFINITY)),
            Node::Add(terms) => {
                let mut sum = at(&terms[0])?.clone();
                for term in &terms[1..] {
                    let term = at(term)?;
                    let error = both(sum.error, term.error);
                    sum = rounded(sum.value.add(&term.value), error);
                }
                Some(sum)
            }
            Node::Mul(factors) => {
                let mut product = at(&factors[0])?.clone();
                for factor in &factors[1..] {
                    product = times(&product, at(factor)?);
                }
                Some(product)
            }
            Node::Pow(base, n) => self.power(at(base)?, self.pool.is_number(*n), at(n)?, constants),
            Node::Call(f, x) => self.call(*f, at(&x[0])?, x.get(1).map(at), constants),
            Node::Compare(c, a, b) => compare(*c, at(a)?, at(b)?, constants),
            Node::Select(c, a, b) => {
                if truth(at(c)?)? {
                    at(a).cloned()
                } else {
                    at(b).cloned()
                }
            }
            Node::And(a, b) => Some(logical(truth(at(a)?)? && truth(at(b)?)?, constants)),
            Node::Or(a, b) => Some(logical(truth(at(a)?)? || truth(at(b)?)?, constants)),
            Node::Not(a) => Some(logical(!truth(at(a)?)?, constants)),
            Node::Whole(a) => at(a).cloned(),
            Node::Symbol(_) | Node::Table(..) | Node::TableSlope(..) => None,
        }
    }

    fn power<R: Real>(
        &self,
        base: &Approximate<R>,
        exact: Option<&Rational>,
        n: &Approximate<R>,
        constants: &mut Consts,
    ) -> Option<Approximate<R>> {
        if let Some(whole) = exact.and_then(|n| n.as_integer()).filter(|n| n.abs() <= 64) {
            let mut power = Approximate { value: R::rational(&Rational::from(1), constants), error: f64::NEG_INFINITY };
            for _ in 0..whole.abs() {
                power = times(&power, base);
            }
            return if whole < 0 { inverse(&power) } else { Some(power) };
        }
        let size = base.value.size();
        if base.value.negative() || size <= base.error + 1.0 {
            return None;
        }
        let value = base.value.pow(&n.value, constants);
        // d(b^n) = b^n (n db/b + log b dn)
        let relative = both(n.value.size() + base.error - size, math::log2(size.abs() + 1.0) + n.error);
        let relative = both(relative, math::log2(size.abs() + 1.0) + n.value.size() - R::BITS);
        let error = value.size() + relative;
        Some(rounded(value, error))
    }

    fn call<R: Real>(
        &self,
        f: Function,
        x: &Approximate<R>,
        y: Option<Option<&Approximate<R>>>,
        constants: &mut Consts,
    ) -> Option<Approximate<R>> {
        use Function::*;
        if let Some(y) = y {
            let (first, y) = (compare(Comparison::Lt, x, y?, constants).and_then(|c| truth(&c))?, y?);
            return match f {
                Min => Some(if first { x.clone() } else { y.clone() }),
                Max => Some(if first { y.clone() } else { x.clone() }),
                _ => None,
            };
        }
        if f == Sign {
            let zero = Approximate { value: R::rational(&Rational::from(0), constants), error: f64::NEG_INFINITY };
            let below = truth(&compare(Comparison::Lt, x, &zero, constants)?)?;
            let value = R::rational(&Rational::from(if below { -1 } else { 1 }), constants);
            return Some(Approximate { value, error: f64::NEG_INFINITY });
        }
        let value = x.value.call(f, constants);
        let size = x.value.size();
        let doubtful = size <= x.error + 1.0;
        let slope = match f {
            Sin | Cos | Atan | Tanh | Abs => 0.0,
            Exp | Sinh | Cosh => x.value.call(Cosh, constants).size() + 1.0,
            Log | Log10 | Sqrt if doubtful || x.value.negative() => return None,
            Log | Log10 => -size,
            Sqrt => value.size() - size,
            Tan => 2.0 * value.size().max(0.0) + 2.0,
            Asin | Acos => {
                let rest = R::rational(&Rational::from(1), constants).add(&times_minus_one(x, constants).mul(&x.value));
                if rest.negative() || rest.size() <= x.error + 2.0 {
                    return None;
                }
                -rest.size() / 2.0 + 1.0
            }
            _ => return None,
        };
        let error = x.error + slope;
        Some(rounded(value, error))
    }
}

fn times_minus_one<R: Real>(x: &Approximate<R>, constants: &mut Consts) -> R {
    x.value.mul(&R::rational(&Rational::from(-1), constants))
}

/// The logarithm of the sum of two bounds.
fn both(a: f64, b: f64) -> f64 {
    let (greater, less) = (a.max(b), a.min(b));
    // 2^x is no more than the straight line between two whole x.
    match less - greater {
        _ if greater == f64::NEG_INFINITY || less == f64::NEG_INFINITY => greater,
        apart if apart < -40.0 => greater + 1e-11,
        apart => {
            greater
                + math::log2(1.0 + math::whole_power(0.5, -apart.floor() as i64) * (1.0 + apart - apart.floor()))
                + 1e-13
        }
    }
}

/// With the error of one more rounding.
fn rounded<R: Real>(value: R, error: f64) -> Approximate<R> {
    let error = both(error, value.size() - R::BITS);
    Approximate { value, error }
}

fn times<R: Real>(a: &Approximate<R>, b: &Approximate<R>) -> Approximate<R> {
    let error = both(both(a.value.size() + b.error, b.value.size() + a.error), a.error + b.error);
    rounded(a.value.mul(&b.value), if error.is_nan() { f64::NEG_INFINITY } else { error })
}

fn inverse<R: Real>(x: &Approximate<R>) -> Option<Approximate<R>> {
    let size = x.value.size();
    if size <= x.error + 1.0 {
        return None;
    }
    Some(rounded(x.value.recip(), x.error - 2.0 * size + 1.0))
}

fn logical<R: Real>(value: bool, constants: &mut Consts) -> Approximate<R> {
    let value = R::rational(&Rational::from(i64::from(value)), constants);
    Approximate { value, error: f64::NEG_INFINITY }
}

fn truth<R: Real>(x: &Approximate<R>) -> Option<bool> {
    let size = x.value.size();
    if size > x.error { Some(true) } else { (x.error == f64::NEG_INFINITY).then_some(false) }
}

/// Unknown where the two are too close.
fn compare<R: Real>(
    c: Comparison,
    a: &Approximate<R>,
    b: &Approximate<R>,
    constants: &mut Consts,
) -> Option<Approximate<R>> {
    let difference = a.value.add(&times_minus_one(b, constants));
    let error = both(a.error, b.error);
    let sign: i32 = match difference.size() {
        size if size > error.max(difference.size() - R::BITS) => {
            if difference.negative() {
                -1
            } else {
                1
            }
        }
        _ if error == f64::NEG_INFINITY => 0,
        _ => return None,
    };
    Some(logical(c.holds(&sign, &0), constants))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bounds are bounds, and give little away.
    #[test]
    fn bounds_of_sums_are_tight() {
        for a in [-300.0f64, -1.3, 0.0, 57.2] {
            for apart in [0.0f64, 0.1, 0.5, 1.0, 2.7, 30.5, 39.9, 55.0] {
                let exact = a + math::log2(1.0 + math::pow(2.0, -apart));
                let bound = both(a, a - apart);
                assert!(bound >= exact && bound < exact + 0.09, "{a} and {apart} below: {bound} for {exact}");
                assert_eq!(bound, both(a - apart, a));
            }
            assert_eq!(both(a, f64::NEG_INFINITY), a);
        }
    }

    /// What a hundred turned bodies in a row make of each other is told by few digits.
    #[test]
    fn errors_grow_as_they_do_along_a_chain() {
        let mut x = Exprs::default();
        let [mut along, mut across] = [super::super::ONE, super::super::ZERO];
        for k in 0..100 {
            let angle = x.symbol(&format!("q{k}"), Default::default());
            let angle = x.sym(angle);
            let [sine, cosine] = [Function::Sin, Function::Cos].map(|f| x.call(f, &[angle]));
            let (a, b) = (x.mul(&[cosine, along]), x.mul(&[sine, across]));
            let (c, d) = (x.mul(&[sine, along]), x.mul(&[cosine, across]));
            let (next, aside) = (x.sub(a, b), x.add(&[c, d]));
            (along, across) = (x.whole(next), x.whole(aside));
        }
        let mut constants = Consts::new().expect("there is memory");
        let verdicts = (0..4).map(|number| {
            let point = Point { pool: &x, number, given: false };
            point.verdict::<f64>(along, &mut Values::default(), &mut constants)
        });
        assert!(verdicts.filter(|v| *v == Verdict::Nonzero).count() >= 3);
    }
}
