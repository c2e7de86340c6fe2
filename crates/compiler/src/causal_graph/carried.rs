//! Efforts in a loop that is closed at the rates.
//!
//! A constraint that acts on the rates of joints leaves the bonds of the loop without the force that closes it: what moves is
//! the same by virtual work, what the joints bear is not. Where sources say what the constraint puts on their bonds
//! (`carries`), each effort has a share by the rows of the junction structure: with the rates as they are, the efforts are
//! linear in those of the sources.

use std::collections::{BTreeMap, BTreeSet};

use super::{CausalGraph, assign_causality};
use crate::algebra::{Expr, Exprs, Symbol, ZERO};
use crate::bond_graph::{BondGraph, Element, Meaning};
use crate::ids::Id;

/// What an effort has beside what its bond gives it.
#[derive(Debug, Clone, Copy)]
pub struct Share {
    /// The effort.
    pub of: Symbol,
    /// A variable for its share.
    pub symbol: Symbol,
    /// The share, in the shares before it and the efforts of constraints.
    pub value: Expr,
}

/// The share of each effort that has one, each by those before it. `missing` has no value: of constraints that repeat each
/// other one way to share the reaction is told, the one in which these carry nothing.
pub fn shares(x: &mut Exprs, causal: &CausalGraph, missing: impl Fn(Symbol) -> bool) -> Vec<Share> {
    let ports = &causal.ports;
    let mut all = Vec::new();
    let mut known: BTreeMap<Symbol, Symbol> = BTreeMap::new();
    let mut add = |x: &mut Exprs, known: &mut BTreeMap<Symbol, Symbol>, of, value| {
        let name = format!("{}.carried", x.label(of));
        let symbol = x.fresh(&name, Default::default());
        known.insert(of, symbol);
        all.push(Share { of, symbol, value });
    };
    for state in &ports.ports {
        let Some(carried) = causal.graph.elements[state.port.element].carries else { continue };
        let carried = put_in(x, carried, |s| missing(s).then_some(ZERO));
        if !x.is_zero(carried) {
            add(x, &mut known, state.input, carried);
        }
    }
    if known.is_empty() {
        return all;
    }
    let mut done: BTreeSet<Symbol> = BTreeSet::new();
    for &first in ports.definitions.keys() {
        let mut open = vec![first];
        while let Some((next, definition)) = ports.next_to_resolve(&mut open, |s| done.contains(s)) {
            done.insert(next);
            let mut terms = Vec::new();
            for (read, factor) in &definition.0 {
                if let Some(&own) = known.get(read) {
                    let own = x.sym(own);
                    terms.push(x.mul(&[*factor, own]));
                }
            }
            if !terms.is_empty() {
                let sum = x.add(&terms);
                add(x, &mut known, next, sum);
            }
        }
    }
    all
}

/// The same model in which laws, signals and events read efforts with their shares. What shares are does not depend on the
/// mode: a constraint at the rates and what its sources carry in its place balance each other in every motion.
pub fn reading_shares(graph: BondGraph) -> BondGraph {
    let read = efforts_read(&graph);
    if read.is_empty() {
        return graph;
    }
    // What cannot be assigned is told where causality is.
    let Ok(mut causal) = assign_causality(&graph) else { return graph };
    let mut x = std::mem::take(&mut causal.graph.exprs);
    let shares = shares(&mut x, &causal, |s| causal.ports.undetermined.contains(&s));
    let mut wanted: BTreeSet<Symbol> = shares.iter().filter(|s| read.contains(&s.of)).map(|s| s.symbol).collect();
    if wanted.is_empty() {
        return graph;
    }
    for share in shares.iter().rev() {
        if wanted.contains(&share.symbol) {
            wanted.extend(x.symbols_of(share.value));
        }
    }
    let mut written: BTreeMap<Symbol, Expr> = BTreeMap::new();
    let mut whole: BTreeMap<Symbol, Expr> = BTreeMap::new();
    for share in shares.iter().filter(|s| wanted.contains(&s.symbol)) {
        let value = put_in(&mut x, share.value, |s| written.get(&s).copied());
        written.insert(share.symbol, value);
        if read.contains(&share.of) {
            let bare = x.sym(share.of);
            whole.insert(share.of, x.add(&[bare, value]));
        }
    }
    let mut graph = causal.graph;
    graph.exprs = x;
    let own = own_efforts(&graph);
    graph.rewrite_laws(&mut |x, e, element| {
        let own = element.map_or(&[][..], |element| &own[element.index()]);
        put_in(x, e, |s| whole.get(&s).copied().filter(|_| !own.contains(&s)))
    });
    graph
}

/// An expression with what is given in the place of its symbols.
fn put_in(x: &mut Exprs, e: Expr, given: impl Fn(Symbol) -> Option<Expr>) -> Expr {
    let read: BTreeMap<Symbol, Expr> =
        x.symbols_of(e).into_iter().filter_map(|s| given(s).map(|given| (s, given))).collect();
    if read.is_empty() { e } else { x.substitute(e, &read) }
}

/// The efforts that are read by laws of other elements, where some may have a share; those of constraints have none.
fn efforts_read(graph: &BondGraph) -> BTreeSet<Symbol> {
    let mut read = BTreeSet::new();
    if graph.elements.values().all(|e| e.carries.is_none()) {
        return read;
    }
    let multipliers: BTreeSet<Symbol> =
        graph.constraints.iter().flat_map(|c| graph.exprs.symbols_of(c.multiplier)).collect();
    let own = own_efforts(graph);
    for (e, element) in graph.moved_by() {
        let own = element.map_or(&[][..], |element| &own[element.index()]);
        let effort = |s: &Symbol| matches!(graph.variables.get(s).map(|v| v.meaning), Some(Meaning::Effort(_)));
        read.extend(graph.exprs.symbols_of(e).into_iter().filter(|s| effort(s) && !own.contains(s)));
    }
    read.retain(|s| !multipliers.contains(s));
    read
}

/// The efforts of the bonds of each element: its own law reads them as its bond gives them.
fn own_efforts(graph: &BondGraph) -> Vec<Vec<Symbol>> {
    let efforts = |e: &Element| e.ports.iter().map(|p| graph.bonds[p.bond].effort).collect();
    graph.elements.values().map(efforts).collect()
}
