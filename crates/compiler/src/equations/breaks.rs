//! Loops of variables opened by the fewest break variables. Source: `method.md`, section 3.

use std::collections::{BTreeMap, BTreeSet};

use super::along::AlgebraicConstraint;
use super::definitions::Definitions;
use super::{AlgebraicRole, BreakBound};
use crate::algebra::{Expr, Exprs, Symbol};
use crate::bond_graph::{BondId, Kind, Meaning, PortRef};
use crate::causal_graph::break_set::{break_set, cyclic_components, restrict};
use crate::causal_graph::signals::{NodeId, signal_graph};
use crate::causal_graph::start_point::start_point;
use crate::causal_graph::{Stroke, vanishes};
use crate::ids::{Id, Table};

/// Opens every loop on the way to the wanted symbols: first at the break variables of the zero-order causal paths along
/// the strokes, then, where loops run through other variables too, at a minimum set of what is left.
pub fn open_loops(
    d: &mut Definitions,
    strokes: &Table<BondId, Stroke>,
    wanted: &BTreeSet<Symbol>,
    closed: &BTreeSet<Symbol>,
) -> (Vec<AlgebraicConstraint>, BreakBound) {
    let signals = signal_graph(d.graph, strokes);
    let set = break_set(&signals.algebraic_successors(), &signals.break_ranks());
    let first: Vec<Symbol> = set.vertices.iter().map(|&v| NodeId::new(v).symbol(d.graph)).collect();
    let mut bound = BreakBound::default();
    let mut cut = divided_by_nothing(d, &Web::new(d, wanted, &BTreeSet::new(), closed));
    let mut planned = cut.len() + set.lower_bound;
    for stage in [Some(&first), None] {
        let web = Web::new(d, wanted, &cut, closed);
        for component in cyclic_components(&web.successors) {
            let members: BTreeSet<Symbol> = component.iter().map(|&v| web.symbols[v]).collect();
            match stage {
                Some(first) => cut.extend(first.iter().filter(|s| members.contains(s))),
                None => {
                    let ranks = vec![0; component.len()];
                    let more = break_set(&restrict(&web.successors, &component), &ranks);
                    planned += more.lower_bound;
                    cut.extend(more.vertices.iter().map(|&v| web.symbols[component[v]]));
                }
            }
        }
    }
    bound.number = cut.len();
    bound.at_least = planned.min(cut.len());
    let constraints = cut.into_iter().map(|symbol| close(d, symbol)).collect();
    (constraints, bound)
}

/// Variables that their strokes divide by what vanishes at the start, as moduli along the axes of bodies do where these stand
/// straight: they are unknowns, and what divides them a factor of theirs.
fn divided_by_nothing(d: &Definitions, web: &Web) -> BTreeSet<Symbol> {
    let divisors = |s: &Symbol| d.of.get(s).map_or(Vec::new(), |of| d.x.divisors_of_terms(of.expr(), &moves));
    let divided: Vec<(Symbol, Vec<(Expr, i64)>)> =
        web.symbols.iter().map(|s| (*s, divisors(s))).filter(|(_, divisors)| !divisors.is_empty()).collect();
    if divided.is_empty() {
        return BTreeSet::new();
    }
    let mut start = start_point(&d.x, d.graph);
    let mut begins_at_0 = |(e, _): &(Expr, i64)| vanishes(&d.x, *e, &mut start);
    divided.into_iter().filter(|(_, divisors)| divisors.iter().any(&mut begins_at_0)).map(|(s, _)| s).collect()
}

/// Whether a modulus may pass through 0, or begin there.
fn moves(x: &Exprs, e: Expr) -> bool {
    !x.is_nonzero_by_itself(e) && x.depends_on_any(e, &|s| x.facts(s).given.is_none())
}

fn close(d: &mut Definitions, symbol: Symbol) -> AlgebraicConstraint {
    let definition = d.of.remove(&symbol).expect("loops run through what is defined");
    d.free.insert(symbol);
    let residual = match definition {
        super::definitions::Definition::Explicit(e) => {
            let own = d.x.sym(symbol);
            d.x.sub(own, e)
        }
        super::definitions::Definition::Implicit(e) => e,
    };
    let residual = d.x.without_divisors(residual, &moves);
    AlgebraicConstraint { unknown: Some((symbol, AlgebraicRole::Break)), residual }
}

/// Who reads whom among the definitions on the way to what is wanted.
struct Web {
    symbols: Vec<Symbol>,
    successors: Vec<Vec<u32>>,
}

impl Web {
    /// `cut` and `closed` variables are taken as given.
    fn new(d: &Definitions, wanted: &BTreeSet<Symbol>, cut: &BTreeSet<Symbol>, closed: &BTreeSet<Symbol>) -> Web {
        let mut reads: BTreeMap<Symbol, BTreeSet<Symbol>> = BTreeMap::new();
        let mut work: Vec<Symbol> = wanted.iter().copied().collect();
        while let Some(symbol) = work.pop() {
            let Some(definition) = d.of.get(&symbol) else { continue };
            if reads.contains_key(&symbol) {
                continue;
            }
            let read: BTreeSet<Symbol> = d.x.symbols_of(definition.expr()).into_iter().collect();
            work.extend(&read);
            reads.insert(symbol, read);
        }
        let symbols: Vec<Symbol> = reads.keys().copied().collect();
        let open = |s: &Symbol| !cut.contains(s) && !closed.contains(s);
        let index: BTreeMap<Symbol, u32> = symbols.iter().zip(0..).map(|(&s, i)| (s, i)).collect();
        let heads = |s: &Symbol| reads[s].iter().filter(|r| open(r)).filter_map(|r| index.get(r).copied()).collect();
        let successors = symbols.iter().map(|s| if open(s) { heads(s) } else { Vec::new() }).collect();
        Web { symbols, successors }
    }
}

/// How an unknown is named: by the element that it belongs to.
pub fn name_of(d: &Definitions, symbol: Symbol) -> String {
    match place_of(d, symbol) {
        Some((place, variable)) => format!("{place}.{variable}"),
        None => d.x.name(symbol).to_string(),
    }
}

/// The bond, element or port that an effort or flow is named by, and which of the two it is.
pub fn place_of(d: &Definitions, symbol: Symbol) -> Option<(String, &'static str)> {
    let variable = d.x.untwinned(symbol);
    let (bond, letter) = match d.meaning(variable)? {
        Meaning::Effort(bond) => (bond, "e"),
        Meaning::Flow(bond) => (bond, "f"),
        _ => return None,
    };
    let bond = &d.graph.bonds[bond];
    let common =
        |p: &PortRef| matches!((&d.graph.elements[p.element].kind, letter), (Kind::Zero, "e") | (Kind::One, "f"));
    let outer = |p: &PortRef| !d.graph.elements[p.element].kind.is_inner();
    let ends = [bond.from, bond.to];
    if variable != symbol {
        // What two elements share is called after the one that the half arrow points at.
        return ends.iter().all(outer).then(|| (d.graph.port_name(bond.to), letter));
    }
    if !bond.name.is_empty() {
        return Some((bond.name.clone(), letter));
    }
    let place = match ends.iter().find(|p| outer(p)) {
        Some(&port) => d.graph.port_name(port),
        None => d.graph.elements[ends.iter().find(|p| common(p))?.element].name.clone(),
    };
    Some((place, letter))
}
