//! The certificate of an inversion: which storage opens which path, and why no other opens what is left.

use std::collections::{BTreeSet, VecDeque};
use std::fmt;

use super::counts::eliminated_ports;
use super::dependent::gives_flow;
use super::inverted::{Inverted, Turner};
use super::{CausalPaths, find_paths};
use crate::algebra::Symbol;
use crate::bond_graph::{BondGraph, BondId, ElementId, Kind, PortRef, ResistorLaw};
use crate::causal_graph::signals::{EdgeKind, NodeId, SignalGraph, signal_graph};
use crate::causal_graph::{CausalGraph, Stroke, kept_in};
use crate::ids::Table;

/// What was inverted for what, and what could not be.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Certificate {
    /// The inverted storages.
    pub inverted: Vec<Opened>,
    /// Storages that follow from others once the strokes are turned, and are no unknowns.
    pub eliminated: Vec<PortRef>,
    /// Break variables that no storage removes.
    pub left: Vec<Symbol>,
    /// The storages that could not remove them, each with the reason.
    pub refused: Vec<(PortRef, Refusal)>,
}

/// A storage in derivative causality, and the paths that it opens.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Opened {
    /// The storage.
    pub port: PortRef,
    /// Class of each path, and what it ran between.
    pub paths: Vec<(u8, Vec<ElementId>)>,
}

/// Why a storage does not open a path.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Refusal {
    /// No way from it to a resistor can be turned: a junction would have two setters or none.
    NoWay,
    /// The law of this element cannot be written for the other variable, which it would have to set.
    LawNotInvertible(ElementId),
    /// The paths that are left would have no unique solution: their determinant is zero.
    DeterminantZero,
    /// It can be turned, but as many break variables and equations are left as before.
    NoGain,
    /// The modulus of this element would read its rate.
    ModulusOfRate(ElementId),
    /// It follows from the others already.
    Dependent,
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Refusal::NoWay => "no way from it to a resistor can be turned",
            Refusal::LawNotInvertible(_) => "a law that it would turn cannot be inverted",
            Refusal::DeterminantZero => "the paths left would have the determinant zero",
            Refusal::NoGain => "its inversion leaves as many break variables",
            Refusal::ModulusOfRate(_) => "a modulus would be a function of its rate",
            Refusal::Dependent => "it follows from others already",
        })
    }
}

/// Says why the inversion is as it is.
pub fn certificate(causal: &CausalGraph, inverted: &Inverted) -> Certificate {
    let graph = &causal.graph;
    let before = find_paths(causal);
    let turned = CausalGraph { graph: graph.clone(), strokes: inverted.strokes.clone(), ports: causal.ports.clone() };
    let after = find_paths(&turned);
    let eliminated = eliminated_ports(causal, inverted);
    let left: Vec<Symbol> = after.components.iter().flat_map(|c| c.breaks.iter().copied()).collect();
    let refused = if left.is_empty() { Vec::new() } else { refusals(causal, inverted, &eliminated) };
    Certificate {
        inverted: opened(causal, inverted, &before, &after),
        eliminated: eliminated.into_iter().collect(),
        left,
        refused,
    }
}

/// Which paths are gone, by the inverted storage whose turned bonds they ran along.
fn opened(causal: &CausalGraph, inverted: &Inverted, before: &CausalPaths, after: &CausalPaths) -> Vec<Opened> {
    let still: BTreeSet<BTreeSet<Symbol>> =
        after.paths.iter().map(|p| p.signals.iter().map(|s| s.1).collect()).collect();
    let gone: Vec<_> = before
        .paths
        .iter()
        .filter(|p| p.class > 1 && !still.contains(&p.signals.iter().map(|s| s.1).collect()))
        .collect();
    let changed = |bond: BondId| causal.strokes[bond] != inverted.strokes[bond];
    let one = |&port: &PortRef| {
        let way = way_of(&causal.graph, port, &changed);
        let along = gone.iter().filter(|p| p.signals.iter().any(|(bond, _)| way.contains(bond)));
        Opened { port, paths: along.map(|p| (p.class, p.elements.clone())).collect() }
    };
    inverted.ports.iter().map(one).collect()
}

/// The turned bonds that hang together with that of a storage.
fn way_of(graph: &BondGraph, port: PortRef, changed: &dyn Fn(BondId) -> bool) -> BTreeSet<BondId> {
    let start = graph.bond_of(port);
    let (mut way, mut queue) = (BTreeSet::from([start]), VecDeque::from([start]));
    while let Some(bond) = queue.pop_front() {
        for end in [graph.bonds[bond].from, graph.bonds[bond].to] {
            let element = &graph.elements[end.element];
            for next in element.ports.iter().filter(|_| element.kind.is_inner()).map(|p| p.bond) {
                if changed(next) && way.insert(next) {
                    queue.push_back(next);
                }
            }
        }
    }
    way
}

/// Why no further storage removes a break variable.
fn refusals(causal: &CausalGraph, inverted: &Inverted, eliminated: &BTreeSet<PortRef>) -> Vec<(PortRef, Refusal)> {
    let graph = &causal.graph;
    let signals = signal_graph(graph, &inverted.strokes);
    let kept = kept_in(causal, &inverted.strokes);
    let mut refused = Vec::new();
    for port in graph.outer_ports() {
        let storage = matches!(graph.elements[port.element].kind, Kind::Inertance(_) | Kind::Compliance(_));
        if !storage || inverted.ports.contains(&port) || gives_flow(graph, &inverted.strokes, port).is_none() {
            continue;
        }
        if eliminated.contains(&port) {
            refused.push((port, Refusal::Dependent));
            continue;
        }
        let mut turner = Turner { graph, kept: &kept, strokes: inverted.strokes.clone() };
        if !turner.is_integral(port) {
            continue;
        }
        let reason = match modulus_reading(graph, &signals, port) {
            Some(element) => Refusal::ModulusOfRate(element),
            None if !turner.turn(port, |end, turner| turner.is_resistor(end)) => Refusal::NoWay,
            None => match bent_law(graph, &inverted.strokes, &turner.strokes) {
                Some(element) => Refusal::LawNotInvertible(element),
                None if is_singular(causal, turner.strokes) => Refusal::DeterminantZero,
                None => Refusal::NoGain,
            },
        };
        refused.push((port, reason));
    }
    refused
}

/// A resistor whose port turns, with a law that cannot be written for what it would set then.
fn bent_law(graph: &BondGraph, before: &Table<BondId, Stroke>, after: &Table<BondId, Stroke>) -> Option<ElementId> {
    let mut x = graph.exprs.clone();
    graph.outer_ports().into_iter().filter(|&port| before[graph.bond_of(port)] != after[graph.bond_of(port)]).find_map(
        |port| {
            let (Kind::Resistor(laws) | Kind::SkewGyrator(laws)) = &graph.elements[port.element].kind else {
                return None;
            };
            let bond = &graph.bonds[graph.bond_of(port)];
            let sets_flow = gives_flow(graph, after, port)?;
            let wanted = if sets_flow { bond.flow } else { bond.effort };
            let zero = match (*laws.get(port.port as usize)?, sets_flow) {
                (ResistorLaw::Resistive(_), false) | (ResistorLaw::Conductive(_), true) => return None,
                (ResistorLaw::Resistive(effort), true) => {
                    let own = x.sym(bond.effort);
                    x.sub(effort, own)
                }
                (ResistorLaw::Conductive(flow), false) => {
                    let own = x.sym(bond.flow);
                    x.sub(flow, own)
                }
                (ResistorLaw::Implicit(zero), _) => zero,
            };
            x.solve_for(zero, wanted).is_none().then_some(port.element)
        },
    )
}

/// Whether a component of paths with these strokes has the determinant zero.
fn is_singular(causal: &CausalGraph, strokes: Table<BondId, Stroke>) -> bool {
    let turned = CausalGraph { graph: causal.graph.clone(), strokes, ports: causal.ports.clone() };
    find_paths(&turned).components.iter().any(|component| component.singular)
}

/// The transformer or gyrator whose modulus reads a variable of this storage at once.
fn modulus_reading(graph: &BondGraph, signals: &SignalGraph, port: PortRef) -> Option<ElementId> {
    let bond = graph.bond_of(port);
    let own = [NodeId::effort(bond), NodeId::flow(bond)];
    let reading = signals.edges.iter().filter(|e| e.kind == EdgeKind::Modulation && own.contains(&e.from));
    reading.map(|e| e.element).find(|&e| graph.elements[e].kind.is_inner())
}
