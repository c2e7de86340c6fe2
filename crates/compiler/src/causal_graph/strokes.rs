//! Strokes: propagation of causality through the junction structure, with undo, and completion by matching.

use std::collections::BTreeSet;

use petgraph::algo::maximum_matching;
use petgraph::graph::{NodeIndex, UnGraph};

use super::Stroke;
use crate::bond_graph::{BondGraph, BondId, ElementId, Kind, PortCausality, PortRef};
use crate::ids::{Id, Table};

/// A partial assignment of strokes, closed under propagation element by element.
pub struct Strokes<'a> {
    graph: &'a BondGraph,
    /// Whether the stroke sits at the `to` end, once it is known.
    at_to: Table<BondId, Option<bool>>,
    /// Number of strokes that sit at each element, and number of bonds not yet set.
    here: Table<ElementId, u32>,
    open: Table<ElementId, u32>,
    /// Bonds at each element, those left out not counted.
    degree: Table<ElementId, u32>,
    left_out: BTreeSet<BondId>,
    /// Junctions whose common variable comes from none of their bonds.
    kept: BTreeSet<ElementId>,
    /// Bonds set or left out, in order.
    trail: Vec<BondId>,
}

/// Two demands on one element or bond cannot be met together.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Conflict {
    /// The bond is asked to have its stroke at both ends.
    Bond(BondId),
    /// The junction or two-port has no admissible set of strokes left.
    Element(ElementId),
}

impl<'a> Strokes<'a> {
    /// Nothing set yet.
    pub fn new(graph: &'a BondGraph) -> Self {
        let open: Table<ElementId, u32> = graph.elements.values().map(|e| e.ports.len() as u32).collect();
        Strokes {
            graph,
            at_to: Table::filled(graph.bonds.len(), None),
            here: Table::filled(graph.elements.len(), 0),
            degree: open.clone(),
            open,
            left_out: BTreeSet::new(),
            kept: BTreeSet::new(),
            trail: Vec::new(),
        }
    }

    /// Sets the stroke of a bond and all that follows. On conflict nothing has changed.
    pub fn set(&mut self, bond: BondId, at_to: bool) -> Result<(), Conflict> {
        let mark = self.trail.len();
        let mut work = Vec::new();
        let result = self.put(bond, at_to, &mut work).and_then(|()| self.propagate(work));
        if result.is_err() {
            self.undo(mark);
        }
        result
    }

    /// Sets the stroke of a bond so that it sits at this port's element (`here`) or at the other end.
    pub fn set_at(&mut self, port: PortRef, here: bool) -> Result<(), Conflict> {
        let (bond, inward) = self.end(port);
        self.set(bond, here == inward)
    }

    /// Takes the common variables of junctions as given from outside, as a source at each of them would, and sets all
    /// that follows. On conflict nothing has changed.
    pub fn keep(&mut self, junctions: &[ElementId]) -> Result<(), Conflict> {
        let (mark, before) = (self.trail.len(), self.kept.clone());
        self.kept.extend(junctions);
        let result = self.propagate(junctions.to_vec());
        if result.is_err() {
            self.undo(mark);
            self.kept = before;
        }
        result
    }

    /// Lets bonds set the common variables of these elements again.
    pub fn release(&mut self, members: &[ElementId]) {
        members.iter().for_each(|m| {
            self.kept.remove(m);
        });
    }

    /// The junctions among these elements whose common variable is given from outside.
    pub fn kept(&self, members: &[ElementId]) -> Vec<ElementId> {
        members.iter().copied().filter(|m| self.kept.contains(m)).collect()
    }

    /// Leaves a bond out: its flow circulates, and it takes no part in causality.
    pub fn leave_out(&mut self, bond: BondId) {
        if self.at_to[bond].is_none() && self.left_out.insert(bond) {
            self.trail.push(bond);
            for (element, _) in self.ends(bond) {
                self.open[element] -= 1;
                self.degree[element] -= 1;
            }
        }
    }

    /// Whether the stroke at a port sits at its element, once it is known.
    pub fn at(&self, port: PortRef) -> Option<bool> {
        let (bond, inward) = self.end(port);
        self.at_to[bond].map(|to| to == inward)
    }

    /// A mark to come back to with [`Strokes::undo`].
    pub fn mark(&self) -> usize {
        self.trail.len()
    }

    /// Forgets all that was set since the mark.
    pub fn undo(&mut self, mark: usize) {
        while self.trail.len() > mark {
            let bond = self.trail.pop().expect("longer than the mark");
            let Some(to) = self.at_to[bond].take() else {
                self.left_out.remove(&bond);
                for (element, _) in self.ends(bond) {
                    self.open[element] += 1;
                    self.degree[element] += 1;
                }
                continue;
            };
            for (element, end_is_to) in self.ends(bond) {
                self.open[element] += 1;
                self.here[element] -= u32::from(to == end_is_to);
            }
        }
    }

    /// Completes what propagation leaves open, such as rings, by a matching of junctions to bonds.
    ///
    /// `graph` of undecided links: every junction that lacks its one determining bond must claim one. A link whose ends
    /// claim it together is an edge of the matching; one that exactly one end claims is a vertex between them.
    pub fn complete(&mut self, members: &[ElementId]) -> Result<(), Conflict> {
        let mut vertices = UnGraph::<(), (BondId, bool)>::default();
        let mut vertex_of: Table<ElementId, Option<NodeIndex>> = Table::filled(self.graph.elements.len(), None);
        for &element in members {
            if self.open[element] > 0 && matches!(self.graph.elements[element].kind, Kind::Zero | Kind::One) {
                vertex_of[element] = Some(vertices.add_node(()));
            }
        }
        let mut middles = Vec::new();
        for &element in members {
            let Some(vertex) = vertex_of[element] else { continue };
            for (index, port) in self.graph.elements[element].ports.iter().enumerate() {
                if self.at_to[port.bond].is_some() || self.left_out.contains(&port.bond) {
                    continue;
                }
                let start = PortRef { element, port: index as u32 };
                let Some((end, same)) = self.follow(start, self.claiming(start)) else { continue };
                let Some(other) = vertex_of[end.element] else { continue };
                if end < start {
                    continue;
                }
                let claim = (port.bond, self.claiming(start) == port.inward);
                if same {
                    vertices.add_edge(vertex, other, claim);
                } else {
                    let middle = vertices.add_node(());
                    vertices.add_edge(vertex, middle, claim);
                    vertices.add_edge(middle, other, (claim.0, !claim.1));
                    middles.push((middle, claim));
                }
            }
        }
        let matching = maximum_matching(&vertices);
        for edge in matching.edges() {
            let edge = vertices.find_edge(edge.0, edge.1).expect("a matched pair is an edge");
            let (bond, at_to) = vertices[edge];
            if self.at_to[bond].is_none() {
                self.set(bond, at_to)?;
            }
        }
        for &element in members {
            for port in 0..self.graph.elements[element].ports.len() as u32 {
                let port = PortRef { element, port };
                let open = self.at(port).is_none() && !self.left_out.contains(&self.graph.bond_of(port));
                if open && self.graph.elements[element].kind.is_inner() {
                    let unclaimed = !self.claiming_or(port, true);
                    if self.set_at(port, unclaimed).is_err() {
                        self.set_at(port, !unclaimed)?;
                    }
                }
            }
        }
        Ok(())
    }

    /// The strokes as far as they are known.
    pub fn table(&self) -> Table<BondId, Stroke> {
        let stroke = |to: &Option<bool>| match to {
            Some(true) => Stroke::To,
            Some(false) => Stroke::From,
            None => Stroke::Undetermined,
        };
        self.at_to.values().map(stroke).collect()
    }

    /// Whether every bond of these elements has its stroke.
    pub fn is_complete(&self, members: &[ElementId]) -> bool {
        members.iter().all(|&m| self.open[m] == 0)
    }

    /// Where the stroke sits, seen from this junction, on the one bond that determines it.
    fn claiming(&self, port: PortRef) -> bool {
        matches!(self.graph.elements[port.element].kind, Kind::Zero)
    }

    fn claiming_or(&self, port: PortRef, other: bool) -> bool {
        match self.graph.elements[port.element].kind {
            Kind::Zero => true,
            Kind::One => false,
            _ => other,
        }
    }

    /// Follows a bond from a port through two-ports to the next junction: the port where it arrives, and whether a
    /// stroke that makes the start claim the link makes the end claim it too. `None` if it ends elsewhere.
    fn follow(&self, start: PortRef, here: bool) -> Option<(PortRef, bool)> {
        let mut port = start;
        let mut here = here;
        for _ in 0..self.graph.elements.len() {
            let far = self.opposite(port);
            let far_here = !here;
            match self.graph.elements[far.element].kind {
                Kind::Zero => return Some((far, far_here)),
                Kind::One => return Some((far, !far_here)),
                Kind::Transformer { .. } => here = !far_here,
                Kind::Gyrator { .. } => here = far_here,
                _ => return None,
            }
            port = PortRef { element: far.element, port: 1 - far.port };
        }
        None
    }

    fn opposite(&self, port: PortRef) -> PortRef {
        let bond = &self.graph.bonds[self.graph.bond_of(port)];
        if bond.to == port { bond.from } else { bond.to }
    }

    fn end(&self, port: PortRef) -> (BondId, bool) {
        let p = &self.graph.elements[port.element].ports[port.port as usize];
        (p.bond, p.inward)
    }

    fn ends(&self, bond: BondId) -> [(ElementId, bool); 2] {
        let b = &self.graph.bonds[bond];
        [(b.from.element, false), (b.to.element, true)]
    }

    fn put(&mut self, bond: BondId, at_to: bool, work: &mut Vec<ElementId>) -> Result<(), Conflict> {
        match self.at_to[bond] {
            Some(known) if known == at_to => Ok(()),
            Some(_) => Err(Conflict::Bond(bond)),
            None => {
                self.at_to[bond] = Some(at_to);
                self.trail.push(bond);
                for (element, end_is_to) in self.ends(bond) {
                    self.open[element] -= 1;
                    self.here[element] += u32::from(at_to == end_is_to);
                    work.push(element);
                }
                Ok(())
            }
        }
    }

    fn propagate(&mut self, mut work: Vec<ElementId>) -> Result<(), Conflict> {
        while let Some(element) = work.pop() {
            let Some(rest_here) = self.rule(element)? else { continue };
            for port in &self.graph.elements[element].ports {
                if self.at_to[port.bond].is_none() && !self.left_out.contains(&port.bond) {
                    self.put(port.bond, rest_here == port.inward, &mut work)?;
                }
            }
        }
        Ok(())
    }

    /// What follows at one element: where the strokes of all its open bonds must sit (here or not), if that is decided.
    fn rule(&self, element: ElementId) -> Result<Option<bool>, Conflict> {
        let ports = self.degree[element];
        let (here, open) = (self.here[element], self.open[element]);
        let away = ports - here - open;
        let one_of = |set: u32, sits_here: bool| match (set, open) {
            (0, 0) => Err(Conflict::Element(element)),
            (0, 1) => Ok(Some(sits_here)),
            (0, _) => Ok(None),
            (1, 0) => Ok(None),
            (1, _) => Ok(Some(!sits_here)),
            _ => Err(Conflict::Element(element)),
        };
        let none_of = |set: u32, sits_here: bool| match (set, open) {
            (0, 0) => Ok(None),
            (0, _) => Ok(Some(sits_here)),
            _ => Err(Conflict::Element(element)),
        };
        match self.graph.elements[element].kind {
            Kind::Zero if self.kept.contains(&element) => none_of(here, false),
            Kind::One if self.kept.contains(&element) => none_of(away, true),
            Kind::Zero => one_of(here, true),
            Kind::One => one_of(away, false),
            _ if ports < self.graph.elements[element].ports.len() as u32
                && !is_junction(&self.graph.elements[element].kind) =>
            {
                Ok(None)
            }
            Kind::Transformer { .. } => match (here, away, open) {
                (1, 0, 1) => Ok(Some(false)),
                (0, 1, 1) => Ok(Some(true)),
                (2, ..) | (_, 2, _) => Err(Conflict::Element(element)),
                _ => Ok(None),
            },
            Kind::Gyrator { .. } => match (here, away, open) {
                (1, 0, 1) => Ok(Some(true)),
                (0, 1, 1) => Ok(Some(false)),
                (1, 1, 0) => Err(Conflict::Element(element)),
                _ => Ok(None),
            },
            Kind::MatrixTransformer(ref m) => {
                let (rows, columns) = (m.rows as u32, m.columns as u32);
                match () {
                    () if here > rows || away > columns => Err(Conflict::Element(element)),
                    () if open == 0 => Ok(None),
                    () if here == rows => Ok(Some(false)),
                    () if away == columns => Ok(Some(true)),
                    () => Ok(None),
                }
            }
            Kind::MatrixGyrator(_) => match (here % 2, open) {
                (1, 0) => Err(Conflict::Element(element)),
                (odd, 1) => Ok(Some(odd == 1)),
                _ => Ok(None),
            },
            _ => Ok(None),
        }
    }
}

fn is_junction(kind: &Kind) -> bool {
    matches!(kind, Kind::Zero | Kind::One)
}

/// Whether the stroke of a port with this causality sits at its element, which is an `I` (or not).
pub fn sits_here(causality: PortCausality, inertance: bool) -> bool {
    match causality {
        PortCausality::Integral => inertance,
        PortCausality::Derivative => !inertance,
        PortCausality::Resistive => false,
        PortCausality::Conductive => true,
    }
}

/// The connected parts of a graph: the elements of each, in order.
pub fn parts(graph: &BondGraph) -> Vec<Vec<ElementId>> {
    let mut set = petgraph::unionfind::UnionFind::<usize>::new(graph.elements.len());
    for bond in graph.bonds.values() {
        set.union(bond.from.element.index(), bond.to.element.index());
    }
    let mut index = vec![usize::MAX; graph.elements.len()];
    let mut parts: Vec<Vec<ElementId>> = Vec::new();
    for element in graph.elements.ids() {
        let root = set.find(element.index());
        if index[root] == usize::MAX {
            index[root] = parts.len();
            parts.push(Vec::new());
        }
        parts[index[root]].push(element);
    }
    parts
}
