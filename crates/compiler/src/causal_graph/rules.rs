//! The rules of causal strokes, element by element.

use std::collections::BTreeSet;

use super::{CausalGraph, Stroke};
use crate::bond_graph::BondId;
use crate::bond_graph::{BondGraph, ElementId, Kind, PortRef};
use crate::ids::Table;

/// Whether an element may have this number of strokes at it (`here`) and of strokes at the other ends of its bonds
/// (`away`): one bond sets a junction, none where its variable is `kept` and comes from no bond; a transformer hands
/// causality through, a gyrator turns it round.
pub fn in_order(kind: &Kind, here: usize, away: usize, kept: bool) -> bool {
    match kind {
        Kind::Zero => here == usize::from(!kept),
        Kind::One => away == usize::from(!kept),
        Kind::Transformer { .. } => (here, away) == (1, 1),
        Kind::Gyrator { .. } => matches!((here, away), (2, 0) | (0, 2)),
        // As many variables are given as there are equations: where one at `in` changes sides one at `out` does.
        Kind::MatrixTransformer(m) => (here, away) == (m.rows, m.columns),
        Kind::MatrixGyrator(_) => here.is_multiple_of(2),
        _ => true,
    }
}

/// Whether the stroke of its bond sits at a port; `None` without a stroke.
pub fn sits_at(graph: &BondGraph, strokes: &Table<BondId, Stroke>, port: PortRef) -> Option<bool> {
    let port = &graph.elements[port.element].ports[port.port as usize];
    match strokes[port.bond] {
        Stroke::Undetermined => None,
        Stroke::To => Some(port.inward),
        Stroke::From => Some(!port.inward),
    }
}

/// Numbers of strokes at an element, and at the other ends of its bonds.
pub fn around(element: ElementId, graph: &BondGraph, sits: &dyn Fn(PortRef) -> Option<bool>) -> (usize, usize) {
    let ports = (0..graph.elements[element].ports.len() as u32).map(|port| PortRef { element, port });
    ports.filter_map(sits).fold((0, 0), |(here, away), at| if at { (here + 1, away) } else { (here, away + 1) })
}

/// Whether a junction has its common variable from one of its bonds.
pub fn has_setter(element: ElementId, graph: &BondGraph, sits: &dyn Fn(PortRef) -> Option<bool>) -> bool {
    let (here, away) = around(element, graph, sits);
    if matches!(graph.elements[element].kind, Kind::Zero) { here > 0 } else { away > 0 }
}

/// The junctions whose common variable is independent although no storage has it, and that are drawn so: no bond sets
/// it, it acts as a source there.
pub fn kept_junctions(causal: &CausalGraph) -> BTreeSet<ElementId> {
    kept_in(causal, &causal.strokes)
}

/// The same with other strokes.
pub fn kept_in(causal: &CausalGraph, strokes: &Table<BondId, Stroke>) -> BTreeSet<ElementId> {
    let sits = |port| sits_at(&causal.graph, strokes, port);
    let junctions = causal.ports.virtual_speeds.iter().map(|v| v.junction);
    junctions.filter(|&j| !has_setter(j, &causal.graph, &sits)).collect()
}
