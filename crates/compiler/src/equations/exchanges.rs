//! Speeds (and efforts) of which others could stay independent in place of those that do: where a mechanism comes near a
//! position in which the present ones no longer tell how it moves, some are exchanged. Source: `method.md`, 5.8.

use std::collections::{BTreeMap, BTreeSet};

use super::Conserved;
use super::derive::of_the_bond;
use super::minimal::{Assembled, rows_of};
use crate::algebra::{Expr, Exprs, Node, NumericPoint, Residue, Symbol};
use crate::bond_graph::{Kind, Meaning};
use crate::causal_graph::start_point::start_point;
use crate::causal_graph::{CausalGraph, PortState, Ports, Role, magnitude_of_slope};
use crate::ids::Map;

/// Larger tables of ratios are not looked at.
const MOST: usize = 20_000;
/// Of so many divisors all products are looked at; of more those of some that follow each other.
const ALL_PRODUCTS: usize = 10;
const IN_A_ROW: usize = 40;
/// What moves so many times as fast at the start is near a position in which others had better be independent.
const NEAR_SINGULAR: f64 = 100.0;

/// Which variables depend on which by ratios that vary.
#[derive(Debug, Clone, Default)]
pub struct Exchanges {
    /// Those that stay independent.
    pub independent: Vec<Exchanged>,
    /// Those that follow from them.
    pub dependent: Vec<Exchanged>,
}

/// A variable that may be independent or not.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Exchanged {
    /// The effort or flow.
    pub symbol: Symbol,
    /// The variable that tells it where it is independent: itself, or what its storage holds.
    pub told_by: Symbol,
    /// By what it is multiplied to be compared with others: the root of the slope of its storage. `None` without one.
    pub weight: Option<f64>,
}

impl Exchanged {
    /// By what it is multiplied, 1 without a storage.
    pub fn weighs(&self) -> f64 {
        self.weight.unwrap_or(1.0)
    }
}

/// Whether a divisor may vanish while running, so that other variables would have to be independent.
pub(super) fn may_exchange(assembled: &Assembled, causal: &CausalGraph) -> bool {
    causal.ports.watched.iter().any(|&divisor| !assembled.d.is_constant(divisor))
}

/// The exchanges among what depends on each other by divisors that may vanish while running.
/// `conserved`: what is, in place of some states.
pub(super) fn exchanges(assembled: &mut Assembled, causal: &CausalGraph, conserved: &[Conserved]) -> Exchanges {
    if !may_exchange(assembled, causal) {
        return Exchanges::default();
    }
    let d = &mut assembled.d;
    let ports = &causal.ports;
    let mut rows = rows_of(d, causal);
    let storages = ports.ports.iter().filter(|p| p.role == Role::Independent);
    let stored = |p: &PortState| match &d.graph.elements[p.port.element].kind {
        Kind::Inertance(storage) | Kind::Compliance(storage) => Some((p.input, storage.stored[p.port.port as usize])),
        _ => None,
    };
    let stored: BTreeMap<Symbol, Symbol> = storages.clone().filter_map(stored).collect();
    let storages = storages.map(|p| p.input);
    let independent: BTreeSet<Symbol> = storages.chain(ports.virtual_speeds.iter().map(|v| v.speed)).collect();
    let rates = d.computed.iter().filter_map(|&s| match d.meaning(s)? {
        Meaning::Signal(signal) => match *d.x.node(d.graph.signals[signal].rate) {
            Node::Symbol(rate) => Some(rate),
            _ => None,
        },
        _ => d.stored.get(&s).copied(),
    });
    let storages = ports.ports.iter().filter(|p| p.role == Role::Dependent).map(|p| p.output);
    let dependent: BTreeSet<Symbol> = storages.chain(rates).filter(|s| !independent.contains(s)).collect();
    let divisors = proportions_of(&mut d.x, &ports.watched);
    let mut found = Exchanges::default();
    let mut read: BTreeSet<Symbol> = BTreeSet::new();
    let mut seen: BTreeSet<Symbol> = BTreeSet::new();
    let mut point = start_point(&d.x, d.graph);
    let mut weights = weights(d, causal, &point);
    let tracked: BTreeSet<Symbol> =
        assembled.states.iter().map(|s| s.tracked).chain(conserved.iter().map(|c| c.replaced)).collect();
    let of = |d: &super::Definitions, weights: &BTreeMap<Symbol, f64>, symbol: Symbol| {
        let told_by = stored.get(&symbol).copied().filter(|s| tracked.contains(s)).unwrap_or(symbol);
        Exchanged {
            symbol: of_the_bond(d, causal, symbol),
            told_by: of_the_bond(d, causal, told_by),
            weight: weights.get(&symbol).copied(),
        }
    };
    let mut divided: Map<Symbol, bool> = Map::new();
    for symbol in dependent {
        if found.dependent.len() * independent.len() > MOST {
            return Exchanges::default();
        }
        // Where no speed has a storage the rows of what is not divided by anything need not be written out.
        if stored.is_empty() && !is_divided(&d.x, ports, symbol, &divisors, &mut divided) {
            continue;
        }
        let Some(row) = rows.of(&mut d.x, symbol).cloned() else { continue };
        // Beside a speed without inertia, which has none to be compared by, only what is divided by what may vanish counts:
        // what moves by lever arms keeps to what it hangs on.
        let counts = |x: &Exprs, t: &(Symbol, Expr)| stored.contains_key(&t.0) || divides(x, t.1, &divisors);
        let ratios: Vec<_> = row.0.iter().filter(|t| independent.contains(&t.0)).collect();
        let none = !ratios.iter().any(|t| !d.is_constant(t.1) && counts(&d.x, t));
        if none || !seen.insert(d.x.untwinned(symbol)) {
            continue;
        }
        read.extend(ratios.iter().map(|t| t.0));
        // A speed without inertia has no unit in common with others: against it counts what moves faster than at the start.
        let free = ratios.iter().filter(|t| !stored.contains_key(&t.0));
        let first = free.map(|t| point.value(&d.x, t.1).abs()).fold(0.0, f64::max);
        let weight = weights.get(&symbol).copied().unwrap_or(1.0);
        if (1.0..NEAR_SINGULAR).contains(&(weight * first)) {
            weights.insert(symbol, 1.0 / first);
        }
        found.dependent.push(of(d, &weights, symbol));
    }
    found.independent.extend(read.into_iter().map(|symbol| of(d, &weights, symbol)));
    found
}

/// Whether a variable is made of anything that is divided by one of these; with what is known of others.
fn is_divided(
    x: &Exprs,
    ports: &Ports,
    symbol: Symbol,
    divisors: &BTreeSet<Residue>,
    known: &mut Map<Symbol, bool>,
) -> bool {
    let mut open = vec![symbol];
    while let Some((next, definition)) = ports.next_to_resolve(&mut open, |s| known.contains_key(s)) {
        let read = |t: &(Symbol, Expr)| known.get(&t.0) == Some(&true) || divides(x, t.1, divisors);
        let divided = definition.0.iter().any(read);
        known.insert(next, divided);
    }
    known.get(&symbol) == Some(&true)
}

/// What divisors, their factors and their products are, but for numbers: a pivot is itself divided by those before it, which
/// their product no longer is, and rows are written with either.
fn proportions_of(x: &mut Exprs, divisors: &[Expr]) -> BTreeSet<Residue> {
    let mut found = BTreeSet::new();
    let mut whole: Vec<Residue> = Vec::new();
    for &divisor in divisors {
        let factors = match x.node(divisor) {
            Node::Mul(factors) => factors.to_vec(),
            _ => Vec::new(),
        };
        for e in factors.into_iter().chain([divisor]) {
            let base = match *x.node(e) {
                Node::Pow(base, _) => base,
                _ => e,
            };
            found.extend(x.proportion(base));
        }
        whole.extend(x.proportion(divisor));
    }
    if whole.len() <= ALL_PRODUCTS {
        let mut products: Vec<Residue> = Vec::new();
        for &one in &whole {
            let more: Vec<Residue> = products.iter().map(|&product| product * one).chain([one]).collect();
            products.extend(more);
        }
        found.extend(products);
    } else {
        for from in 0..whole.len() {
            let next = |product: &mut Residue, &one: &Residue| {
                *product = *product * one;
                Some(*product)
            };
            let in_a_row = whole[from + 1..].iter().take(IN_A_ROW).scan(whole[from], next);
            found.extend(in_a_row);
        }
    }
    found
}

/// Whether a part of the expression is divided by one of these.
fn divides(x: &Exprs, e: Expr, divisors: &BTreeSet<Residue>) -> bool {
    x.below(&[e], &|_| true).into_iter().any(|part| match *x.node(part) {
        Node::Pow(base, n) if x.is_number(n).is_some_and(|n| n.signum() < 0) => {
            x.proportion(base).is_some_and(|proportion| divisors.contains(&proportion))
        }
        _ => false,
    })
}

/// The roots of the slopes `X/z` of storages, at the start.
fn weights(d: &super::Definitions, causal: &CausalGraph, point: &NumericPoint) -> BTreeMap<Symbol, f64> {
    let storages = causal.ports.ports.iter().filter_map(|p| match p.role {
        Role::Independent => Some((p.input, p.port)),
        Role::Dependent => Some((p.output, p.port)),
        _ => None,
    });
    let weight = |(symbol, port)| Some((symbol, magnitude_of_slope(&d.x, d.graph, point, port)?.sqrt()));
    storages.filter_map(weight).collect()
}
