//! What a constraint puts on the junctions whose flows it names: its own gradient times its multiplier.
//!
//! The graph carries a constraint by transformers. Whether these are bonded where the constraint says, and nowhere else,
//! is seen from the constraint itself: its rate is `Σ a_j f_j`, and on each of these junctions it puts the effort `a_j λ`.

use std::collections::{BTreeMap, BTreeSet};

use halfarrow_compiler::algebra::{Expr, Exprs, Symbol, ZERO};
use halfarrow_compiler::bond_graph::{BondGraph, BondId, Constraint, ElementId, Kind, Meaning, PortRef};

/// The part of a constraint at one junction.
pub(crate) struct Share {
    /// The junction.
    pub junction: ElementId,
    /// What the flow of the junction is multiplied by in the rate of the constraint.
    pub factor: Expr,
    /// The bonds from the junction to the constraint, each with 1 if its half arrow points at the junction, else -1.
    pub bonds: Vec<(f64, BondId)>,
    /// The bond that carries the multiplier.
    pub multiplier: BondId,
}

/// The shares of all constraints, with their factors in the pool.
pub(crate) fn shares(graph: &BondGraph, x: &mut Exprs) -> Vec<Share> {
    graph.constraints.iter().filter(|c| !c.drawn).flat_map(|c| shares_of(graph, x, c)).collect()
}

fn shares_of(graph: &BondGraph, x: &mut Exprs, constraint: &Constraint) -> Vec<Share> {
    let mut factors: BTreeMap<ElementId, Expr> = BTreeMap::new();
    for (flow, factor) in gradient(graph, x, constraint) {
        let junction = match graph.variables.get(&flow).map(|v| v.meaning) {
            Some(Meaning::Flow(bond)) => graph.junction_of(bond, true),
            _ => None,
        };
        if let Some(junction) = junction {
            let sum = factors.get(&junction).map_or(factor, |&known| x.add(&[known, factor]));
            factors.insert(junction, sum);
        }
    }
    let multiplier = graph.elements[constraint.element].ports[0].bond;
    let carriers = carriers(graph, constraint, multiplier);
    let mut touched: BTreeMap<ElementId, Vec<(f64, BondId)>> = BTreeMap::new();
    for &carrier in &carriers {
        for bond in graph.elements[carrier].ports.iter().map(|p| p.bond) {
            let end = graph.far_end(bond, carrier);
            if !carriers.contains(&end) && end != constraint.element {
                let sign = if graph.bonds[bond].to.element == end { 1.0 } else { -1.0 };
                touched.entry(end).or_default().push((sign, bond));
            }
        }
    }
    let junctions: BTreeSet<ElementId> = factors.keys().chain(touched.keys()).copied().collect();
    let share = |junction| {
        let factor = factors.get(&junction).copied().unwrap_or(ZERO);
        let bonds = touched.get(&junction).cloned().unwrap_or_default();
        Share { junction, factor, bonds, multiplier }
    };
    junctions.into_iter().map(share).collect()
}

/// The junction of a constraint and its transformers.
fn carriers(graph: &BondGraph, constraint: &Constraint, multiplier: BondId) -> BTreeSet<ElementId> {
    let node = graph.far_end(multiplier, constraint.element);
    let own = |e: &ElementId| {
        let element = &graph.elements[*e];
        matches!(element.kind, Kind::Transformer { .. }) && element.span == constraint.span
    };
    let near = graph.elements[node].ports.iter().map(|p| graph.far_end(p.bond, node));
    near.filter(own).chain([node]).collect()
}

/// The flows in the rate of a constraint, each with its factor.
fn gradient(graph: &BondGraph, x: &mut Exprs, constraint: &Constraint) -> Vec<(Symbol, Expr)> {
    let mut rate = constraint.expr;
    if constraint.holonomic {
        let mut terms = Vec::new();
        for symbol in x.symbols_of(constraint.expr) {
            if let Some(speed) = speed_of(graph, x, symbol) {
                let slope = x.derivative(constraint.expr, symbol);
                terms.push(x.mul(&[slope, speed]));
            }
        }
        rate = x.add(&terms);
    }
    let is_flow = |s: &Symbol| matches!(graph.variables.get(s).map(|v| v.meaning), Some(Meaning::Flow(_)));
    let flows: Vec<Symbol> = x.symbols_of(rate).into_iter().filter(is_flow).collect();
    flows.into_iter().map(|flow| (flow, x.derivative(rate, flow))).collect()
}

/// The rate of a displacement, in flows.
fn speed_of(graph: &BondGraph, x: &mut Exprs, symbol: Symbol) -> Option<Expr> {
    match graph.variables.get(&symbol)?.meaning {
        Meaning::Signal(signal) => Some(graph.signals[signal].rate),
        Meaning::Stored(PortRef { element, port }) => {
            let (_, rate) = graph.storage_symbols(PortRef { element, port })?;
            Some(x.sym(rate))
        }
        _ => None,
    }
}
