//! From a cycle of signals to a path: its class, what it runs between, its gain.

use std::collections::BTreeSet;

use super::Path;
use crate::algebra::{Expr, Exprs};
use crate::bond_graph::{BondGraph, ElementId, Kind};
use crate::causal_graph::signals::{EdgeKind, NodeId, SignalEdge, SignalGraph};
use crate::ids::Id;

/// Reads paths along the signals of a graph.
pub(super) struct Tracer<'a> {
    pub graph: &'a BondGraph,
    pub signals: &'a SignalGraph,
}

impl Tracer<'_> {
    /// The edges of a cycle: entry `i` leads to `cycle[i]`.
    fn edges(&self, cycle: &[NodeId]) -> Vec<&SignalEdge> {
        let before = |i: usize| cycle[(i + cycle.len() - 1) % cycle.len()];
        let edge = |i| self.signals.edge(before(i), cycle[i]).expect("a cycle runs along edges");
        (0..cycle.len()).map(edge).collect()
    }

    /// Whether these signals follow each other along edges. The dual of a cycle does not where an entry of an inverse is known
    /// to be 0 for one kind of variables alone.
    fn is_cycle(&self, cycle: &[NodeId]) -> bool {
        let before = |i: usize| cycle[(i + cycle.len() - 1) % cycle.len()];
        (0..cycle.len()).all(|i| self.signals.edge(before(i), cycle[i]).is_some())
    }

    /// Class 2, 3 or 4 of a cycle of algebraic edges.
    ///
    /// Class 4 if it stays inside the junction structure, 3 if it passes the law of one port only, else 2. A cycle
    /// through a value or modulus that reads another element counts as class 2.
    fn class(&self, edges: &[&SignalEdge]) -> u8 {
        let laws = edges.iter().map(|edge| match edge.kind {
            EdgeKind::Structure => 0,
            EdgeKind::Law => 1,
            _ => 2,
        });
        match laws.sum::<u32>() {
            0 => 4,
            1 => 3,
            _ => 2,
        }
    }

    /// The path of a cycle of algebraic edges, as [`without_duals`] gives it; `breaks` are all break variables.
    pub fn path(&self, cycle: &[NodeId], component: usize, breaks: &BTreeSet<NodeId>, exprs: &mut Exprs) -> Path {
        let class = self.class(&self.edges(cycle));
        let dual = if class == 4 { dual(cycle) } else { Vec::new() };
        let ends = |edge: &SignalEdge| {
            if class == 4 { self.is_junction(edge.element) } else { edge.kind != EdgeKind::Structure }
        };
        let start = self.start(cycle, ends);
        let cycle = rotated(cycle, start);
        let on_path = breaks.iter().filter(|node| cycle.contains(node) || dual.contains(node));
        Path {
            class,
            elements: self.ends(&cycle, ends),
            route: self.route(&cycle),
            signals: self.named(&cycle),
            gain: self.gain(&cycle, exprs),
            breaks: on_path.map(|node| node.symbol(self.graph)).collect(),
            component: Some(component),
        }
    }

    /// The path of a cycle through the storages of one derivative and one integral edge.
    pub fn storage_path(&self, cycle: &[NodeId], exprs: &mut Exprs) -> Path {
        let start = self.start(cycle, |edge| edge.kind == EdgeKind::Integral);
        let cycle = rotated(cycle, start);
        let rates = self.edges(&cycle).into_iter().filter(|edge| edge.kind == EdgeKind::Derivative);
        let breaks = rates.map(|edge| edge.to.symbol(self.graph)).collect();
        Path {
            class: 1,
            elements: self.ends(&cycle, |edge| !edge.kind.is_algebraic()),
            route: self.route(&cycle),
            signals: self.named(&cycle),
            gain: self.gain(&cycle, exprs),
            breaks,
            component: None,
        }
    }

    fn is_junction(&self, element: ElementId) -> bool {
        matches!(self.graph.elements[element].kind, Kind::Zero | Kind::One)
    }

    /// Where the element with the lowest id among the `ends` has just set its variable.
    fn start(&self, cycle: &[NodeId], ends: impl Fn(&SignalEdge) -> bool) -> usize {
        let edges = self.edges(cycle);
        let candidates = (0..cycle.len()).filter(|&i| ends(edges[i]));
        candidates.min_by_key(|&i| (edges[i].element, cycle[i])).unwrap_or(0)
    }

    /// The elements of the edges for which `ends` holds, each once, in order.
    fn ends(&self, cycle: &[NodeId], ends: impl Fn(&SignalEdge) -> bool) -> Vec<ElementId> {
        let edges = self.edges(cycle).into_iter().filter(|edge| ends(edge));
        let mut seen = BTreeSet::new();
        edges.map(|edge| edge.element).filter(|&element| seen.insert(element)).collect()
    }

    fn route(&self, cycle: &[NodeId]) -> Vec<ElementId> {
        let mut route: Vec<ElementId> = self.edges(cycle).into_iter().map(|edge| edge.element).collect();
        route.dedup();
        route
    }

    fn named(&self, cycle: &[NodeId]) -> Vec<(crate::bond_graph::BondId, crate::algebra::Symbol)> {
        cycle.iter().map(|node| (node.bond(), node.symbol(self.graph))).collect()
    }

    fn gain(&self, cycle: &[NodeId], exprs: &mut Exprs) -> Expr {
        let edges = self.edges(cycle);
        let gains: Vec<Expr> = edges.into_iter().map(|edge| self.signals.gain(edge, exprs)).collect();
        let product = exprs.mul(&gains);
        exprs.simplify(product)
    }
}

/// A cycle turned so that it starts at `start`.
fn rotated(cycle: &[NodeId], start: usize) -> Vec<NodeId> {
    cycle[start..].iter().chain(&cycle[..start]).copied().collect()
}

/// The cycle from its lowest signal.
fn canonical(cycle: &[NodeId]) -> Vec<NodeId> {
    let lowest = (0..cycle.len()).min_by_key(|&i| cycle[i]).unwrap_or(0);
    rotated(cycle, lowest)
}

/// The cycle of the conjugate variables, backwards.
fn dual(cycle: &[NodeId]) -> Vec<NodeId> {
    let backwards: Vec<NodeId> = cycle.iter().rev().map(|node| node.conjugate()).collect();
    canonical(&backwards)
}

/// Of a cycle inside the junction structure and its dual the one along efforts, or along more of them.
fn effort_turn(cycle: &[NodeId], tracer: &Tracer) -> Vec<NodeId> {
    let (cycle, dual) = (canonical(cycle), dual(cycle));
    if !tracer.is_cycle(&dual) {
        return cycle;
    }
    let efforts = |cycle: &[NodeId]| cycle.iter().filter(|node| node.is_effort()).count();
    match efforts(&cycle).cmp(&efforts(&dual)) {
        std::cmp::Ordering::Less => dual,
        std::cmp::Ordering::Equal if dual < cycle => dual,
        _ => cycle,
    }
}

/// Each cycle once; of a cycle inside the junction structure and its dual only the effort turn.
pub(super) fn without_duals(cycles: Vec<Vec<NodeId>>, tracer: &Tracer) -> Vec<Vec<NodeId>> {
    let turned = |cycle: Vec<NodeId>| {
        let inner = tracer.class(&tracer.edges(&cycle)) == 4;
        if inner { effort_turn(&cycle, tracer) } else { canonical(&cycle) }
    };
    let distinct: BTreeSet<Vec<NodeId>> = cycles.into_iter().map(turned).collect();
    distinct.into_iter().collect()
}

/// Signals by their indices.
pub(super) fn nodes(indices: &[usize]) -> Vec<NodeId> {
    indices.iter().map(|&index| NodeId::new(index)).collect()
}
