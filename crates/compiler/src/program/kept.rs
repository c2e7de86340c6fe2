//! What keeps its value when a source or the law of a storage jumps.

use super::Value;
use super::dataflow::Dataflow;
use super::op::Op;
use crate::algebra::Symbol;
use crate::bond_graph::{BondGraph, Kind};
use crate::equations::{Equations, Momentum};
use std::collections::BTreeMap;

/// Speeds that are states although a source that can jump moves storages that follow them, or a law of these jumps.
pub(super) fn kept(flow: Dataflow<'_>, equations: &Equations, momenta: &BTreeMap<Symbol, Value>) -> Vec<(u32, Value)> {
    if !equations.residuals.is_empty() {
        return Vec::new();
    }
    // The state is the variable itself, or what its storage holds.
    let held = |m: &Momentum| stored_with(&equations.graph, m.speed);
    let of_state = |m: &Momentum| {
        let held = held(m);
        equations.tracked.iter().position(|s| *s == m.speed || Some(*s) == held)
    };
    // A sum that is itself the state keeps its value anyway.
    let is_sum = |i: usize| equations.meanings.iter().any(|(s, _)| *s == equations.states[i].symbol);
    let moved = equations.momenta.iter().filter(|m| m.moved);
    let kept: Vec<(u32, Value)> =
        moved.filter_map(|m| Some((of_state(m).filter(|&i| !is_sum(i))? as u32, momenta[&m.speed]))).collect();
    let sums: Vec<Value> = kept.iter().map(|k| k.1).collect();
    let jumps = flow.varying(&sums).any(|op| op.condition().is_some() || matches!(op, Op::Held(_)));
    if jumps { kept } else { Vec::new() }
}

/// What the storage holds whose co-energy variable this is.
fn stored_with(graph: &BondGraph, variable: Symbol) -> Option<Symbol> {
    graph.outer_ports().into_iter().find_map(|port| {
        let (z, _) = graph.storage_symbols(port)?;
        match &graph.elements[port.element].kind {
            Kind::Inertance(s) | Kind::Compliance(s) if z == variable => Some(s.stored[port.port as usize]),
            _ => None,
        }
    })
}
