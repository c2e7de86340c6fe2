//! What is written where, before any style: fractions, signs and the order of terms and factors.

use super::super::exprs::Exprs;
use super::super::node::{Comparison, Expr, Function, Node, Symbol};
use super::super::rational::Rational;
use super::super::symbols::dotted;
use super::names::{Names, Place, Sort};

/// A formula as it is laid out.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Shape {
    /// A number of 0 or more.
    Number(Rational),
    Pi,
    Name(Symbol),
    /// Terms, each with whether it is subtracted.
    Sum(Vec<(bool, Shape)>),
    /// What stands above and below the bar; either may be empty.
    Product(Vec<Shape>, Vec<Shape>),
    /// Something with a minus in front.
    Minus(Box<Shape>),
    Power(Box<Shape>, Box<Shape>),
    Root(Box<Shape>),
    Call(&'static str, Vec<Shape>),
    Abs(Box<Shape>),
    Table(String, Box<Shape>),
    Relation(Comparison, Box<Shape>, Box<Shape>),
    And(Box<Shape>, Box<Shape>),
    Or(Box<Shape>, Box<Shape>),
    Not(Box<Shape>),
    Choice(Box<Shape>, Box<Shape>, Box<Shape>),
    LeftOut,
}

const DEEPEST: usize = 200;
const LONGEST: usize = 20_000;

/// Parts that come after so many are left out; of all expressions those after [`LONGEST`].
pub(super) fn shape(x: &Exprs, e: Expr, names: &dyn Names, most: usize) -> Shape {
    Shaper { x, names, depth: 0, parts: 0, most: most.min(LONGEST) }.shape(e)
}

struct Shaper<'a> {
    x: &'a Exprs,
    names: &'a dyn Names,
    depth: usize,
    parts: usize,
    most: usize,
}

/// A factor: base and exponent.
type Factor = (Expr, Rational);

impl Shaper<'_> {
    fn shape(&mut self, e: Expr) -> Shape {
        self.parts += 1;
        if self.depth > DEEPEST || self.parts > self.most {
            return Shape::LeftOut;
        }
        self.depth += 1;
        let (negative, shape) = self.signed(e, true);
        self.depth -= 1;
        if negative { Shape::Minus(Box::new(shape)) } else { shape }
    }

    fn boxed(&mut self, e: Expr) -> Box<Shape> {
        Box::new(self.shape(e))
    }

    /// Whether there is a minus in front, and what stands behind it. `alone`: nothing stands in front of the minus, so
    /// that a sum inside had better take it over.
    fn signed(&mut self, e: Expr, alone: bool) -> (bool, Shape) {
        let shape = match self.x.node(e) {
            Node::Number(value) => return self.number(value),
            Node::Pi => Shape::Pi,
            Node::Symbol(s) => Shape::Name(*s),
            Node::Add(terms) => Shape::Sum(self.terms(terms, false)),
            Node::Mul(_) | Node::Pow(..) => return self.product(e, alone),
            Node::Call(Function::Abs, x) => Shape::Abs(self.boxed(x[0])),
            Node::Call(f, x) => Shape::Call(f.name(), x.iter().map(|&a| self.shape(a)).collect()),
            Node::Compare(c, a, b) => self.relation(*c, *a, *b),
            Node::And(a, b) => Shape::And(self.boxed(*a), self.boxed(*b)),
            Node::Or(a, b) => Shape::Or(self.boxed(*a), self.boxed(*b)),
            Node::Not(a) => Shape::Not(self.boxed(*a)),
            Node::Select(c, a, b) => Shape::Choice(self.boxed(*c), self.boxed(*a), self.boxed(*b)),
            Node::Table(t, a) => Shape::Table(self.names.table(*t), self.boxed(*a)),
            Node::TableSlope(t, a) => Shape::Table(dotted(&self.names.table(*t), 1), self.boxed(*a)),
            Node::Whole(part) => return self.signed(*part, alone),
        };
        (false, shape)
    }

    fn number(&self, value: &Rational) -> (bool, Shape) {
        let size = value.abs();
        let shape = if super::numbers::decimal(&size, false).is_some() {
            Shape::Number(size)
        } else {
            let part = |n: dashu_int::IBig| Shape::Number(Rational::from_big(n.into()));
            Shape::Product(vec![part(size.numerator())], vec![part(size.denominator())])
        };
        (value.signum() < 0, shape)
    }

    /// `0 < x` reads `x > 0`.
    fn relation(&mut self, c: Comparison, a: Expr, b: Expr) -> Shape {
        let turned = match c {
            Comparison::Lt => Comparison::Gt,
            Comparison::Le => Comparison::Ge,
            Comparison::Gt => Comparison::Lt,
            Comparison::Ge => Comparison::Le,
            same => same,
        };
        if self.x.is_constant(a) && !self.x.is_constant(b) {
            return Shape::Relation(turned, self.boxed(b), self.boxed(a));
        }
        Shape::Relation(c, self.boxed(a), self.boxed(b))
    }

    /// The terms of a sum in human order: what is given first if it is added and last if it is subtracted, else by the
    /// variable that stands in it; a positive one first.
    fn terms(&mut self, terms: &[Expr], negated: bool) -> Vec<(bool, Shape)> {
        let mut shaped: Vec<(TermPlace, Expr, bool, Shape)> = Vec::with_capacity(terms.len());
        let varies = terms.iter().any(|&t| self.varies(t));
        for &term in terms {
            self.parts += 1;
            if self.parts > self.most {
                let last = TermPlace { end: 2, sort: Some(Sort::Rate), family: u8::MAX, index: u32::MAX };
                shaped.push((last, term, false, Shape::LeftOut));
                break;
            }
            self.depth += 1;
            let (negative, shape) =
                if self.depth > DEEPEST { (false, Shape::LeftOut) } else { self.signed(term, false) };
            self.depth -= 1;
            let negative = negative != negated;
            let mut place = self.term_place(term);
            if self.x.is_number(term).is_some() || varies && place.sort <= Some(Sort::Given) {
                place.end = if negative { 2 } else { 0 };
            }
            shaped.push((place, term, negative, shape));
        }
        shaped.sort_by_key(|t| t.0);
        match shaped.iter().position(|t| !t.2) {
            Some(first) => shaped[..=first].rotate_right(1),
            None => self.without_first_minus(&mut shaped, negated),
        }
        shaped.into_iter().map(|(_, _, negative, shape)| (negative, shape)).collect()
    }

    /// If all terms have a minus in front, one may have a sum in it that takes it over.
    fn without_first_minus(&mut self, shaped: &mut [(TermPlace, Expr, bool, Shape)], negated: bool) {
        for i in 0..shaped.len() {
            let (negative, shape) = self.signed(shaped[i].1, !negated);
            if negative == negated {
                (shaped[i].2, shaped[i].3) = (false, shape);
                return shaped[..=i].rotate_right(1);
            }
        }
    }

    fn varies(&self, e: Expr) -> bool {
        self.x.depends_on_any(e, &|s| self.names.place(s).sort != Sort::Parameter)
    }

    /// By the rate in it, else by the variable that comes first, else by the given, else by the parameter.
    fn term_place(&self, term: Expr) -> TermPlace {
        let place = |s: &Symbol| {
            let place = self.names.place(*s);
            let family = if place.sort == Sort::Parameter { 0 } else { place.family.saturating_sub(1) };
            (std::cmp::Reverse(place.sort), family, place.term)
        };
        let found = self.x.symbols_of(term).iter().map(place).min();
        match found {
            Some((sort, family, index)) => TermPlace { end: 1, sort: Some(sort.0), family, index },
            None => TermPlace { end: 1, sort: None, family: 0, index: 0 },
        }
    }

    fn product(&mut self, e: Expr, alone: bool) -> (bool, Shape) {
        let (mut number, mut factors, mut others) = (Rational::from(1), Vec::new(), Vec::new());
        let parts = match self.x.node(e) {
            Node::Mul(parts) => parts.as_slice(),
            _ => &[e],
        };
        for &part in parts {
            match self.x.node(part) {
                Node::Number(value) => number = value.clone(),
                Node::Pow(base, n) => match self.x.is_number(*n) {
                    Some(n) => factors.push((*base, n.clone())),
                    None => others.push((*base, *n)),
                },
                _ => factors.push((part, Rational::from(1))),
            }
        }
        factors.sort_by_key(|f| self.factor_place(f));
        let mut turned: Vec<bool> = factors.iter().map(|f| f.1.is_integer() && self.reads_better_turned(f.0)).collect();
        let odd = |f: &Factor| f.1.as_integer().is_some_and(|n| n % 2 != 0);
        let mut negative = number.signum() < 0;
        negative ^= factors.iter().zip(&turned).filter(|(f, turned)| **turned && odd(f)).count() % 2 == 1;
        if negative && alone {
            // A sum above the bar rather than one of parameters below.
            let takes = |above: bool| {
                (0..factors.len()).find(|&i| {
                    let f: &Factor = &factors[i];
                    let place = if above { f.1.signum() > 0 } else { f.1.signum() < 0 && !self.varies(f.0) };
                    place && odd(f) && self.takes_minus(f.0, turned[i])
                })
            };
            if let Some(i) = takes(true).or_else(|| takes(false)) {
                turned[i] = !turned[i];
                negative = false;
            }
        }
        let (mut above, mut below) = number_parts(&number.abs());
        for ((base, n), turned) in factors.into_iter().zip(turned) {
            let side = if n.signum() < 0 { &mut below } else { &mut above };
            let base_shape = match self.x.node(base) {
                Node::Add(terms) if turned => Shape::Sum(self.terms(terms, true)),
                _ => self.shape(base),
            };
            side.push(power(base_shape, &n.abs()));
        }
        for (base, n) in others {
            above.push(Shape::Power(self.boxed(base), self.boxed(n)));
        }
        let shape = match (&mut above[..], &below[..]) {
            ([_], []) => above.remove(0),
            _ => Shape::Product(above, below),
        };
        (negative, shape)
    }

    /// Whether a sum reads better with all signs turned: its first term would then be positive, `x0 - q` for `q - x0`.
    fn reads_better_turned(&self, e: Expr) -> bool {
        let Node::Add(terms) = self.x.node(e) else { return false };
        if self.x.entry(e).size as usize > LONGEST {
            return false;
        }
        let first = |&&t: &&Expr| {
            let place = self.term_place(t);
            (place.sort.is_none(), place)
        };
        terms.iter().min_by_key(first).is_some_and(|&t| self.has_minus(t))
    }

    /// Whether a sum can take over the minus in front of it: `-(a - b)` reads `b - a`.
    fn takes_minus(&self, e: Expr, turned: bool) -> bool {
        let Node::Add(terms) = self.x.node(e) else { return false };
        let minus = terms.iter().filter(|&&t| self.has_minus(t) != turned).count();
        3 * minus >= terms.len()
    }

    /// Whether a term has a minus in front when the sums in it are as they read best.
    fn has_minus(&self, term: Expr) -> bool {
        let (number, rest) = self.x.coefficient(term);
        let factors = match self.x.node(rest) {
            Node::Mul(factors) => factors.as_slice(),
            _ => &[rest],
        };
        let turns = |&&f: &&Expr| match *self.x.node(f) {
            Node::Pow(base, n) => {
                let odd = self.x.is_number(n).and_then(|n| n.as_integer()).is_some_and(|n| n % 2 != 0);
                odd && self.reads_better_turned(base)
            }
            _ => self.reads_better_turned(f),
        };
        (number.signum() < 0) != (factors.iter().filter(turns).count() % 2 == 1)
    }

    /// Numbers, parameters, what is given, what varies, sums, functions, rates. A sum of parameters stands behind those
    /// of its family.
    fn factor_place(&self, factor: &Factor) -> FactorPlace {
        let symbols = || self.x.symbols_of(factor.0).into_iter().map(|s| self.names.place(s));
        let (rank, place) = match self.x.node(factor.0) {
            Node::Number(_) | Node::Pi => (0, None),
            Node::Symbol(s) => match self.names.place(*s) {
                place if place.sort == Sort::Parameter => (1, Some(place)),
                place if place.sort == Sort::Rate => (6, Some(place)),
                place => (3, Some(place)),
            },
            Node::Add(_) if symbols().any(|p| p.sort == Sort::Rate) => (6, symbols().max()),
            Node::Add(_) if self.varies(factor.0) => (4, symbols().max()),
            Node::Add(terms) if terms.iter().all(|&t| self.is_plain(t)) => {
                return FactorPlace {
                    rank: 1,
                    family: symbols().map(|p| p.family).min(),
                    sum: true,
                    place: symbols().min(),
                };
            }
            _ if !self.varies(factor.0) => (2, symbols().min()),
            Node::Call(..) => (5, None),
            _ => (4, None),
        };
        FactorPlace { rank, family: place.map(|p| p.family), sum: false, place }
    }

    /// A number times a symbol, or a number.
    fn is_plain(&self, e: Expr) -> bool {
        let (_, rest) = self.x.coefficient(e);
        matches!(self.x.node(rest), Node::Symbol(_) | Node::Number(_))
    }
}

/// Where a factor stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct FactorPlace {
    rank: u8,
    family: Option<u8>,
    sum: bool,
    place: Option<Place>,
}

/// Where a term stands: at the front (0), in the middle (1), at the end (2); then by what it reads.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct TermPlace {
    end: u8,
    sort: Option<Sort>,
    family: u8,
    index: u32,
}

/// A coefficient as what it puts above and below the bar: 1/2 goes below, 1.5 above.
fn number_parts(value: &Rational) -> (Vec<Shape>, Vec<Shape>) {
    let part = |n: dashu_int::IBig| {
        let n = Rational::from_big(n.into());
        if n.is_one() { Vec::new() } else { vec![Shape::Number(n)] }
    };
    let unit = value.small().is_some_and(|(n, d)| n == 1 && d < 10);
    if unit || super::numbers::decimal(value, false).is_none() {
        return (part(value.numerator()), part(value.denominator()));
    }
    if value.is_one() { (Vec::new(), Vec::new()) } else { (vec![Shape::Number(value.clone())], Vec::new()) }
}

fn power(base: Shape, n: &Rational) -> Shape {
    match n.small() {
        Some((1, 1)) => base,
        Some((1, 2)) => Shape::Root(Box::new(base)),
        _ => {
            let exponent = if super::numbers::decimal(n, false).is_some() {
                Shape::Number(n.clone())
            } else {
                let (above, below) = number_parts(n);
                Shape::Product(above, below)
            };
            Shape::Power(Box::new(base), Box::new(exponent))
        }
    }
}
