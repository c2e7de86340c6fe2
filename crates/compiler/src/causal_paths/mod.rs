//! Zero-order causal paths: found along the strokes, classed, with gain, break variables and components.
//! Source: `method.md`, section 3.

mod certificate;
mod counts;
mod cycles;
mod dependent;
mod determinant;
mod inverted;
pub(crate) mod numeric;
mod text;
mod trace;

pub use certificate::{Certificate, Opened, Refusal, certificate};
pub use counts::{Count, Counts, counts, eliminated_ports};
pub use inverted::{Inverted, invert};

use std::collections::BTreeSet;

use crate::algebra::{Expr, Exprs, Symbol};
use crate::bond_graph::{BondGraph, BondId, ElementId, PortRef};
use crate::causal_graph::CausalGraph;
use crate::causal_graph::break_set::{break_set, cyclic_components, restrict, shortest_cycle};
use crate::causal_graph::signals::{NodeId, SignalGraph, signal_graph};
use crate::ids::Id;
use trace::{Tracer, nodes, without_duals};

/// Paths listed in all unless more are asked for.
pub const CAP: usize = 100;

/// All that is known about the zero-order causal paths of a graph.
#[derive(Debug, Clone)]
pub struct CausalPaths {
    /// The paths, by class, then in the order of the graph.
    pub paths: Vec<Path>,
    /// Whether `paths` holds every simple path; if not, one for every break variable.
    pub complete: bool,
    /// The strongly connected components of the algebraic signals (classes 2 to 4).
    pub components: Vec<Component>,
    /// Storages drawn in derivative causality, each with the multiplier that the classical form adds for it.
    pub dependent: Vec<PortRef>,
    /// The pool that holds gains and determinants.
    pub exprs: Exprs,
}

/// One zero-order causal path.
#[derive(Debug, Clone)]
pub struct Path {
    /// 1 to 4, `method.md`, section 3.
    pub class: u8,
    /// What it runs between: storages (1), resistors (2, 3), junctions of the loop in order (4).
    pub elements: Vec<ElementId>,
    /// All elements that it meets, in order.
    pub route: Vec<ElementId>,
    /// The bonds in order, each with the variable that the path follows.
    pub signals: Vec<(BondId, Symbol)>,
    /// The loop gain.
    pub gain: Expr,
    /// The break variables of the minimum set that lie on it.
    pub breaks: Vec<Symbol>,
    /// Index into [`CausalPaths::components`] (classes 2 to 4).
    pub component: Option<usize>,
}

/// A strongly connected set of algebraic signals.
#[derive(Debug, Clone)]
pub struct Component {
    /// The signals, in the order of the graph.
    pub signals: Vec<Symbol>,
    /// A minimum set of break variables.
    pub breaks: Vec<Symbol>,
    /// Whether `breaks` is proven minimum; else `lower_bound` says how many are needed at least.
    pub exact: bool,
    /// A proven lower bound on the number of break variables.
    pub lower_bound: usize,
    /// The determinant of the component (Mason): product and sum of loop gains, 1 if there were no loop.
    pub determinant: Option<Expr>,
    /// Whether the determinant vanishes for all parameters, or at the given ones: the loop alone is singular.
    pub singular: bool,
}

/// The zero-order causal paths along the drawn strokes: all simple ones, or if there are more than [`CAP`] in all, one
/// for every break variable and one for every dependent storage.
///
/// Near-linear time where there are no cycles.
pub fn find_paths(causal: &CausalGraph) -> CausalPaths {
    find_paths_capped(causal, CAP)
}

/// As [`find_paths`], with a cap of one's own.
pub fn find_paths_capped(causal: &CausalGraph, cap: usize) -> CausalPaths {
    let graph = &causal.graph;
    let signals = signal_graph(graph, &causal.strokes);
    let mut exprs = graph.exprs.clone();
    let parts = Parts::new(&signals);
    let tracer = Tracer { graph, signals: &signals };
    let (complete, cycles) = all_cycles(&tracer, &parts, cap)
        .map_or_else(|| (false, one_cycle_each(&tracer, &parts)), |cycles| (true, cycles));
    let breaks: BTreeSet<NodeId> = parts.breaks.iter().flatten().copied().collect();
    let mut paths: Vec<Path> = cycles.storage.iter().map(|cycle| tracer.storage_path(cycle, &mut exprs)).collect();
    for cycle in &cycles.algebraic {
        paths.push(tracer.path(cycle, parts.of(cycle[0]), &breaks, &mut exprs));
    }
    paths.sort_by(|a, b| (a.class, &a.elements, &a.signals).cmp(&(b.class, &b.elements, &b.signals)));
    CausalPaths {
        paths,
        complete,
        components: parts.components(graph, &signals, &mut exprs),
        dependent: dependent::dependent_ports(graph, &causal.strokes),
        exprs,
    }
}

/// Cycles of signals, class 1 and the others apart.
struct PathCycles {
    storage: Vec<Vec<NodeId>>,
    algebraic: Vec<Vec<NodeId>>,
}

/// All cycles, or `None` if they make more than `cap` paths.
fn all_cycles(tracer: &Tracer, parts: &Parts, cap: usize) -> Option<PathCycles> {
    let mut storage = Vec::new();
    for edge in dependent::derivative_edges(tracer.signals) {
        let found = dependent::cycles_of(tracer.signals, edge, cap - storage.len());
        storage.extend(found.cycles.iter().map(|cycle| nodes(cycle)));
        if !found.complete {
            return None;
        }
    }
    // Every path of class 4 stands for two cycles.
    let mut raw = Vec::new();
    for members in &parts.members {
        let inside = restrict(&parts.successors, members);
        let found = cycles::simple_cycles(&inside, 2 * (cap - storage.len()) - raw.len());
        raw.extend(found.cycles.iter().map(|cycle| cycle.iter().map(|&v| NodeId::new(members[v])).collect()));
        if !found.complete {
            return None;
        }
    }
    let algebraic = without_duals(raw, tracer);
    (storage.len() + algebraic.len() <= cap).then_some(PathCycles { storage, algebraic })
}

/// One cycle for every break variable, one for every derivative edge.
fn one_cycle_each(tracer: &Tracer, parts: &Parts) -> PathCycles {
    let edges = dependent::derivative_edges(tracer.signals).into_iter();
    let storage = edges.filter_map(|edge| dependent::shortest_of(tracer.signals, edge)).collect();
    let mut raw = Vec::new();
    for (members, breaks) in parts.members.iter().zip(&parts.breaks) {
        let closed = |v: usize| breaks.contains(&NodeId::new(v)) || members.binary_search(&v).is_err();
        let through = |node: &NodeId| shortest_cycle(&parts.successors, node.index(), closed);
        raw.extend(breaks.iter().filter_map(through).map(|cycle| nodes(&cycle)));
    }
    PathCycles { storage, algebraic: without_duals(raw, tracer) }
}

/// The components of the algebraic signals, each with its break variables.
struct Parts {
    successors: Vec<Vec<u32>>,
    members: Vec<Vec<usize>>,
    breaks: Vec<BTreeSet<NodeId>>,
    proofs: Vec<(bool, usize)>,
    /// Component of each signal, where it has one.
    part_of: Vec<Option<usize>>,
}

impl Parts {
    fn new(signals: &SignalGraph) -> Parts {
        let successors = signals.algebraic_successors();
        let members = cyclic_components(&successors);
        let ranks = if members.is_empty() { Vec::new() } else { signals.break_ranks() };
        let (mut breaks, mut proofs) = (Vec::new(), Vec::new());
        let mut part_of = vec![None; signals.node_count()];
        for (number, part) in members.iter().enumerate() {
            part.iter().for_each(|&v| part_of[v] = Some(number));
            let inner_ranks: Vec<u8> = part.iter().map(|&v| ranks[v]).collect();
            let set = break_set(&restrict(&successors, part), &inner_ranks);
            breaks.push(set.vertices.iter().map(|&v| NodeId::new(part[v])).collect());
            proofs.push((set.exact, set.lower_bound));
        }
        Parts { successors, members, breaks, proofs, part_of }
    }

    /// The component of a signal on a cycle.
    fn of(&self, node: NodeId) -> usize {
        self.part_of[node.index()].expect("a cycle lies in a component")
    }

    fn components(&self, graph: &BondGraph, signals: &SignalGraph, exprs: &mut Exprs) -> Vec<Component> {
        let mut components = Vec::new();
        for ((members, breaks), &(exact, lower_bound)) in self.members.iter().zip(&self.breaks).zip(&self.proofs) {
            let (members, break_nodes) = (nodes(members), breaks.iter().copied().collect::<Vec<_>>());
            let determinant = determinant::determinant(signals, &members, &break_nodes, exprs);
            let singular = determinant::is_singular(signals, &members, determinant, exprs);
            components.push(Component {
                signals: members.iter().map(|node| node.symbol(graph)).collect(),
                breaks: break_nodes.iter().map(|node| node.symbol(graph)).collect(),
                exact,
                lower_bound,
                determinant,
                singular,
            });
        }
        components
    }
}
