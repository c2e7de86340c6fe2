//! What derivative causality says about a linear graph: the rank of its state matrix, controllability, observability.

use std::collections::BTreeSet;

use super::drawn::by_hand;
use super::ports::{CausalityPreferences, solve_part};
use super::signals::{NodeId, SignalGraph, signal_graph};
use super::strokes::parts;
use super::{CausalGraph, PortState, Role, Stroke};
use crate::algebra::{Expr, Exprs, Symbol};
use crate::bond_graph::{
    Bond, BondGraph, Element, ElementId, Kind, Meaning, Port, PortRef, ResistorLaw, StorageLaw, Variable,
};
use crate::ids::Id;

/// Rank of the state matrix `A` of a linear graph, read from causality: the number of independent storages less that of
/// the storages that stay in integral causality when derivative causality is preferred. The graph has a solution at rest
/// for every constant input, and `A` has no eigenvalue zero, exactly if no storage stays. Source: \[SD\].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StateRank {
    /// Number of independent storages, the order of `A`.
    pub order: usize,
    /// Rank of `A` at the given parameters.
    pub rank: usize,
    /// The storages that stay in integral causality, in the order of the graph.
    pub integral: Vec<PortRef>,
}

/// The rank of the state matrix; `None` if a law is not linear, or a modulus or value reads what varies with the state.
pub fn state_rank(causal: &CausalGraph) -> Option<StateRank> {
    let graph = &causal.graph;
    let mut x = graph.exprs.clone();
    is_linear(&mut x, graph).then(|| rank_of(x, graph, order(causal), &BTreeSet::new()))
}

/// What the structure says about inputs and outputs of a linear graph, for nearly all values of its parameters. Source:
/// \[SD\].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Reach {
    /// Number of independent storages.
    pub order: usize,
    /// The bond-graph rank: `order` less the number of storages that stay in integral causality where derivative causality
    /// is preferred and the inputs (or detectors) may turn round.
    pub rank: usize,
    /// The storages that stay.
    pub integral: Vec<PortRef>,
    /// Storages that no causal path joins to an input (or output).
    pub unattained: Vec<PortRef>,
}

impl Reach {
    /// Whether all states are reached: structurally controllable, or observable.
    pub fn is_whole(&self) -> bool {
        self.rank == self.order && self.unattained.is_empty()
    }
}

/// Structural controllability by these sources. `None` if the graph is not linear, or its strokes are not determined.
pub fn control_reach(causal: &CausalGraph, sources: &[ElementId]) -> Option<Reach> {
    let graph = &causal.graph;
    let mut x = graph.exprs.clone();
    if !is_linear(&mut x, graph) || !is_drawn(causal) {
        return None;
    }
    let freed = sources.iter().map(|&element| PortRef { element, port: 0 }).collect();
    let StateRank { order, rank, integral } = rank_of(x, graph, order(causal), &freed);
    let signals = signal_graph(graph, &by_hand(causal));
    let starts = sources.iter().map(|&source| {
        let bond = graph.elements[source].ports[0].bond;
        match graph.elements[source].kind {
            Kind::FlowSource { .. } => NodeId::flow(bond),
            _ => NodeId::effort(bond),
        }
    });
    let reached = reachable(signals.node_count(), starts, |v| heads(&signals, v));
    Some(Reach { order, rank, integral, unattained: missed(causal, &reached) })
}

/// Structural observability by these variables, efforts and flows of bonds. `None` if the graph is not linear, or its
/// strokes are not determined, or one of them is something else.
pub fn observe_reach(causal: &CausalGraph, outputs: &[Symbol]) -> Option<Reach> {
    let mut x = causal.graph.exprs.clone();
    if !is_linear(&mut x, &causal.graph) || !is_drawn(causal) {
        return None;
    }
    let mut graph = causal.graph.clone();
    let freed = outputs.iter().map(|&symbol| detect(&mut graph, symbol)).collect::<Option<_>>()?;
    let x = graph.exprs.clone();
    let StateRank { order, rank, integral } = rank_of(x, &graph, order(causal), &freed);
    let signals = signal_graph(&causal.graph, &by_hand(causal));
    let mut tails = vec![Vec::new(); signals.node_count()];
    for v in 0..signals.node_count() {
        heads(&signals, v).into_iter().for_each(|w| tails[w].push(v));
    }
    let starts = outputs.iter().filter_map(|s| match causal.graph.variables.get(s)?.meaning {
        Meaning::Effort(bond) => Some(NodeId::effort(bond)),
        Meaning::Flow(bond) => Some(NodeId::flow(bond)),
        _ => None,
    });
    let reached = reachable(signals.node_count(), starts, |v| tails[v].clone());
    Some(Reach { order, rank, integral, unattained: missed(causal, &reached) })
}

fn order(causal: &CausalGraph) -> usize {
    let independent = causal.ports.ports.iter().filter(|p| p.role == Role::Independent).count();
    independent + causal.ports.virtual_speeds.len()
}

/// The rank where derivative causality is preferred and the freed ports take whatever helps.
fn rank_of(mut x: Exprs, graph: &BondGraph, order: usize, freed: &BTreeSet<PortRef>) -> StateRank {
    let mut integral = Vec::new();
    for members in parts(graph) {
        let preferences = CausalityPreferences {
            derivative_first: true,
            sources_as_laws: freed.clone(),
            ..CausalityPreferences::default()
        };
        let solved = solve_part(&mut x, graph, &members, &preferences, None);
        let stays = |p: &&PortState| p.role == Role::Dependent;
        integral.extend(solved.ports.iter().filter(stays).map(|p| p.port));
    }
    integral.sort_unstable();
    StateRank { order, rank: order.saturating_sub(integral.len()), integral }
}

fn is_drawn(causal: &CausalGraph) -> bool {
    causal.graph.bonds.iter().all(|(bond, _)| causal.strokes[bond] != Stroke::Undetermined)
}

/// Puts a detector on a bond, at a junction of its own; its port.
fn detect(graph: &mut BondGraph, symbol: Symbol) -> Option<PortRef> {
    let (bond, effort) = match graph.variables.get(&symbol)?.meaning {
        Meaning::Effort(bond) => (bond, true),
        Meaning::Flow(bond) => (bond, false),
        _ => return None,
    };
    let Bond { from, to, .. } = graph.bonds[bond];
    // The end with a law keeps the bond, since the law reads its variables.
    let law = |end: PortRef| !graph.elements[end.element].kind.is_inner();
    let split_at_start = law(to) || !law(from);
    let number = graph.elements.len();
    let junction = ElementId::new(number);
    let detector = PortRef { element: ElementId::new(number + 1), port: 0 };
    let at = |port| PortRef { element: junction, port };
    let count = graph.bonds.len();
    let fresh =
        |x: &mut Exprs, k: usize, what: &str| x.symbol(&format!("detector{}.{what}", count + k), Default::default());
    let mut made: Vec<(PortRef, PortRef)> = Vec::new();
    match split_at_start {
        // from -> junction -> (own bond) -> to
        true => {
            graph.bonds[bond].from = at(1);
            made.push((from, at(0)));
        }
        // from -> (own bond) -> junction -> to
        false => {
            graph.bonds[bond].to = at(0);
            made.push((at(1), to));
        }
    }
    made.push((at(2), detector));
    let mut ids = Vec::new();
    for (k, &(from, to)) in made.iter().enumerate() {
        let (e, f) = (fresh(&mut graph.exprs, k, "e"), fresh(&mut graph.exprs, k, "f"));
        let new = Bond { from, to, name: String::new(), effort: e, flow: f, ..graph.bonds[bond].clone() };
        let id = graph.bonds.push(new);
        for (symbol, meaning) in [(e, Meaning::Effort(id)), (f, Meaning::Flow(id))] {
            graph.variables.insert(symbol, Variable { meaning, unit: None });
        }
        ids.push(id);
    }
    let outer = if split_at_start { from } else { to };
    graph.elements[outer.element].ports[outer.port as usize].bond = ids[0];
    let port = |bond, inward| Port { name: String::new(), bond, inward };
    let ports = match split_at_start {
        true => vec![port(ids[0], true), port(bond, false), port(ids[1], false)],
        false => vec![port(bond, true), port(ids[0], false), port(ids[1], false)],
    };
    let span = graph.bonds[bond].span;
    let element = |name: &str, kind, ports| Element {
        name: format!("{name}{number}"),
        kind,
        ports,
        span,
        label: "".into(),
        cell: None,
        component: "".into(),
        strand: None,
        carries: None,
    };
    let (inner, outer) = match effort {
        true => (Kind::Zero, Kind::EffortDetector),
        false => (Kind::One, Kind::FlowDetector),
    };
    graph.elements.push(element("split", inner, ports));
    graph.elements.push(element("detector", outer, vec![port(ids[1], true)]));
    Some(detector)
}

fn heads(signals: &SignalGraph, v: usize) -> Vec<usize> {
    signals.edges_from(NodeId::new(v)).iter().map(|edge| edge.to.index()).collect()
}

fn reachable(n: usize, starts: impl Iterator<Item = NodeId>, next: impl Fn(usize) -> Vec<usize>) -> Vec<bool> {
    let mut reached = vec![false; n];
    let mut open: Vec<usize> = starts.map(|node| node.index()).collect();
    while let Some(v) = open.pop() {
        if !std::mem::replace(&mut reached[v], true) {
            open.extend(next(v));
        }
    }
    reached
}

/// Independent storages neither of whose variables is reached.
fn missed(causal: &CausalGraph, reached: &[bool]) -> Vec<PortRef> {
    let graph = &causal.graph;
    let own = |port: PortRef| {
        let bond = graph.bond_of(port);
        [NodeId::effort(bond), NodeId::flow(bond)]
    };
    let independent = causal.ports.ports.iter().filter(|p| p.role == Role::Independent).map(|p| p.port);
    let storages = independent.filter(|&port| graph.storage_symbols(port).is_some());
    storages.filter(|&port| own(port).iter().any(|node| !reached[node.index()])).collect()
}

/// Whether all laws are linear with constant coefficients, and sources and moduli read no variable of the graph.
fn is_linear(x: &mut Exprs, graph: &BondGraph) -> bool {
    let constant = |x: &Exprs, e: Expr| {
        let parameter = |s: Symbol| matches!(graph.variables.get(&s).map(|v| v.meaning), Some(Meaning::Parameter(_)));
        x.symbols_of(e).into_iter().all(parameter)
    };
    let outside = |x: &Exprs, e: Expr| {
        let given = |s: Symbol| {
            let meaning = graph.variables.get(&s).map(|v| v.meaning);
            matches!(meaning, Some(Meaning::Parameter(_) | Meaning::Time | Meaning::Input(_)))
        };
        x.symbols_of(e).into_iter().all(given)
    };
    graph.elements.values().all(|element| {
        let bonds = element.ports.iter().map(|p| &graph.bonds[p.bond]);
        let mut variables: Vec<Symbol> = bonds.flat_map(|b| [b.effort, b.flow]).collect();
        let laws: Vec<Expr> = match &element.kind {
            kind @ (Kind::Transformer { .. }
            | Kind::Gyrator { .. }
            | Kind::MatrixTransformer(_)
            | Kind::MatrixGyrator(_)) => return kind.moduli().into_iter().all(|e| constant(x, e)),
            Kind::EffortSource { value } | Kind::FlowSource { value } => return outside(x, *value),
            Kind::ZeroCompliance { flow } => return outside(x, *flow),
            Kind::Resistor(laws) | Kind::SkewGyrator(laws) => laws
                .iter()
                .map(|law| match *law {
                    ResistorLaw::Resistive(e) | ResistorLaw::Conductive(e) | ResistorLaw::Implicit(e) => e,
                })
                .collect(),
            Kind::Inertance(storage) | Kind::Compliance(storage) => {
                variables.extend(&storage.stored);
                let known = storage.laws.iter().any(|l| matches!(l, StorageLaw::Known { .. }));
                if known {
                    return false;
                }
                storage
                    .laws
                    .iter()
                    .map(|law| match *law {
                        StorageLaw::Integral(e) | StorageLaw::Derivative(e) | StorageLaw::Implicit(e) => e,
                        StorageLaw::Known { law, .. } => law,
                    })
                    .collect()
            }
            Kind::ResidualEffort { residual } | Kind::ResidualFlow { residual } => residual.iter().copied().collect(),
            _ => Vec::new(),
        };
        laws.into_iter().all(|law| match x.linear_in(law, &variables) {
            Some((coefficients, rest)) => coefficients.into_iter().chain([rest]).all(|e| constant(x, e)),
            None => false,
        })
    })
}
