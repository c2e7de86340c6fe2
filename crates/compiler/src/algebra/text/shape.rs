//! What is written where, before any style: fractions, signs and the order of terms and factors.

use super::super::exprs::Exprs;
use super::super::node::{Comparison, Expr, Function, Node, Symbol};
use super::super::rational::Rational;
use super::names::Names;

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

pub(super) fn shape(x: &Exprs, e: Expr, names: &dyn Names) -> Shape {
    Shaper { x, names, depth: 0, parts: 0 }.shape(e)
}

struct Shaper<'a> {
    x: &'a Exprs,
    names: &'a dyn Names,
    depth: usize,
    parts: usize,
}

/// A factor: base and exponent.
type Factor = (Expr, Rational);

impl Shaper<'_> {
    fn shape(&mut self, e: Expr) -> Shape {
        self.parts += 1;
        if self.depth > DEEPEST || self.parts > LONGEST {
            return Shape::LeftOut;
        }
        self.depth += 1;
        let (negative, shape) = self.signed(e);
        self.depth -= 1;
        if negative { Shape::Minus(Box::new(shape)) } else { shape }
    }

    fn boxed(&mut self, e: Expr) -> Box<Shape> {
        Box::new(self.shape(e))
    }

    /// Whether there is a minus in front, and what stands behind it.
    fn signed(&mut self, e: Expr) -> (bool, Shape) {
        let shape = match self.x.node(e) {
            Node::Number(value) => return self.number(value),
            Node::Pi => Shape::Pi,
            Node::Symbol(s) => Shape::Name(*s),
            Node::Add(terms) => Shape::Sum(self.terms(terms, false)),
            Node::Mul(_) | Node::Pow(..) => return self.product(e),
            Node::Call(Function::Abs, x) => Shape::Abs(self.boxed(x[0])),
            Node::Call(f, x) => Shape::Call(f.name(), x.iter().map(|&a| self.shape(a)).collect()),
            Node::Compare(c, a, b) => self.relation(*c, *a, *b),
            Node::And(a, b) => Shape::And(self.boxed(*a), self.boxed(*b)),
            Node::Or(a, b) => Shape::Or(self.boxed(*a), self.boxed(*b)),
            Node::Not(a) => Shape::Not(self.boxed(*a)),
            Node::Select(c, a, b) => Shape::Choice(self.boxed(*c), self.boxed(*a), self.boxed(*b)),
            Node::Table(t, a) => Shape::Table(self.names.table(*t), self.boxed(*a)),
            Node::TableSlope(t, a) => Shape::Table(self.names.table(*t) + "'", self.boxed(*a)),
        };
        (false, shape)
    }

    fn number(&self, value: &Rational) -> (bool, Shape) {
        let size = value.abs();
        let shape = if super::numbers::decimal(&size).is_some() {
            Shape::Number(size)
        } else {
            let part = |n: num_bigint::BigInt| Shape::Number(Rational::from_big(n.into()));
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

    /// The terms of a sum in human order: the number last, a positive one first.
    fn terms(&mut self, terms: &[Expr], negated: bool) -> Vec<(bool, Shape)> {
        let mut shaped: Vec<(bool, Shape)> = Vec::with_capacity(terms.len());
        let (numbers, others): (Vec<Expr>, Vec<Expr>) = terms.iter().partition(|&&t| self.x.is_number(t).is_some());
        for term in others.into_iter().chain(numbers) {
            self.parts += 1;
            if self.parts > LONGEST {
                shaped.push((false, Shape::LeftOut));
                break;
            }
            self.depth += 1;
            let (negative, shape) = if self.depth > DEEPEST { (false, Shape::LeftOut) } else { self.signed(term) };
            self.depth -= 1;
            shaped.push((negative != negated, shape));
        }
        if let Some(first) = shaped.iter().position(|t| !t.0) {
            shaped[..=first].rotate_right(1);
        }
        shaped
    }

    fn product(&mut self, e: Expr) -> (bool, Shape) {
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
        let mut negative = number.signum() < 0;
        let flipped = if negative { self.sum_to_flip(&factors) } else { None };
        negative &= flipped.is_none();
        let (mut above, mut below) = number_parts(&number.abs());
        factors.sort_by_key(|f| self.place(f));
        for (base, n) in factors {
            let side = if n.signum() < 0 { &mut below } else { &mut above };
            let base_shape = match self.x.node(base) {
                Node::Add(terms) if flipped == Some(base) => Shape::Sum(self.terms(terms, true)),
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

    /// A sum to an odd power that takes over the minus in front: `-(a - b)` reads `b - a`.
    fn sum_to_flip(&self, factors: &[Factor]) -> Option<Expr> {
        let flips = |f: &&Factor| {
            let Node::Add(terms) = self.x.node(f.0) else { return false };
            let minus = terms.iter().filter(|&&t| self.x.coefficient(t).0.signum() < 0).count();
            f.1.as_integer().is_some_and(|n| n % 2 != 0) && 2 * minus >= terms.len()
        };
        factors.iter().find(flips).map(|f| f.0)
    }

    /// Numbers, parameters, what varies, sums, functions.
    fn place(&self, factor: &Factor) -> (u8, (u8, u32)) {
        match self.x.node(factor.0) {
            Node::Number(_) | Node::Pi => (0, (0, 0)),
            Node::Symbol(s) => (1, self.names.place(*s)),
            Node::Add(_) if self.x.depends_on_any(factor.0, &|s| self.names.place(s).0 > 0) => (2, (1, 0)),
            Node::Add(_) => (1, (0, u32::MAX)),
            Node::Call(..) => (3, (0, 0)),
            _ => (2, (0, 0)),
        }
    }
}

/// A coefficient as what it puts above and below the bar: 1/2 goes below, 1.5 above.
fn number_parts(value: &Rational) -> (Vec<Shape>, Vec<Shape>) {
    let part = |n: num_bigint::BigInt| {
        let n = Rational::from_big(n.into());
        if n.is_one() { Vec::new() } else { vec![Shape::Number(n)] }
    };
    let unit = value.small().is_some_and(|(n, d)| n == 1 && d < 10);
    if unit || super::numbers::decimal(value).is_none() {
        return (part(value.numerator()), part(value.denominator()));
    }
    if value.is_one() { (Vec::new(), Vec::new()) } else { (vec![Shape::Number(value.clone())], Vec::new()) }
}

fn power(base: Shape, n: &Rational) -> Shape {
    match n.small() {
        Some((1, 1)) => base,
        Some((1, 2)) => Shape::Root(Box::new(base)),
        _ => {
            let exponent = if super::numbers::decimal(n).is_some() {
                Shape::Number(n.clone())
            } else {
                let (above, below) = number_parts(n);
                Shape::Product(above, below)
            };
            Shape::Power(Box::new(base), Box::new(exponent))
        }
    }
}
