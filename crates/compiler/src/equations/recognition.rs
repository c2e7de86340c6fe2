//! Expressions recognised by their values.
//!
//! A linear loop is full of entries that have one value and come about in different ways: mirror images in a mass matrix, a
//! mass seen along other axes. No rewriting leads from one to the other, but at points where every variable has a value of
//! its own they are equal, and there sums vanish whose terms cancel.

use rustc_hash::FxHashMap;

use super::EquationStep;
use super::points::{POINTS, ROUNDING, somewhere, value};
use super::symmetry::values_of_steps;
use crate::algebra::{Expr, Exprs, Node, Symbol, ZERO};

/// Bits of a value that are not looked up: more than rounding takes.
const NOT_LOOKED_UP: u32 = 24;

/// Names for parts of a loop; what has the value of something known gets no name of its own.
pub struct Recognition {
    /// Names, each with its value, in what is defined before the loop and in names before it.
    pub named: Vec<(Symbol, Expr)>,
    points: Vec<Point>,
    /// What is known, with its values, by the first of them.
    known: FxHashMap<u64, Vec<(Expr, [f64; POINTS])>>,
}

impl Recognition {
    /// Nothing known yet. `roots`: what the loop is made of; `steps`: what is evaluated before it.
    pub fn new(x: &Exprs, roots: &[Expr], steps: &[EquationStep]) -> Recognition {
        let points = (0..POINTS).map(|number| Point::new(x, number, Parameters::Any, roots, steps)).collect();
        Recognition { named: Vec::new(), points, known: FxHashMap::default() }
    }

    /// Whether an expression has the value 0, be it that its terms cancel.
    pub fn is_zero(&mut self, x: &Exprs, e: Expr) -> bool {
        if e == ZERO {
            return true;
        }
        self.points.iter_mut().all(|point| {
            let size = match x.node(e) {
                Node::Add(terms) => terms.iter().map(|&term| point.value(x, term).abs()).sum(),
                _ => 0.0,
            };
            point.value(x, e).abs() <= ROUNDING * size
        })
    }

    /// The expression, or what is known to have its value, or its opposite; a name where it is longer than this.
    pub fn short(&mut self, x: &mut Exprs, e: Expr, longest: u64, name: impl FnOnce(&mut Exprs) -> Symbol) -> Expr {
        if x.is_number(e).is_some() {
            self.add(x, e);
            return e;
        }
        let is_long = x.is_longer(e, longest);
        let values = self.values(x, e);
        match self.of_value(&values) {
            Some((known, same)) if is_long => return if same { known } else { x.neg(known) },
            Some(_) => return e,
            None => {}
        }
        if !is_long {
            self.insert(e, values);
            return e;
        }
        let name = name(x);
        self.points.iter_mut().for_each(|point| point.know(x, name, e));
        self.named.push((name, e));
        let name = x.sym(name);
        self.insert(name, values);
        name
    }

    fn add(&mut self, x: &Exprs, e: Expr) {
        let values = self.values(x, e);
        if self.of_value(&values).is_none() {
            self.insert(e, values);
        }
    }

    fn insert(&mut self, e: Expr, values: [f64; POINTS]) {
        self.known.entry(looked_up(&values)).or_default().push((e, values));
    }

    fn values(&mut self, x: &Exprs, e: Expr) -> [f64; POINTS] {
        std::array::from_fn(|k| self.points[k].value(x, e))
    }

    /// What is known to have these values, or with their signs reversed.
    fn of_value(&self, values: &[f64; POINTS]) -> Option<(Expr, bool)> {
        let near = looked_up(values);
        let near = [near.wrapping_sub(1), near, near + 1];
        near.iter().filter_map(|key| self.known.get(key)).flatten().find_map(|(known, own)| {
            let is = |sign: f64| {
                let mut pairs = own.iter().zip(values);
                pairs.all(|(a, b)| (a - sign * b).abs() <= ROUNDING * (a.abs() + b.abs()))
            };
            if is(1.0) { Some((*known, true)) } else { is(-1.0).then_some((*known, false)) }
        })
    }
}

fn looked_up(values: &[f64; POINTS]) -> u64 {
    values[0].abs().to_bits() >> NOT_LOOKED_UP
}

/// Values of parameters at a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Parameters {
    /// Any.
    Any,
    /// Those that are given.
    Given,
}

/// A point at which every variable has a value of its own.
pub struct Point {
    number: usize,
    parameters: Parameters,
    known: FxHashMap<Symbol, f64>,
    parts: FxHashMap<Expr, f64>,
}

impl Point {
    /// The point of this number. `roots`: what will be evaluated; `steps`: what is evaluated before.
    pub fn new(x: &Exprs, number: usize, parameters: Parameters, roots: &[Expr], steps: &[EquationStep]) -> Point {
        let known = values_of_steps(x, number, &|s| value_at(x, number, parameters, s), roots, steps);
        Point { number, parameters, known, parts: FxHashMap::default() }
    }

    /// Whether parameters are as given there.
    pub fn has_given_parameters(&self) -> bool {
        self.parameters == Parameters::Given
    }

    /// A name has the value of an expression from now on.
    pub fn know(&mut self, x: &Exprs, name: Symbol, e: Expr) {
        let value = self.value(x, e);
        self.known.insert(name, value);
    }

    /// The value of an expression there.
    pub fn value(&mut self, x: &Exprs, e: Expr) -> f64 {
        let (number, parameters, known) = (self.number, self.parameters, &self.known);
        let at = |s: Symbol| known.get(&s).copied().unwrap_or_else(|| value_at(x, number, parameters, s));
        value(x, number, e, &at, &mut self.parts)
    }
}

fn value_at(x: &Exprs, number: usize, parameters: Parameters, symbol: Symbol) -> f64 {
    let given = if parameters == Parameters::Given { x.facts(symbol).given } else { None };
    given.and_then(|e| x.given_value(e)).unwrap_or_else(|| somewhere(number, symbol))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::algebra::{Comparison, Facts};

    /// One value: `a (b + c)` and `a b + a c`, with names from there on; sums that cancel are zero.
    #[test]
    fn values_are_recognised() {
        let mut x = Exprs::default();
        let [a, b, c, name] = ["a", "b", "c", "name"].map(|name| x.symbol(name, Facts::default()));
        let [a, b, c] = [a, b, c].map(|s| x.sym(s));
        let inside = x.add(&[b, c]);
        let outside = x.mul(&[a, inside]);
        let terms = [b, c].map(|e| x.mul(&[a, e]));
        let sum = x.add(&terms);
        let mut recognition = Recognition::new(&x, &[], &[]);
        let named = recognition.short(&mut x, sum, 3, |_| name);
        assert_eq!(named, x.sym(name));
        assert_eq!(recognition.short(&mut x, outside, 3, |_| panic!("it has a name")), named);
        let minus = x.neg(outside);
        assert_eq!(recognition.short(&mut x, minus, 3, |_| panic!("it has a name")), x.neg(named));
        let zero = x.sub(sum, outside);
        assert!(recognition.is_zero(&x, zero) && !recognition.is_zero(&x, sum));
    }

    /// A force that there is on one side only is not taken for nothing where all points lie on the other.
    #[test]
    fn corners_are_no_values() {
        let mut x = Exprs::default();
        let [gap, force, name] = ["gap", "force", "name"].map(|name| x.symbol(name, Facts::default()));
        let [gap, force] = [gap, force].map(|s| x.sym(s));
        let open = x.compare(Comparison::Gt, gap, ZERO);
        let contact = x.select(open, ZERO, gap);
        let least = x.call(crate::algebra::Function::Min, &[gap, ZERO]);
        let mut recognition = Recognition::new(&x, &[], &[]);
        recognition.short(&mut x, force, 3, |_| name);
        for side in [contact, least] {
            let sum = x.add(&[force, side]);
            assert!(!recognition.is_zero(&x, side));
            assert_eq!(recognition.short(&mut x, sum, 1, |_| name), x.sym(name));
        }
    }
}
