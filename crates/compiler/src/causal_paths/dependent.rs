//! Class 1: paths between a storage in derivative and one in integral causality.

use std::collections::{BTreeMap, VecDeque};

use super::cycles::{Cycles, cycles_through};
use super::trace::nodes;
use crate::bond_graph::{BondGraph, BondId, Kind, PortRef, Storage, StorageLaw};
use crate::causal_graph::Stroke;
use crate::causal_graph::break_set::shortest_cycle;
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

/// A shortest such cycle.
pub(super) fn shortest_of(signals: &SignalGraph, edge: &SignalEdge) -> Option<Vec<NodeId>> {
    let layers = Layers::new(signals, edge);
    let cycle = shortest_cycle(&layers.successors(), 0, |_| false)?;
    let cycle: Vec<usize> = cycle.into_iter().map(|v| layers.places[v].0.index()).collect();
    is_simple(&cycle).then(|| nodes(&cycle))
}

fn is_simple(cycle: &[usize]) -> bool {
    let mut sorted = cycle.to_vec();
    sorted.sort_unstable();
    sorted.windows(2).all(|pair| pair[0] != pair[1])
}

/// The signals that a derivative edge reaches: before an integral edge, and after it.
struct Layers<'a> {
    signals: &'a SignalGraph,
    edge: &'a SignalEdge,
    /// Signal, and whether an integral edge has been passed; the first is what the derivative edge sets.
    places: Vec<(NodeId, bool)>,
    index: BTreeMap<(NodeId, bool), usize>,
}

impl<'a> Layers<'a> {
    fn new(signals: &'a SignalGraph, edge: &'a SignalEdge) -> Self {
        let start = (edge.to, false);
        let mut layers = Layers { signals, edge, places: vec![start], index: BTreeMap::from([(start, 0)]) };
        let mut queue = VecDeque::from([start]);
        while let Some(place) = queue.pop_front() {
            for next in layers.after(place) {
                if !layers.index.contains_key(&next) {
                    layers.index.insert(next, layers.places.len());
                    layers.places.push(next);
                    queue.push_back(next);
                }
            }
        }
        layers
    }

    /// Where one can go on to from a place.
    fn after(&self, (node, passed): (NodeId, bool)) -> Vec<(NodeId, bool)> {
        if passed && node == self.edge.from {
            return vec![(self.edge.to, false)];
        }
        let edges = self.signals.edges_from(node).iter();
        let allowed = edges.filter(|edge| match edge.kind {
            EdgeKind::Integral => !passed,
            EdgeKind::Derivative => false,
            _ => true,
        });
        allowed.map(|edge| (edge.to, passed || edge.kind == EdgeKind::Integral)).collect()
    }

    fn successors(&self) -> Vec<Vec<u32>> {
        let heads = |&place: &(NodeId, bool)| self.after(place).iter().map(|next| self.index[next] as u32).collect();
        self.places.iter().map(heads).collect()
    }
}
