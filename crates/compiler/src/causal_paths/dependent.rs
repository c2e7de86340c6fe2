//! Class 1: paths between a storage in derivative and one in integral causality.

use std::collections::{BTreeMap, VecDeque};

use super::cycles::{Cycles, cycles_through};
use super::trace::nodes;
use crate::bond_graph::{BondGraph, BondId, Kind, PortRef, Storage, StorageLaw};
use crate::causal_graph::Stroke;
use crate::causal_graph::signals::{EdgeKind, NodeId, SignalEdge, SignalGraph};
use crate::ids::{Id, Table};

/// The ports of storages that are drawn in derivative causality, in the order of the graph.
pub(super) fn dependent_ports(graph: &BondGraph, strokes: &Table<BondId, Stroke>) -> Vec<PortRef> {
    let derivative = |place: &PortRef| {
        let flow_out = gives_flow(graph, strokes, *place);
        match &graph.elements[place.element].kind {
            Kind::Inertance(_) => flow_out == Some(false),
            Kind::Compliance(storage) => flow_out == Some(true) && has_state(storage, *place),
            _ => false,
        }
    };
    graph.outer_ports().into_iter().filter(derivative).collect()
}

/// Whether a port of a storage integrates: its displacement is not known from signals.
pub(super) fn has_state(storage: &Storage, place: PortRef) -> bool {
    !matches!(storage.laws[place.port as usize], StorageLaw::Known { .. })
}

/// Whether the element sets the flow of its bond at a port; `None` without a stroke.
pub(super) fn gives_flow(graph: &BondGraph, strokes: &Table<BondId, Stroke>, place: PortRef) -> Option<bool> {
    let port = &graph.elements[place.element].ports[place.port as usize];
    match strokes[port.bond] {
        Stroke::Undetermined => None,
        Stroke::To => Some(port.inward),
        Stroke::From => Some(!port.inward),
    }
}

/// The edges of storages in derivative causality from their own co-energy variable.
pub(super) fn derivative_edges(signals: &SignalGraph) -> Vec<&SignalEdge> {
    signals.edges.iter().filter(|edge| edge.kind == EdgeKind::Derivative).collect()
}

/// The simple cycles through one derivative edge and exactly one integral edge, else algebraic edges; at most `limit`.
pub(super) fn cycles_of(signals: &SignalGraph, edge: &SignalEdge, limit: usize) -> Cycles {
    let layers = Layers::new(signals, edge);
    let mut found = cycles_through(&layers.successors(), 0, limit);
    for cycle in &mut found.cycles {
        *cycle = cycle.iter().map(|&v| layers.places[v].0.index()).collect();
    }
    found.cycles.retain(|cycle| is_simple(cycle));
    found
}

/// A shortest such cycle: breadth first, edges in the order of the graph.
pub(super) fn shortest_of(signals: &SignalGraph, edge: &SignalEdge) -> Option<Vec<NodeId>> {
    const NEW: usize = usize::MAX;
    let slot = |(node, passed): Place| 2 * node.index() + usize::from(passed);
    let start = (edge.to, false);
    let mut from = vec![NEW; 2 * signals.node_count()];
    from[slot(start)] = slot(start);
    let mut queue = VecDeque::from([start]);
    while let Some(place) = queue.pop_front() {
        for next in after(signals, edge, place) {
            if next == start {
                let back = std::iter::successors(Some(slot(place)), |&at| (at != slot(start)).then(|| from[at]));
                let mut cycle: Vec<usize> = back.map(|at| at / 2).collect();
                cycle.reverse();
                return is_simple(&cycle).then(|| nodes(&cycle));
            }
            if from[slot(next)] == NEW {
                from[slot(next)] = slot(place);
                queue.push_back(next);
            }
        }
    }
    None
}

fn is_simple(cycle: &[usize]) -> bool {
    let mut sorted = cycle.to_vec();
    sorted.sort_unstable();
    sorted.windows(2).all(|pair| pair[0] != pair[1])
}

/// A signal, and whether an integral edge has been passed on the way to it.
type Place = (NodeId, bool);

/// Where one can go on to from a place on a way from a derivative edge: once through an integral edge.
fn after<'a>(signals: &'a SignalGraph, edge: &SignalEdge, (node, passed): Place) -> impl Iterator<Item = Place> + 'a {
    let back = (passed && node == edge.from).then_some((edge.to, false));
    let edges = if back.is_some() { &[][..] } else { signals.edges_from(node) };
    let allowed = edges.iter().filter(move |edge| match edge.kind {
        EdgeKind::Integral => !passed,
        EdgeKind::Derivative => false,
        _ => true,
    });
    back.into_iter().chain(allowed.map(move |edge| (edge.to, passed || edge.kind == EdgeKind::Integral)))
}

/// The signals that a derivative edge reaches: before an integral edge, and after it.
struct Layers<'a> {
    signals: &'a SignalGraph,
    edge: &'a SignalEdge,
    /// The first is what the derivative edge sets.
    places: Vec<Place>,
    index: BTreeMap<Place, usize>,
}

impl<'a> Layers<'a> {
    fn new(signals: &'a SignalGraph, edge: &'a SignalEdge) -> Self {
        let start = (edge.to, false);
        let mut layers = Layers { signals, edge, places: vec![start], index: BTreeMap::from([(start, 0)]) };
        let mut queue = VecDeque::from([start]);
        while let Some(place) = queue.pop_front() {
            for next in after(signals, edge, place) {
                if !layers.index.contains_key(&next) {
                    layers.index.insert(next, layers.places.len());
                    layers.places.push(next);
                    queue.push_back(next);
                }
            }
        }
        layers
    }

    fn successors(&self) -> Vec<Vec<u32>> {
        let heads = |&place: &Place| after(self.signals, self.edge, place).map(|next| self.index[&next] as u32);
        self.places.iter().map(|place| heads(place).collect()).collect()
    }
}
