//! How many equations the classical and the inverted form have.

use std::collections::{BTreeMap, BTreeSet};

use super::CausalPaths;
use super::dependent::{dependent_ports, derivative_edges, gives_flow, has_state, shortest_of};
use super::inverted::{Inverted, invert};
use super::numeric::{Row, rank, sample};
use crate::algebra::Exprs;
use crate::bond_graph::{BondGraph, BondId, Element, ElementId, Kind, PortRef};
use crate::causal_graph::break_set::break_set;
use crate::causal_graph::signals::{EdgeKind, NodeId, SignalEdge, SignalGraph, signal_graph};
use crate::causal_graph::{CausalGraph, Stroke, kept_in, kept_junctions};
use crate::ids::{Id, Table};

/// Numbers of differential and algebraic equations.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Count {
    /// Rank of the matrix that multiplies the derivatives.
    pub differential: usize,
    /// The equations beyond that.
    pub algebraic: usize,
}

/// Counts of the forms that follow from the causal paths. Integrated signals and kinematics are not counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Counts {
    /// Break variables and multipliers beside all storages.
    pub break_form: Count,
    /// The paper's inversion.
    pub inverted: Count,
}

/// The counts, at the given parameters.
pub fn counts(causal: &CausalGraph, paths: &CausalPaths) -> Counts {
    let breaks: usize = paths.components.iter().map(|component| component.breaks.len()).sum();
    let multipliers = multipliers(&causal.graph, &causal.strokes);
    let speeds = kept_junctions(causal).len();
    let break_form = Count {
        differential: state_ports(&causal.graph).len(),
        algebraic: paths.dependent.len() + breaks + multipliers + speeds,
    };
    Counts { break_form, inverted: inverted_count(causal, paths, multipliers) }
}

/// The ports of storages that integrate.
fn state_ports(graph: &BondGraph) -> Vec<PortRef> {
    let integrates = |place: &PortRef| match &graph.elements[place.element].kind {
        Kind::Inertance(storage) | Kind::Compliance(storage) => has_state(storage, *place),
        _ => false,
    };
    graph.outer_ports().into_iter().filter(integrates).collect()
}

/// Unknowns that residual sinks and effort-imposing zero compliances add.
fn multipliers(graph: &BondGraph, strokes: &Table<BondId, Stroke>) -> usize {
    let adds = |place: &PortRef| match graph.elements[place.element].kind {
        Kind::ResidualEffort { .. } | Kind::ResidualFlow { .. } => true,
        Kind::ZeroCompliance { .. } => gives_flow(graph, strokes, *place) == Some(false),
        _ => false,
    };
    graph.outer_ports().iter().filter(|place| adds(place)).count()
}

fn inverted_count(causal: &CausalGraph, paths: &CausalPaths, multipliers: usize) -> Count {
    let graph = &causal.graph;
    let inverted = invert(causal);
    let signals = signal_graph(graph, &inverted.strokes);
    let set = break_set(&signals.algebraic_successors(), &signals.break_ranks());
    let breaks: Vec<NodeId> = set.vertices.iter().map(|&v| NodeId::new(v)).collect();
    let eliminated = eliminated(graph, &paths.dependent, &inverted, &signals);
    let kept: Vec<PortRef> = state_ports(graph).into_iter().filter(|place| !eliminated.contains(place)).collect();
    let speeds: Vec<ElementId> = kept_in(causal, &inverted.strokes).into_iter().collect();
    let equations = kept.len() + breaks.len() + multipliers + speeds.len();
    let columns = kept.iter().copied().zip(0..).collect();
    let mut system = System { graph, columns, speeds, exprs: graph.exprs.clone() };
    let rates = system.dependent_rates(causal, &inverted, &signals, &eliminated, paths);
    let differential = rank(system.rows(&signals, &breaks, &kept, &rates));
    Count { differential, algebraic: equations - differential }
}

/// Storages that do not stay as unknowns of the inverted form: those drawn in derivative causality before, and those
/// that the inversion has made dependent on one in integral causality.
pub fn eliminated_ports(causal: &CausalGraph, inverted: &Inverted) -> BTreeSet<PortRef> {
    let before = dependent_ports(&causal.graph, &causal.strokes);
    eliminated(&causal.graph, &before, inverted, &signal_graph(&causal.graph, &inverted.strokes))
}

/// Storages that do not stay as unknowns: those drawn in derivative causality before, and those that the inversion has
/// made dependent on one in integral causality.
fn eliminated(graph: &BondGraph, before: &[PortRef], inverted: &Inverted, signals: &SignalGraph) -> BTreeSet<PortRef> {
    let mixed: BTreeSet<ElementId> = derivative_edges(signals)
        .into_iter()
        .filter(|edge| shortest_of(signals, edge).is_some())
        .map(|edge| edge.element)
        .collect();
    let ours = |place: &PortRef| before.contains(place) || mixed.contains(&place.element);
    dependent_ports(graph, &inverted.strokes).into_iter().filter(ours).collect()
}

/// What multiplies the derivatives of the kept storages' co-energy variables, then of the variables that junctions keep
/// without a storage, one column each.
struct System<'a> {
    graph: &'a BondGraph,
    columns: BTreeMap<PortRef, usize>,
    speeds: Vec<ElementId>,
    exprs: Exprs,
}

impl System<'_> {
    /// The rows of the equations of the inverted form: storages, then break variables.
    fn rows(
        &mut self,
        signals: &SignalGraph,
        breaks: &[NodeId],
        kept: &[PortRef],
        rates: &BTreeMap<NodeId, Row>,
    ) -> Vec<Row> {
        let cut: BTreeSet<NodeId> = breaks.iter().copied().collect();
        let nodes = |place: &PortRef| storage_nodes(self.graph, *place);
        let reactions: Vec<Vec<(NodeId, f64)>> = self.speeds.iter().map(|&j| self.reaction(j)).collect();
        let storages = kept.iter().map(nodes).flat_map(|(z, rate)| [z, rate]);
        let wanted: Vec<NodeId> =
            storages.chain(cut.clone()).chain(reactions.iter().flatten().map(|term| term.0)).collect();
        let sources = self.rate_sources(signals, rates);
        let arriving = self.propagate(signals, &sources, &cut, &wanted, false);
        let integrals = incoming(signals, EdgeKind::Integral);
        let mut rows = Vec::new();
        for place in kept {
            let (z, _) = storage_nodes(self.graph, *place);
            let Some(edges) = integrals.get(&z) else {
                rows.push(arriving.get(&z).cloned().unwrap_or_default());
                continue;
            };
            let mut row = Row::from([(self.columns[place], 1.0)]);
            for edge in edges {
                let gain = self.gain(signals, edge);
                arriving.get(&edge.from).into_iter().for_each(|from| add(&mut row, from, -gain));
            }
            rows.push(row);
        }
        rows.extend(breaks.iter().map(|node| arriving.get(node).cloned().unwrap_or_default()));
        for terms in reactions {
            let mut row = Row::new();
            for (node, sign) in terms {
                arriving.get(&node).into_iter().for_each(|from| add(&mut row, from, sign));
            }
            rows.push(row);
        }
        rows
    }

    /// What the bonds of a junction add up to, where the junction keeps its variable without a storage.
    fn reaction(&self, junction: ElementId) -> Vec<(NodeId, f64)> {
        let element = &self.graph.elements[junction];
        let sign = |inward: bool| if inward { 1.0 } else { -1.0 };
        element.ports.iter().map(|p| (common(&element.kind, p.bond).conjugate(), sign(p.inward))).collect()
    }

    /// What storages in derivative causality set: their inertance or compliance times the rate of their co-energy.
    fn rate_sources(&mut self, signals: &SignalGraph, rates: &BTreeMap<NodeId, Row>) -> BTreeMap<NodeId, Row> {
        let mut sources: BTreeMap<NodeId, Row> = BTreeMap::new();
        for edge in derivative_edges(signals) {
            if let Some(rate) = rates.get(&edge.from) {
                let gain = self.gain(signals, edge);
                add(sources.entry(edge.to).or_default(), rate, gain);
            }
        }
        sources
    }

    /// Rates of all co-energy variables by those of the kept storages.
    fn dependent_rates(
        &mut self,
        causal: &CausalGraph,
        inverted: &Inverted,
        signals: &SignalGraph,
        eliminated: &BTreeSet<PortRef>,
        paths: &CausalPaths,
    ) -> BTreeMap<NodeId, Row> {
        let unit =
            |(place, column): (&PortRef, &usize)| (storage_nodes(self.graph, *place).0, Row::from([(*column, 1.0)]));
        let mut rates: BTreeMap<NodeId, Row> = self.columns.iter().map(unit).collect();
        for (&junction, column) in self.speeds.iter().zip(self.columns.len()..) {
            let Element { kind, ports, .. } = &self.graph.elements[junction];
            rates.extend(ports.iter().map(|p| (common(kind, p.bond), Row::from([(column, 1.0)]))));
        }
        let (drawn, turned): (Vec<PortRef>, Vec<PortRef>) =
            eliminated.iter().partition(|place| !inverted.ports.contains(place) && paths.dependent.contains(place));
        let before = signal_graph(self.graph, &causal.strokes);
        for (signals, places) in [(&before, drawn), (signals, turned)] {
            let wanted: Vec<NodeId> = places.iter().map(|place| storage_nodes(self.graph, *place).0).collect();
            let set = break_set(&signals.algebraic_successors(), &signals.break_ranks());
            let cut = set.vertices.iter().map(|&v| NodeId::new(v)).collect();
            let found = self.propagate(signals, &rates.clone(), &cut, &wanted, true);
            rates.extend(wanted.into_iter().map(|node| (node, found.get(&node).cloned().unwrap_or_default())));
        }
        rates
    }

    /// What arrives at the wanted signals from the sources along algebraic edges, nothing coming out of the cut ones.
    /// If the sources are `imposed`, nothing adds to them.
    fn propagate(
        &mut self,
        signals: &SignalGraph,
        sources: &BTreeMap<NodeId, Row>,
        cut: &BTreeSet<NodeId>,
        wanted: &[NodeId],
        imposed: bool,
    ) -> BTreeMap<NodeId, Row> {
        let mut tails: BTreeMap<NodeId, Vec<&SignalEdge>> = BTreeMap::new();
        for edge in signals.edges.iter().filter(|edge| edge.kind.is_algebraic()) {
            tails.entry(edge.to).or_default().push(edge);
        }
        let mut known: BTreeMap<NodeId, Row> = BTreeMap::new();
        let mut stack: Vec<(NodeId, bool)> = wanted.iter().map(|&node| (node, false)).collect();
        while let Some((node, ready)) = stack.pop() {
            if known.contains_key(&node) {
                continue;
            }
            let ends = imposed && sources.contains_key(&node);
            let edges = tails.get(&node).filter(|_| !ends).map_or(&[][..], |edges| edges);
            let open = edges.iter().filter(|edge| !cut.contains(&edge.from));
            if !ready {
                stack.push((node, true));
                stack.extend(open.filter(|edge| !known.contains_key(&edge.from)).map(|edge| (edge.from, false)));
                continue;
            }
            let mut row = sources.get(&node).cloned().unwrap_or_default();
            for edge in open {
                let gain = self.gain(signals, edge);
                known.get(&edge.from).into_iter().for_each(|from| add(&mut row, from, gain));
            }
            known.insert(node, row);
        }
        known
    }

    fn gain(&mut self, signals: &SignalGraph, edge: &SignalEdge) -> f64 {
        let gain = signals.gain(edge, &mut self.exprs);
        sample(&self.exprs, gain)
    }
}

fn add(row: &mut Row, other: &Row, factor: f64) {
    for (&column, entry) in other {
        *row.entry(column).or_insert(0.0) += factor * entry;
    }
}

/// Edges of one kind by what they set.
fn incoming(signals: &SignalGraph, kind: EdgeKind) -> BTreeMap<NodeId, Vec<&SignalEdge>> {
    let mut edges: BTreeMap<NodeId, Vec<&SignalEdge>> = BTreeMap::new();
    for edge in signals.edges.iter().filter(|edge| edge.kind == kind) {
        edges.entry(edge.to).or_default().push(edge);
    }
    edges
}

/// The common variable of a junction at one of its bonds.
fn common(kind: &Kind, bond: BondId) -> NodeId {
    if matches!(kind, Kind::Zero) { NodeId::effort(bond) } else { NodeId::flow(bond) }
}

/// Co-energy variable and rate of a storage port.
fn storage_nodes(graph: &BondGraph, place: PortRef) -> (NodeId, NodeId) {
    let bond = graph.bond_of(place);
    match graph.elements[place.element].kind {
        Kind::Inertance(_) => (NodeId::flow(bond), NodeId::effort(bond)),
        _ => (NodeId::effort(bond), NodeId::flow(bond)),
    }
}
