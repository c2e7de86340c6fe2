//! The paper's inversion: storages on a zero-order path take derivative causality, so that the path disappears.
//!
//! Only their own strokes and those along the way to a resistor (or to another storage that is inverted too) turn.
//! Storages nearest to the paths go first; the fewest that leave the fewest break variables are kept inverted.
//! Source: `method.md`, section 4.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use super::dependent::{derivative_edges, gives_flow, shortest_of};
use crate::bond_graph::{BondGraph, BondId, ElementId, Kind, Port, PortRef};
use crate::causal_graph::break_set::{count, cyclic_components};
use crate::causal_graph::signals::{EdgeKind, NodeId, SignalGraph, signal_graph};
use crate::causal_graph::{CausalGraph, Stroke, in_order, kept_junctions};
use crate::ids::{Id, Table};

/// Work allowed: bonds looked at in all tries together, once for the turning of strokes and once for every storage in
/// derivative causality whose paths are looked for.
const BUDGET: usize = 10_000_000;
/// Distances from the paths at which storages are tried.
const RINGS: usize = 6;

/// Strokes of the inverted form.
#[derive(Debug, Clone)]
pub struct Inverted {
    /// The strokes.
    pub strokes: Table<BondId, Stroke>,
    /// The storage ports that were turned to derivative causality.
    pub ports: Vec<PortRef>,
}

/// How many equations the strokes leave beside those of the storages, then how many storages are inverted.
type Score = (usize, usize);

/// Turns storages on zero-order paths of classes 2 to 4 to derivative causality, as far as that removes such paths.
pub fn invert(causal: &CausalGraph) -> Inverted {
    let graph = &causal.graph;
    let signals = signal_graph(graph, &causal.strokes);
    let mut best = Inverted { strokes: causal.strokes.clone(), ports: Vec::new() };
    let mut score = score_of(graph, &best);
    let kept = kept_junctions(causal);
    let mut tries = Tries { graph, kept: &kept, start: &causal.strokes, left: BUDGET };
    let mut wanted = BTreeSet::new();
    for ring in rings(graph, &causal.strokes, &signals) {
        if score.0 == 0 {
            break;
        }
        wanted.extend(ring);
        if let Some((found, its_score)) = tries.attempt(&wanted)
            && its_score.0 < score.0
        {
            (best, score) = tries.fewer(found, its_score);
        }
    }
    best
}

/// Break variables, and storages in derivative causality whose path to one in integral causality is new.
fn score_of(graph: &BondGraph, inverted: &Inverted) -> Score {
    let signals = signal_graph(graph, &inverted.strokes);
    let breaks = count(&signals.algebraic_successors());
    let ours: BTreeSet<ElementId> = inverted.ports.iter().map(|port| port.element).collect();
    let edges = derivative_edges(&signals).into_iter().filter(|edge| ours.contains(&edge.element));
    let mixed = edges.filter(|edge| shortest_of(&signals, edge).is_some()).count();
    (breaks + mixed, inverted.ports.len())
}

/// Storage ports in integral causality by distance from the components of algebraic signals, through junction structure.
fn rings(graph: &BondGraph, strokes: &Table<BondId, Stroke>, signals: &SignalGraph) -> Vec<Vec<PortRef>> {
    let members: Vec<usize> = cyclic_components(&signals.algebraic_successors()).into_iter().flatten().collect();
    let forward = distances(signals.node_count(), &members, |v| structure_heads(signals, v));
    let mut tails = vec![Vec::new(); signals.node_count()];
    for v in 0..signals.node_count() {
        structure_heads(signals, v).into_iter().for_each(|w| tails[w].push(v));
    }
    let backward = distances(signals.node_count(), &members, |v| tails[v].clone());
    let mut rings: BTreeMap<usize, Vec<PortRef>> = BTreeMap::new();
    for place in graph.outer_ports() {
        let Some(flow_out) = gives_flow(graph, strokes, place) else { continue };
        let bond = graph.bond_of(place);
        let (output, input) = if flow_out {
            (NodeId::flow(bond), NodeId::effort(bond))
        } else {
            (NodeId::effort(bond), NodeId::flow(bond))
        };
        if is_integral(graph, place, flow_out) {
            let distance = forward.get(&input.index()).into_iter().chain(backward.get(&output.index())).min();
            distance.into_iter().for_each(|&d| rings.entry(d).or_default().push(place));
        }
    }
    rings.into_values().take(RINGS).collect()
}

fn is_integral(graph: &BondGraph, place: PortRef, flow_out: bool) -> bool {
    match graph.elements[place.element].kind {
        Kind::Inertance(_) => flow_out,
        Kind::Compliance(_) => !flow_out,
        _ => false,
    }
}

fn structure_heads(signals: &SignalGraph, v: usize) -> Vec<usize> {
    let edges = signals.edges_from(NodeId::new(v)).iter();
    edges.filter(|edge| edge.kind == EdgeKind::Structure).map(|edge| edge.to.index()).collect()
}

fn distances(n: usize, from: &[usize], next: impl Fn(usize) -> Vec<usize>) -> BTreeMap<usize, usize> {
    let mut distance: BTreeMap<usize, usize> = from.iter().map(|&v| (v, 0)).collect();
    let mut queue: VecDeque<usize> = from.iter().copied().collect();
    while let Some(v) = queue.pop_front() {
        let near = distance[&v] + 1;
        for w in next(v) {
            debug_assert!(w < n);
            distance.entry(w).or_insert_with(|| {
                queue.push_back(w);
                near
            });
        }
    }
    distance
}

/// Tries sets of storages, within a budget.
struct Tries<'a> {
    graph: &'a BondGraph,
    kept: &'a BTreeSet<ElementId>,
    start: &'a Table<BondId, Stroke>,
    left: usize,
}

impl Tries<'_> {
    /// Inverts as many of the wanted storages as can be; `None` when the budget is spent.
    fn attempt(&mut self, wanted: &BTreeSet<PortRef>) -> Option<(Inverted, Score)> {
        self.spend(1)?;
        let mut turner = Turner { graph: self.graph, kept: self.kept, strokes: self.start.clone() };
        for &place in wanted {
            let open = |end: PortRef, turner: &Turner| {
                turner.is_resistor(end) || wanted.contains(&end) && turner.is_integral(end)
            };
            if turner.is_integral(place) {
                turner.turn(place, open);
            }
        }
        let ports: Vec<PortRef> = wanted.iter().copied().filter(|&place| !turner.is_integral(place)).collect();
        self.spend(ports.len())?;
        let mut found = Inverted { strokes: turner.strokes, ports };
        let mut score = score_of(self.graph, &found);
        self.turn_resistors(&mut found, &mut score);
        Some((found, score))
    }

    fn spend(&mut self, tries: usize) -> Option<()> {
        self.left = self.left.checked_sub(tries * self.graph.bonds.len())?;
        Some(())
    }

    /// Turns pairs of resistors on paths as long as that removes break variables.
    fn turn_resistors(&mut self, found: &mut Inverted, score: &mut Score) {
        let mut improved = score.0 > 0;
        while improved {
            improved = false;
            for place in self.resistors_on_paths(&found.strokes) {
                for end in self.resistors_on_paths(&found.strokes) {
                    if place == end {
                        continue;
                    }
                    if self.spend(1 + found.ports.len()).is_none() {
                        return;
                    }
                    let mut turner = Turner { graph: self.graph, kept: self.kept, strokes: found.strokes.clone() };
                    if !turner.turn(place, |other, _| other == end) {
                        continue;
                    }
                    let other = Inverted { strokes: turner.strokes, ports: found.ports.clone() };
                    let its_score = score_of(self.graph, &other);
                    if its_score < *score {
                        (*found, *score, improved) = (other, its_score, true);
                    }
                }
            }
        }
    }

    fn resistors_on_paths(&self, strokes: &Table<BondId, Stroke>) -> Vec<PortRef> {
        let signals = signal_graph(self.graph, strokes);
        let members: BTreeSet<usize> =
            cyclic_components(&signals.algebraic_successors()).into_iter().flatten().collect();
        let on_path = |place: &PortRef| {
            let bond = self.graph.bond_of(*place);
            matches!(self.graph.elements[place.element].kind, Kind::Resistor(_) | Kind::SkewGyrator(_))
                && members.contains(&NodeId::effort(bond).index())
        };
        self.graph.outer_ports().into_iter().filter(on_path).collect()
    }

    /// Leaves out, farthest first, every storage that need not be inverted.
    fn fewer(&mut self, mut best: Inverted, mut score: Score) -> (Inverted, Score) {
        let mut wanted: BTreeSet<PortRef> = best.ports.iter().copied().collect();
        for place in best.ports.clone().into_iter().rev() {
            wanted.remove(&place);
            match self.attempt(&wanted) {
                Some((found, its_score)) if its_score <= score => (best, score) = (found, its_score),
                _ => {
                    wanted.insert(place);
                }
            }
        }
        (best, score)
    }
}

/// Turns strokes along a way through the junction structure, so that every junction and two-port stays in order.
pub(super) struct Turner<'a> {
    pub graph: &'a BondGraph,
    /// Junctions that no bond sets.
    pub kept: &'a BTreeSet<ElementId>,
    pub strokes: Table<BondId, Stroke>,
}

/// A bond that turns, and the end at which this must be made good.
type TurnedBond = (BondId, PortRef);

impl Turner<'_> {
    pub fn is_resistor(&self, place: PortRef) -> bool {
        matches!(self.graph.elements[place.element].kind, Kind::Resistor(_) | Kind::SkewGyrator(_))
    }

    pub fn is_integral(&self, place: PortRef) -> bool {
        gives_flow(self.graph, &self.strokes, place).is_some_and(|flow_out| is_integral(self.graph, place, flow_out))
    }

    /// Turns the bond at `start` and what follows from it, up to the nearest port that is `open`. Whether it could.
    pub fn turn(&mut self, start: PortRef, open: impl Fn(PortRef, &Turner) -> bool) -> bool {
        let first = (self.graph.bond_of(start), self.other_end(self.graph.bond_of(start), start));
        let mut parent: BTreeMap<TurnedBond, Option<TurnedBond>> = BTreeMap::from([(first, None)]);
        let mut queue = VecDeque::from([first]);
        while let Some(step) = queue.pop_front() {
            if !self.graph.elements[step.1.element].kind.is_inner() {
                if open(step.1, self) && self.apply(&parent, step) {
                    return true;
                }
                continue;
            }
            for next in self.consequences(step) {
                parent.entry(next).or_insert_with(|| {
                    queue.push_back(next);
                    Some(step)
                });
            }
        }
        false
    }

    fn other_end(&self, bond: BondId, end: PortRef) -> PortRef {
        let bond = &self.graph.bonds[bond];
        if bond.from == end { bond.to } else { bond.from }
    }

    /// What else can turn when a bond turns at an element of the junction structure.
    fn consequences(&self, (bond, end): TurnedBond) -> Vec<TurnedBond> {
        let element = &self.graph.elements[end.element];
        let sets = |port: &Port| match element.kind {
            Kind::Zero => self.effort_in(port),
            Kind::One => self.effort_in(port).map(|into| !into),
            _ => None,
        };
        let own = sets(&element.ports[end.port as usize]);
        let follows = |port: &Port| {
            let through = !matches!(element.kind, Kind::Zero | Kind::One);
            self.strokes[port.bond] != Stroke::Undetermined
                && (through || own == Some(true) || sets(port) == Some(true))
        };
        let ports = (0..element.ports.len() as u32).map(|port| PortRef { element: end.element, port });
        let others = ports.filter(|place| *place != end && element.ports[place.port as usize].bond != bond);
        let turning = others.filter(|place| follows(&element.ports[place.port as usize]));
        turning.map(|place| (self.graph.bond_of(place), self.other_end(self.graph.bond_of(place), place))).collect()
    }

    fn effort_in(&self, port: &Port) -> Option<bool> {
        match self.strokes[port.bond] {
            Stroke::Undetermined => None,
            Stroke::To => Some(port.inward),
            Stroke::From => Some(!port.inward),
        }
    }

    /// Turns the bonds on the way to `last`, if that leaves everything in order.
    fn apply(&mut self, parent: &BTreeMap<TurnedBond, Option<TurnedBond>>, last: TurnedBond) -> bool {
        let mut way = vec![last];
        while let Some(&Some(step)) = parent.get(way.last().expect("not empty")) {
            way.push(step);
        }
        let bonds: BTreeSet<BondId> = way.iter().map(|step| step.0).collect();
        if bonds.len() < way.len() {
            return false;
        }
        self.turn_over(&bonds);
        let met: BTreeSet<ElementId> = way.iter().map(|step| step.1.element).collect();
        let in_order = met.into_iter().all(|element| self.in_order(element));
        if !in_order {
            self.turn_over(&bonds);
        }
        in_order
    }

    fn turn_over(&mut self, bonds: &BTreeSet<BondId>) {
        for &bond in bonds {
            self.strokes[bond] = turned(self.strokes[bond]);
        }
    }

    fn in_order(&self, element: ElementId) -> bool {
        let kept = self.kept.contains(&element);
        let element = &self.graph.elements[element];
        let into = element.ports.iter().filter(|port| self.effort_in(port) == Some(true)).count();
        let out = element.ports.iter().filter(|port| self.effort_in(port) == Some(false)).count();
        in_order(&element.kind, into, out, kept)
    }
}

fn turned(stroke: Stroke) -> Stroke {
    match stroke {
        Stroke::From => Stroke::To,
        Stroke::To => Stroke::From,
        Stroke::Undetermined => Stroke::Undetermined,
    }
}
