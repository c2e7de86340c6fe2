//! Linear equations whose matrix is symmetric, as mass matrices are: an entry and its mirror image have one value, and the one
//! is kept that takes fewer operations.
//!
//! Whether two entries are equal is told by their values at points where every variable has a value of its own: they come
//! about in different ways, one through speeds and one through forces, and no rewriting leads from one to the other.

use std::collections::{BTreeMap, BTreeSet};

use rustc_hash::{FxHashMap, FxHashSet};

use super::points::{POINTS, ROUNDING, solved, somewhere, value};
use super::{EquationStep, LinearBlock};
use crate::algebra::{Expr, Exprs, Node, Symbol};

/// An entry of a matrix: row, column.
type Place = (usize, usize);

/// Puts one expression in the place of two entries that mirror each other and have equal values, or opposite ones. `rows`:
/// the entries by their columns; `right`: right-hand sides, which are evaluated in any case; `named`: names for parts of
/// both, with their values; `steps`: what is evaluated before.
pub fn mirrored(
    x: &mut Exprs,
    rows: &mut [(Vec<(usize, Expr)>, Expr)],
    named: &[(Symbol, Expr)],
    steps: &[EquationStep],
) {
    let mut entries: BTreeMap<Place, Expr> = BTreeMap::new();
    for (i, (row, _)) in rows.iter().enumerate() {
        entries.extend(row.iter().map(|&(j, e)| ((i, j), e)));
    }
    let pairs = entries.iter().filter(|((i, j), _)| i < j);
    let pairs: Vec<(Place, Expr, Expr)> =
        pairs.filter_map(|(&(i, j), &e)| Some(((i, j), e, *entries.get(&(j, i))?))).collect();
    let signs = signs(x, &pairs, named, steps);
    let values: FxHashMap<Symbol, Expr> = named.iter().copied().collect();
    let mut needed = Needed { values: &values, seen: FxHashSet::default() };
    rows.iter().for_each(|row| needed.add(x, row.1));
    entries.iter().filter(|((i, j), _)| i == j).for_each(|(_, &e)| needed.add(x, e));
    for (((i, j), upper, lower), sign) in pairs.into_iter().zip(signs) {
        if sign == 0 || upper == lower {
            continue;
        }
        let (from, to) =
            if needed.count(x, upper) <= needed.count(x, lower) { ((i, j), (j, i)) } else { ((j, i), (i, j)) };
        let kept = entries[&from];
        needed.add(x, kept);
        let value = if sign > 0 { kept } else { x.neg(kept) };
        let place = rows[to.0].0.iter_mut().find(|e| e.0 == to.1).expect("it is an entry");
        place.1 = value;
    }
}

/// For each pair of entries 1 if they are equal, -1 if they are opposite, 0 if neither.
fn signs(x: &Exprs, pairs: &[(Place, Expr, Expr)], named: &[(Symbol, Expr)], steps: &[EquationStep]) -> Vec<i8> {
    let mut signs: Vec<Option<i8>> = vec![None; pairs.len()];
    let roots: Vec<Expr> = pairs.iter().flat_map(|p| [p.1, p.2]).collect();
    let order = before(x, &roots, named, steps);
    for point in 0..POINTS {
        let known = values(x, point, &|s| somewhere(point, s), named, steps, &order);
        let at = |s: Symbol| known.get(&s).copied().unwrap_or_else(|| somewhere(point, s));
        let mut parts = FxHashMap::default();
        for (pair, sign) in pairs.iter().zip(&mut signs) {
            let [upper, lower] = [pair.1, pair.2].map(|e| value(x, point, e, &at, &mut parts));
            let equal = |a: f64, b: f64| (a - b).abs() <= ROUNDING * (a.abs() + b.abs());
            let here = if equal(upper, lower) {
                1
            } else if equal(upper, -lower) {
                -1
            } else {
                0
            };
            *sign = Some(sign.map_or(here, |before| if before == here { here } else { 0 }));
        }
    }
    signs.into_iter().map(|sign| sign.unwrap_or(0)).collect()
}

/// The steps that expressions rest on, in order.
fn before(x: &Exprs, roots: &[Expr], named: &[(Symbol, Expr)], steps: &[EquationStep]) -> Vec<usize> {
    let named: FxHashMap<Symbol, Expr> = named.iter().copied().collect();
    let mut of: FxHashMap<Symbol, usize> = FxHashMap::default();
    for (k, step) in steps.iter().enumerate() {
        match step {
            EquationStep::Assign { symbol, .. } => _ = of.insert(*symbol, k),
            EquationStep::Linear(block) => of.extend(block.unknowns.iter().map(|&s| (s, k))),
            EquationStep::Newton(_) | EquationStep::Guard { .. } => {}
        }
    }
    let (mut found, mut seen) = (BTreeSet::new(), FxHashSet::default());
    let mut open: Vec<Symbol> = roots.iter().flat_map(|&e| x.symbols_of(e)).collect();
    while let Some(symbol) = open.pop() {
        if !seen.insert(symbol) {
            continue;
        }
        if let Some(&value) = named.get(&symbol) {
            open.extend(x.symbols_of(value));
        } else if let Some(&k) = of.get(&symbol)
            && found.insert(k)
        {
            match &steps[k] {
                EquationStep::Assign { value, .. } => open.extend(x.symbols_of(*value)),
                EquationStep::Linear(block) => {
                    let LinearBlock { matrix, right, .. } = &**block;
                    open.extend(matrix.entries().iter().chain(right).flat_map(|&e| x.symbols_of(e)));
                }
                _ => {}
            }
        }
    }
    found.into_iter().collect()
}

/// The values of all variables that these steps define, and of the names, where other variables have these values.
fn values(
    x: &Exprs,
    point: usize,
    at: &dyn Fn(Symbol) -> f64,
    named: &[(Symbol, Expr)],
    steps: &[EquationStep],
    order: &[usize],
) -> FxHashMap<Symbol, f64> {
    let mut known: FxHashMap<Symbol, f64> = FxHashMap::default();
    let mut parts: FxHashMap<Expr, f64> = FxHashMap::default();
    let mut evaluate = |e: Expr, known: &FxHashMap<Symbol, f64>| {
        value(x, point, e, &|s| known.get(&s).copied().unwrap_or_else(|| at(s)), &mut parts)
    };
    for &k in order {
        match &steps[k] {
            EquationStep::Assign { symbol, value } => {
                let value = evaluate(*value, &known);
                known.insert(*symbol, value);
            }
            EquationStep::Linear(block) => {
                let LinearBlock { unknowns, matrix, right, .. } = &**block;
                let n = unknowns.len();
                let full: Vec<f64> = matrix.dense(crate::algebra::ZERO).iter().map(|&e| evaluate(e, &known)).collect();
                let right = right.iter().map(|&e| evaluate(e, &known)).collect();
                known.extend(unknowns.iter().copied().zip(solved(n, full, right)));
            }
            EquationStep::Newton(_) | EquationStep::Guard { .. } => {}
        }
    }
    for &(symbol, value) in named {
        let value = evaluate(value, &known);
        known.insert(symbol, value);
    }
    known
}

/// The values of all variables on which these expressions rest and which steps define, where others have these values.
pub(super) fn values_of_steps(
    x: &Exprs,
    point: usize,
    at: &dyn Fn(Symbol) -> f64,
    roots: &[Expr],
    steps: &[EquationStep],
) -> FxHashMap<Symbol, f64> {
    let order = before(x, roots, &[], steps);
    values(x, point, at, &[], steps, &order)
}

/// What is evaluated anyway.
struct Needed<'a> {
    values: &'a FxHashMap<Symbol, Expr>,
    seen: FxHashSet<Expr>,
}

impl Needed<'_> {
    /// Adds all that an expression is made of.
    fn add(&mut self, x: &Exprs, e: Expr) {
        let new = self.not_yet(x, e);
        self.seen.extend(new);
    }

    /// How much is new in an expression.
    fn count(&self, x: &Exprs, e: Expr) -> usize {
        self.not_yet(x, e).len()
    }

    fn not_yet(&self, x: &Exprs, e: Expr) -> FxHashSet<Expr> {
        let (mut new, mut open) = (FxHashSet::default(), vec![e]);
        while let Some(e) = open.pop() {
            if self.seen.contains(&e) || !new.insert(e) {
                continue;
            }
            match x.node(e) {
                Node::Symbol(s) => open.extend(self.values.get(s)),
                node => node.for_each_child(|c| open.push(c)),
            }
        }
        new
    }
}
