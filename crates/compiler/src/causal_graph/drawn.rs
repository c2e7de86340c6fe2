//! The ports with the causality of the strokes, element by element, and the ports with constraints left open: the starting
//! points of the formulations other than the minimal one. Source: `method.md`, section 4.

use std::collections::BTreeSet;

use super::assign::{preferred, sequential};
use super::by_size::better_by_size;
use super::digits;
use super::ports::{CausalityPreferences, Solved, Virtual, imposes_effort, solve_part_at_length};
use super::rules::{around, in_order, kept_in, kept_junctions, sits_at};
use super::signals::signal_graph;
use super::start_point::start_point;
use super::strokes::{Strokes, parts};
use super::{CausalGraph, PortState, Ports, Role, Stroke, break_set, local, two_ports};
use crate::algebra::{Assumptions, Exprs, NumericPoint, Symbol};
use crate::bond_graph::{BondGraph, BondId, Element, ElementId, Kind, PortCausality, PortRef};
use crate::ids::Table;

/// The graph with these strokes, its ports as drawn: roles by stroke, every bond variable defined by the element that
/// sets it. Such definitions can be cyclic (causal loops). Parts without a complete causality, and those in which a two-port
/// has a stroke by which it divides by zero at the start, keep the ports that elimination found, with their inputs and outputs.
pub fn as_drawn(causal: &CausalGraph, strokes: &Table<BondId, Stroke>) -> CausalGraph {
    let graph = &causal.graph;
    let mut x = graph.exprs.clone();
    x.forget_unwatched(&Assumptions::default());
    let mut ports = Ports::default();
    let drawn = |port: PortRef| sits_at(graph, strokes, port);
    let mut kept = BTreeSet::new();
    let speeds = kept_in(causal, strokes);
    // Looked for only where something is divided by.
    let mut start: Option<NumericPoint> = None;
    for members in parts(graph) {
        let assumed = x.assumed();
        let drawn_here =
            members.iter().all(|&m| is_drawn(graph, &speeds, &drawn, m)) && !turns_sources(causal, &members, &drawn);
        let own = |v: &&Virtual| speeds.contains(&v.junction) && members.binary_search(&v.junction).is_ok();
        let own: Vec<Virtual> = causal.ports.virtual_speeds.iter().filter(own).copied().collect();
        let local = drawn_here.then(|| local::definitions(&mut x, graph, &members, &drawn, &own));
        let mut vanishes = |d| digits::vanishes(&x, d, start.get_or_insert_with(|| start_point(&x, graph)));
        match local.filter(|(_, divisors)| !divisors.iter().any(|&d| vanishes(d))) {
            Some((definitions, divisors)) => {
                ports.ports.extend(local::roles(graph, &members, &drawn));
                ports.virtual_speeds.extend(own);
                ports.definitions.extend(definitions);
                ports.watched.extend(divisors);
            }
            None => {
                x.suppose(assumed);
                kept.extend(members);
            }
        }
    }
    if !kept.is_empty() {
        keep(causal, &kept, &mut ports);
        causal.ports.watched.iter().for_each(|&divisor| x.assume_nonzero(divisor));
        ports.watched.extend(&causal.ports.watched);
    }
    ports.ports.sort_by_key(|p| p.port);
    CausalGraph { graph: graph.with_exprs(x), strokes: strokes.clone(), ports }
}

/// Whether a source has the stroke of its conjugate variable: then the strokes do not show the causality of the ports.
fn turns_sources(causal: &CausalGraph, members: &[ElementId], drawn: local::Drawn) -> bool {
    local::roles(&causal.graph, members, drawn).iter().any(|state| {
        let truth = causal.ports.of(state.port).map(|p| p.role);
        matches!(truth, Some(Role::Source | Role::Redundant)) && state.role != Role::Source
    })
}

/// Whether all bonds of an element are drawn, by the rules; each equation of a wide two-port gives a variable.
fn is_drawn(graph: &BondGraph, kept: &BTreeSet<ElementId>, drawn: local::Drawn, element: ElementId) -> bool {
    let (here, away) = around(element, graph, drawn);
    let Element { kind, ports, .. } = &graph.elements[element];
    if here + away != ports.len() || !in_order(kind, here, away, kept.contains(&element)) {
        return false;
    }
    let sets_effort = |port: usize| drawn(PortRef { element, port: port as u32 }).map(|here| !here);
    match kind {
        Kind::MatrixTransformer(_) | Kind::MatrixGyrator(_) => {
            two_ports::given(&kind.two_port_rows(), &sets_effort).iter().all(Option::is_some)
        }
        _ => true,
    }
}

/// The ports of some elements as elimination found them, with all definitions behind them.
fn keep(causal: &CausalGraph, members: &BTreeSet<ElementId>, ports: &mut Ports) {
    let graph = &causal.graph;
    let own = |p: &&PortState| members.contains(&p.port.element);
    ports.ports.extend(causal.ports.ports.iter().filter(own).cloned());
    let inside = |bond: BondId| members.contains(&graph.bonds[bond].from.element);
    let bonds = graph.bonds.iter().filter(|(id, _)| inside(*id));
    let mut work: Vec<Symbol> = bonds.flat_map(|(_, b)| [b.effort, b.flow]).collect();
    work.extend(causal.ports.ports.iter().filter(own).map(|p| p.output));
    for v in causal.ports.virtual_speeds.iter().filter(|v| members.contains(&v.junction)) {
        ports.virtual_speeds.push(*v);
        work.push(v.reaction);
    }
    let undetermined = causal.ports.undetermined.iter().copied();
    let bonds: BTreeSet<Symbol> = work.iter().copied().collect();
    ports.undetermined.extend(undetermined.filter(|s| bonds.contains(s)));
    while let Some(symbol) = work.pop() {
        if let Some(row) = causal.ports.definitions.get(&symbol)
            && ports.definitions.insert(symbol, row.clone()).is_none()
        {
            work.extend(row.0.iter().map(|t| t.0));
        }
    }
}

/// The graph with its constraints taken out: zero compliances and residual sinks give an unknown and impose nothing, so
/// that no storage depends on another because of them. Those that repeat others are dropped, with effort (or flow) zero.
pub fn without_constraints(causal: &CausalGraph) -> CausalGraph {
    let graph = &causal.graph;
    let mut x = graph.exprs.clone();
    x.forget_unwatched(&Assumptions::default());
    let mut ports = Ports::default();
    let mut start = start_point(&x, graph);
    for members in parts(graph) {
        let solved = solve_open(&mut x, graph, &members, &preferences(causal, &members), &mut start);
        ports.ports.extend(solved.ports);
        ports.definitions.extend(solved.definitions);
        ports.watched.extend(solved.watched);
        ports.degenerate.extend(solved.degenerate);
        ports.undetermined.extend(solved.undetermined);
    }
    ports.ports.sort_by_key(|p| p.port);
    CausalGraph { graph: graph.with_exprs(x), strokes: causal.strokes.clone(), ports }
}

/// Solves a part with its constraints taken out; by the size of pivots where it would divide by zero at the start.
fn solve_open(
    x: &mut Exprs,
    graph: &BondGraph,
    members: &[ElementId],
    preferences: &CausalityPreferences,
    start: &mut NumericPoint,
) -> Solved {
    let before = x.assumed();
    let solved = solve_part_at_length(x, graph, members, preferences);
    let cost = digits::cost(x, graph, &solved, start);
    if cost < digits::COSTLY {
        return solved;
    }
    let with_solved = x.assumed();
    x.suppose(before);
    better_by_size(x, graph, members, preferences, start, (&solved, cost)).unwrap_or_else(|| {
        x.suppose(with_solved);
        solved
    })
}

fn preferences(causal: &CausalGraph, members: &[ElementId]) -> CausalityPreferences {
    let graph = &causal.graph;
    let mut preferences = CausalityPreferences::default();
    for state in causal.ports.ports.iter().filter(|p| members.binary_search(&p.port.element).is_ok()) {
        let kind = &graph.elements[state.port.element].kind;
        match (kind, state.role) {
            (Kind::ZeroCompliance { .. } | Kind::ResidualEffort { .. } | Kind::ResidualFlow { .. }, role) => {
                let gives_effort = !matches!(kind, Kind::ResidualFlow { .. });
                let causality = if gives_effort { PortCausality::Resistive } else { PortCausality::Conductive };
                preferences.algebraic.insert(state.port, causality);
                if role == Role::Redundant {
                    preferences.dropped.insert(state.port, gives_effort);
                } else {
                    preferences.sources_as_laws.insert(state.port);
                }
            }
            // A source that is a law to the exact causality stays one.
            (_, Role::Algebraic(causality)) => {
                preferences.algebraic.insert(state.port, causality);
                if imposes_effort(graph, state.port).is_some() {
                    preferences.sources_as_laws.insert(state.port);
                }
            }
            (_, Role::Independent) => preferences.independent.push(state.port),
            _ => {}
        }
    }
    preferences
}

/// Strokes with resistors first: each in the causality that leaves the fewest break variables, then the fewest storages
/// in derivative causality, among all resistors as written, all with flow in, all with effort in, and single changes to
/// these. Parts that cannot be drawn so keep their strokes.
pub fn resistors_first(causal: &CausalGraph) -> Table<BondId, Stroke> {
    let graph = &causal.graph;
    let mut table = causal.strokes.clone();
    let kept = kept_junctions(causal);
    for members in parts(graph) {
        // Where a flow circulates, strokes do not determine the causality.
        let drawn = |port: PortRef| sits_at(graph, &causal.strokes, port);
        if !members.iter().all(|&m| is_drawn(graph, &kept, &drawn, m)) {
            continue;
        }
        let relaxed = Relaxed { graph, members: &members, kept: &kept, laws: resistors(graph, &members) };
        if let Some(strokes) = relaxed.best() {
            for &element in &members {
                for port in &graph.elements[element].ports {
                    table[port.bond] = strokes[port.bond];
                }
            }
        }
    }
    table
}

/// Strokes as they are given by hand: sources, storages in integral causality in the order of the model, laws, each
/// followed by what it settles; no junction keeps a variable that none of its bonds sets. Parts without such junctions,
/// and parts that cannot be drawn so, have the strokes that they have.
pub fn by_hand(causal: &CausalGraph) -> Table<BondId, Stroke> {
    let graph = &causal.graph;
    let mut table = causal.strokes.clone();
    let kept = kept_junctions(causal);
    for members in parts(graph).iter().filter(|members| members.iter().any(|m| kept.contains(m))) {
        let Some(strokes) = sequential(graph, members) else { continue };
        for port in members.iter().flat_map(|&m| &graph.elements[m].ports) {
            table[port.bond] = strokes[port.bond];
        }
    }
    table
}

/// Parts with more resistors are not searched by single inversions.
const TURNED_SINGLY: usize = 40;

fn resistors(graph: &BondGraph, members: &[ElementId]) -> Vec<PortRef> {
    let laws = members.iter().filter(|&&m| matches!(graph.elements[m].kind, Kind::Resistor(_) | Kind::SkewGyrator(_)));
    laws.flat_map(|&element| {
        let ports = 0..graph.elements[element].ports.len() as u32;
        ports.map(move |port| PortRef { element, port })
    })
    .collect()
}

/// A part under relaxed assignment.
struct Relaxed<'a> {
    graph: &'a BondGraph,
    members: &'a [ElementId],
    kept: &'a BTreeSet<ElementId>,
    laws: Vec<PortRef>,
}

/// Break variables, then storages in derivative causality.
type Cost = (usize, usize);

impl Relaxed<'_> {
    fn best(&self) -> Option<Table<BondId, Stroke>> {
        if self.laws.is_empty() {
            return None;
        }
        let written: Vec<bool> =
            self.laws.iter().map(|&p| preferred(self.graph, p) == PortCausality::Conductive).collect();
        let all = |here| vec![here; self.laws.len()];
        let mut best: Option<(Cost, Vec<bool>, Table<BondId, Stroke>)> = None;
        let consider = |choice: Vec<bool>, best: &mut Option<(Cost, Vec<bool>, Table<BondId, Stroke>)>| {
            if let Some((cost, table)) = self.draw(&choice)
                && best.as_ref().is_none_or(|b| cost < b.0)
            {
                *best = Some((cost, choice, table));
            }
        };
        for choice in [written, all(true), all(false)] {
            consider(choice, &mut best);
        }
        for at in 0..self.laws.len().min(TURNED_SINGLY) {
            let Some((_, choice, _)) = &best else { break };
            let mut turned = choice.clone();
            turned[at] = !turned[at];
            consider(turned, &mut best);
        }
        best.map(|b| b.2)
    }

    /// Sources, then resistors as chosen where they can be, then storages.
    fn draw(&self, choice: &[bool]) -> Option<(Cost, Table<BondId, Stroke>)> {
        let graph = self.graph;
        let mut strokes = Strokes::new(graph);
        let kept: Vec<ElementId> = self.members.iter().copied().filter(|m| self.kept.contains(m)).collect();
        strokes.keep(&kept).ok()?;
        let outer = self.members.iter().filter(|&&m| !graph.elements[m].kind.is_inner());
        let ports: Vec<PortRef> = outer
            .flat_map(|&element| {
                (0..graph.elements[element].ports.len() as u32).map(move |port| PortRef { element, port })
            })
            .collect();
        for &port in &ports {
            if let Some(effort) = imposes_effort(graph, port) {
                strokes.set_at(port, !effort).ok()?;
            }
        }
        let either = |strokes: &mut Strokes, port: PortRef, here: bool| {
            strokes.at(port).is_some() || strokes.set_at(port, here).is_ok() || strokes.set_at(port, !here).is_ok()
        };
        let laws = self.laws.iter().copied().zip(choice.iter().copied());
        let storage = |p: &PortRef| match graph.elements[p.element].kind {
            Kind::Inertance(_) => Some((*p, true)),
            Kind::Compliance(_) => Some((*p, false)),
            _ => None,
        };
        for (port, here) in laws.chain(ports.iter().filter_map(storage)).chain(ports.iter().map(|&p| (p, false))) {
            if !either(&mut strokes, port, here) {
                return None;
            }
        }
        if !strokes.is_complete(self.members) {
            strokes.complete(self.members).ok()?;
        }
        let table = strokes.table();
        let drawn = |port: PortRef| strokes.at(port);
        if !self.members.iter().all(|&m| is_drawn(graph, self.kept, &drawn, m)) {
            return None;
        }
        let derivative = local::roles(graph, self.members, &drawn).iter().filter(|p| p.role == Role::Dependent).count();
        let breaks = break_set::count(&signal_graph(graph, &table).algebraic_successors());
        Some(((breaks, derivative), table))
    }
}
