//! Values at random points of a prime field: the fast half of the zero test.
//!
//! Four lanes: two in which every symbol is random, two in which parameters have their given values. What a lane
//! holds is a homomorphism as far as it goes, so that equal expressions have equal fingerprints; where it does not
//! go (a logarithm of a product), equal arguments still give equal values.

use super::exprs::{Exprs, comparison_tag, function_tag};
use super::field::{self, P, Point};
use super::node::{Expr, Function, Node, Symbol};
use super::rational::Rational;

/// One value a lane.
pub(super) type Fingerprint = [u64; LANES];

pub(super) const LANES: usize = 4;
/// The lanes in which parameters are as random as everything else.
pub(super) const GENERIC: std::ops::Range<usize> = 0..2;
/// The lanes in which parameters have their given values.
pub(super) const GIVEN: std::ops::Range<usize> = 2..4;
/// Where the lane is undefined: something was divided by zero.
pub(super) const POISON: u64 = u64::MAX;

/// Halvings of an angle that stay exact.
const HALVINGS: u32 = 8;
/// Exponents with denominators that divide this stay exact.
const PARTS: i64 = 2520;

/// A 64-bit mix of two values.
pub fn mix(a: u64, b: u64) -> u64 {
    let mut z = (a.rotate_left(23) ^ b).wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// A hash that leads to places of a table near those of others that are made of parts with numbers like these: large models are
/// gone through cell by cell, and memory far away takes longer than all else. What has a part in common with many others is
/// near those alone whose other parts are near its own. `parts` visits them; what has none is anywhere.
pub fn near(hash: u64, parts: impl FnOnce(&mut dyn FnMut(u32))) -> u64 {
    const ALIKE: u32 = 6;
    const WINDOW: u64 = 127;
    let mut block = None;
    parts(&mut |part| block = Some(mix(block.unwrap_or(0x10ca1), u64::from(part >> ALIKE))));
    block.map_or(hash, |block| hash & !0xFFFF_FFFF | (block & !WINDOW | hash & WINDOW) & 0xFFFF_FFFF)
}

/// A number between 1 and 2, as good as random and the same for the same two values.
pub fn scattered(a: u64, b: u64) -> f64 {
    f64::from_bits(1.0f64.to_bits() | (mix(a, b) >> 12))
}

/// A random element other than 0, the same for the same key.
pub fn random(lane: usize, key: u64) -> u64 {
    1 + mix(lane as u64 + 0x1a9e, key) % (P - 1)
}

impl Exprs {
    pub(super) fn fingerprint(&self, e: Expr) -> &Fingerprint {
        &self.entry(e).fingerprint
    }

    pub(super) fn fingerprint_of(&self, node: &Node) -> Fingerprint {
        match node {
            Node::Number(value) => [residue(value).unwrap_or(POISON); LANES],
            Node::Pow(base, n) => match self.is_number(*n).and_then(|n| n.as_integer()) {
                Some(n) if n < 0 => inverses(self.fingerprint(*base).map(|v| whole_power(v, n.unsigned_abs()))),
                _ => self.lanes(node),
            },
            _ => self.lanes(node),
        }
    }

    fn lanes(&self, node: &Node) -> Fingerprint {
        let joined = |parts: &[Expr], start: u64, join: fn(u64, u64) -> u64| {
            parts.iter().fold([start; LANES], |all, &part| {
                let more = self.fingerprint(part);
                std::array::from_fn(|lane| match (all[lane], more[lane]) {
                    (POISON, _) | (_, POISON) => POISON,
                    (a, b) => join(a, b),
                })
            })
        };
        match node {
            Node::Add(terms) => joined(terms, 0, field::add),
            Node::Mul(factors) => joined(factors, 1, field::mul),
            Node::Symbol(symbol) => self.lanes_of_symbol(*symbol),
            _ => std::array::from_fn(|lane| self.lane(node, lane).unwrap_or(POISON)),
        }
    }

    fn at(&self, e: Expr, lane: usize) -> Option<u64> {
        Some(self.fingerprint(e)[lane]).filter(|&v| v != POISON)
    }

    fn lane(&self, node: &Node, lane: usize) -> Option<u64> {
        match node {
            Node::Number(value) => residue(value),
            Node::Pi => Some(random(lane, 0x3141)),
            Node::Symbol(_) | Node::Add(_) | Node::Mul(_) => Some(self.lanes(node)[lane]).filter(|&v| v != POISON),
            Node::Pow(base, n) => self.lane_of_power(*base, *n, lane),
            Node::Call(f, x) => self.lane_of_call(*f, x, lane),
            Node::Compare(c, a, b) => {
                Some(random(lane, mix(mix(comparison_tag(*c), self.at(*a, lane)?), self.at(*b, lane)?)))
            }
            Node::And(a, b) => Some(field::mul(self.at(*a, lane)?, self.at(*b, lane)?)),
            Node::Or(a, b) => {
                let (a, b) = (self.at(*a, lane)?, self.at(*b, lane)?);
                Some(field::sub(field::add(a, b), field::mul(a, b)))
            }
            Node::Not(a) => Some(field::sub(1, self.at(*a, lane)?)),
            Node::Select(c, a, b) => {
                let (c, a, b) = (self.at(*c, lane)?, self.at(*a, lane)?, self.at(*b, lane)?);
                Some(field::add(b, field::mul(c, field::sub(a, b))))
            }
            Node::Table(t, x) => Some(random(lane, mix(0x7ab + u64::from(t.0), self.at(*x, lane)?))),
            Node::TableSlope(t, x) => Some(random(lane, mix(!u64::from(t.0), self.at(*x, lane)?))),
            Node::Whole(a) => self.at(*a, lane),
        }
    }

    fn lanes_of_symbol(&self, symbol: Symbol) -> Fingerprint {
        let facts = self.facts(symbol);
        let key = self.label(symbol).bytes().fold(0x51, |h, b| mix(h, u64::from(b)));
        std::array::from_fn(|lane| match facts.given {
            Some(given) if GIVEN.contains(&lane) => self.fingerprint(given)[lane],
            _ if facts.positive => field::pow(random(lane, key), field::INTO_ROOTED),
            _ => random(lane, key),
        })
    }

    fn lane_of_power(&self, base: Expr, n: Expr, lane: usize) -> Option<u64> {
        let value = self.at(base, lane)?;
        if let Some(exponent) = self.is_number(n) {
            return power(value, exponent, lane);
        }
        if value == 0 {
            return None;
        }
        self.exponential(n, lane, Some(value), &|term| random(lane, mix(mix(0xba5e, value), term)))
    }

    fn lane_of_call(&self, f: Function, x: &[Expr], lane: usize) -> Option<u64> {
        use Function::*;
        let value = self.at(x[0], lane)?;
        let opaque = |value: u64| random(lane, mix(function_tag(f), value));
        let even = |value: u64| opaque(value.min(field::neg(value)));
        let odd = |value: u64| if value <= P / 2 { opaque(value) } else { field::neg(opaque(field::neg(value))) };
        let exp = || self.exponential(x[0], lane, None, &|term| random(lane, mix(0xe4b, term)));
        let point = || self.point(x[0], lane);
        let half = field::pow(2, P - 2);
        Some(match f {
            Sin => point()?.sin,
            Cos => point()?.cos,
            Tan => {
                let point = point()?;
                field::mul(point.sin, field::inverse(point.cos)?)
            }
            Exp => exp()?,
            Sinh => {
                let e = exp()?;
                field::mul(half, field::sub(e, field::inverse(e)?))
            }
            Cosh => {
                let e = exp()?;
                field::mul(half, field::add(e, field::inverse(e)?))
            }
            Tanh => {
                let square = field::pow(exp()?, 2);
                field::mul(field::sub(square, 1), field::inverse(field::add(square, 1))?)
            }
            Log | Log10 if value == 1 => 0,
            Asin | Atan | Abs | Sign | Floor if value == 0 => 0,
            Atan2 | Min | Max | Mod => opaque(mix(value, self.at(x[1], lane)?)),
            Sqrt => return power(value, &Rational::new(1, 2), lane),
            Abs => even(value),
            Asin | Atan | Sign => odd(value),
            Acos | Log | Log10 | Floor => opaque(value),
        })
    }

    /// The point of an angle: a sum of terms, each a number times an angle of its own.
    fn point(&self, angle: Expr, lane: usize) -> Option<Point> {
        let mut sum = Point::START;
        for (number, term) in self.terms(angle) {
            sum = sum.plus(self.point_of_term(&number, term, lane)?);
        }
        Some(sum)
    }

    fn point_of_term(&self, number: &Rational, term: Expr, lane: usize) -> Option<Point> {
        if *self.node(term) == Node::Pi {
            return point_of_turns(number);
        }
        let value = self.at(term, lane)?;
        if value == 0 {
            return Some(Point::START);
        }
        let of = |value| Point::of_half_angle(random(lane, mix(0xa791e, value)));
        Some(match circle_exponent(number) {
            Some(n) => of(value).times(n),
            None => of(field::mul(value, residue(number)?)).times(1 << HALVINGS),
        })
    }

    /// The product over the terms of an exponent; `base` gives for the value of a term the 2520th part of its
    /// exponential, `unit` the exponential of 1 if it has a value already.
    fn exponential(&self, exponent: Expr, lane: usize, unit: Option<u64>, base: &dyn Fn(u64) -> u64) -> Option<u64> {
        let mut product = 1;
        for (number, term) in self.terms(exponent) {
            let value = self.at(term, lane)?;
            let factor = match (unit, group_exponent(&number)) {
                _ if value == 0 => 1,
                (Some(unit), _) if term == super::ONE => power(unit, &number, lane)?,
                (_, Some(n)) => field::pow(base(value), n),
                (_, None) => field::pow(base(field::mul(value, residue(&number)?)), PARTS as u64),
            };
            product = field::mul(product, factor);
        }
        Some(product)
    }

    /// The terms of a sum, each as a number and what it multiplies; a lone number multiplies 1.
    pub(super) fn terms(&self, e: Expr) -> Vec<(Rational, Expr)> {
        match self.node(e) {
            Node::Add(terms) => terms.iter().map(|&t| self.coefficient(t)).collect(),
            _ => vec![self.coefficient(e)],
        }
    }

    /// The expression as a number and what it multiplies; a number multiplies 1.
    pub(super) fn coefficient(&self, e: Expr) -> (Rational, Expr) {
        match self.node(e) {
            Node::Number(value) => (value.clone(), super::ONE),
            Node::Mul(factors) => match self.is_number(factors[0]) {
                Some(value) => (value.clone(), self.entry(e).monomial),
                None => (Rational::from(1), e),
            },
            _ => (Rational::from(1), e),
        }
    }

    /// Whether a node makes a nonzero fingerprint doubtful: [generic, at the given parameters].
    pub(super) fn opaque_of(&self, node: &Node) -> [bool; 2] {
        use Function::*;
        match node {
            Node::Call(Sin | Cos | Tan | Exp | Sinh | Cosh | Tanh, x) => {
                let terms = self.terms(x[0]);
                [false, true].map(|given| !terms.iter().all(|(n, t)| self.is_free(n, *t, given)))
            }
            Node::Call(..) | Node::Compare(..) | Node::Table(..) | Node::TableSlope(..) => [true; 2],
            Node::And(..) | Node::Or(..) | Node::Not(_) | Node::Select(..) => [true; 2],
            Node::Pow(_, n) => [self.is_number(*n).is_none_or(|n| !n.is_integer()); 2],
            _ => [false; 2],
        }
    }

    /// Whether a term of an angle or exponent is independent of all others.
    fn is_free(&self, number: &Rational, term: Expr, given: bool) -> bool {
        let exact = number.denominator() <= dashu_int::IBig::from(8);
        match self.node(term) {
            Node::Symbol(s) => exact && !(given && self.facts(*s).given.is_some()),
            Node::Pi => point_of_turns(number).is_some(),
            _ => false,
        }
    }
}

/// The number in the field; `None` if its denominator is a multiple of the prime.
fn residue(value: &Rational) -> Option<u64> {
    let fit = |n: i64| if n < 0 { field::neg(n.unsigned_abs() % P) } else { n as u64 % P };
    let (n, d) = match value.small() {
        Some((n, 1)) => return Some(fit(n)),
        Some((n, d)) => (fit(n), fit(d)),
        None => {
            let fit = |n: dashu_int::IBig| {
                let (sign, size) = n.into_parts();
                let rest = size % P;
                if sign == dashu_base::Sign::Negative { field::neg(rest) } else { rest }
            };
            (fit(value.numerator()), fit(value.denominator()))
        }
    };
    Some(field::mul(n, field::inverse(d)?))
}

fn whole_power(value: u64, n: u64) -> u64 {
    if value == POISON { POISON } else { field::pow(value, n) }
}

/// The inverses of all lanes by one inversion.
fn inverses(values: Fingerprint) -> Fingerprint {
    let usable = |v: u64| v != POISON && v != 0;
    let mut before = [1; LANES];
    let mut product = 1;
    for (lane, &value) in values.iter().enumerate() {
        before[lane] = product;
        if usable(value) {
            product = field::mul(product, value);
        }
    }
    let mut inverse = field::inverse(product).unwrap_or(1);
    let mut result = [POISON; LANES];
    for (lane, &value) in values.iter().enumerate().rev() {
        if usable(value) {
            result[lane] = field::mul(inverse, before[lane]);
            inverse = field::mul(inverse, value);
        }
    }
    result
}

fn power(value: u64, exponent: &Rational, lane: usize) -> Option<u64> {
    let (n, d) = match exponent.small() {
        Some(parts) => parts,
        None => return Some(random(lane, mix(value, residue(exponent)?))),
    };
    let root = match d {
        1 => value,
        _ if value <= 1 => value,
        _ => field::root(value, d as u64)
            .or_else(|| if d == 2 { field::square_root(value) } else { None })
            .unwrap_or_else(|| random(lane, mix(mix(0x4007, value), d as u64))),
    };
    let size = field::pow(root, n.unsigned_abs());
    if n < 0 { field::inverse(size) } else { Some(size) }
}

/// How many times the 256th part of an angle is taken.
fn circle_exponent(number: &Rational) -> Option<u64> {
    const ORDER: u64 = 1 << 61;
    let (n, d) = number.small()?;
    let halvings = d.trailing_zeros();
    if halvings > HALVINGS {
        return None;
    }
    let odd = field::inverse_modulo((d >> halvings) as u64, ORDER)?;
    let times = i128::from(n).rem_euclid(i128::from(ORDER)) as u64;
    Some(times.wrapping_mul(odd).wrapping_mul(1 << (HALVINGS - halvings)) % ORDER)
}

/// The angle `number * pi`; roots of unity of odd order are not in the field.
fn point_of_turns(number: &Rational) -> Option<Point> {
    let (n, d) = number.small()?;
    let halvings = d.trailing_zeros();
    if d != 1 << halvings || halvings > HALVINGS {
        return None;
    }
    Some(Point::half_turn_over(halvings).times(n.rem_euclid(2 * d) as u64))
}

/// How many times the 2520th part of an exponent is taken.
fn group_exponent(number: &Rational) -> Option<u64> {
    let (n, d) = number.small()?;
    if PARTS % d != 0 {
        return None;
    }
    Some((i128::from(n) * i128::from(PARTS / d)).rem_euclid(i128::from(P - 1)) as u64)
}
