//! Which variable stands for the common one of a junction.

use std::collections::BTreeSet;

use smallvec::SmallVec;

use super::builder::{Builder, Pair};
use super::constraint::Relation;
use super::flatten::{Flat, Word};
use super::structure::Structure;
use super::wire::Wiring;
use super::{Bond, BondGraph, BondId, ElementId, Kind, Meaning};
use crate::algebra::{Facts, Symbol};
use crate::ids::{Id, Map};

/// The 1-junction and the 0-junction that each bond stands for.
type Taken = Vec<[Option<u32>; 2]>;

/// The bond of each junction whose variable stands for the common one, by part: at a 1 that of an `I`, at a 0 that of a
/// `C`, else one inside the junction structure, else the first. `None` for other parts.
///
/// A bond between two junctions of one kind has the common variable of both, but what acts on one of them does not act
/// on the other. So each junction gets a bond of its own: a matching of junctions to bonds. Only where a cluster of
/// junctions touches nothing else two of them are left with one bond.
pub(super) fn representatives(flat: &Flat<'_>, wiring: &Wiring) -> Vec<Option<usize>> {
    let parts = 0..flat.parts.len();
    let candidates: Vec<SmallVec<[usize; 2]>> = parts.clone().map(|part| candidates(flat, wiring, part)).collect();
    let mut taken: Taken = vec![[None; 2]; wiring.wires.len()];
    for junction in parts {
        take(flat, &candidates, junction, &mut taken, &mut BTreeSet::new());
    }
    let mut common: Vec<Option<usize>> = candidates.iter().map(|wires| wires.first().copied()).collect();
    for (wire, junctions) in taken.iter().enumerate() {
        junctions.iter().flatten().for_each(|&junction| common[junction as usize] = Some(wire));
    }
    common
}

/// The bonds of a junction, the most welcome first.
fn candidates(flat: &Flat<'_>, wiring: &Wiring, junction: usize) -> SmallVec<[usize; 2]> {
    let word = flat.parts[junction].word;
    if !word.is_junction() {
        return SmallVec::new();
    }
    let favourite = if word == Word::One { Word::I } else { Word::C };
    let rank = |wire: &usize| {
        let w = &wiring.wires[*wire];
        let other = flat.parts[if w.from.0 == junction { w.to.0 } else { w.from.0 }].word;
        match other {
            _ if other == favourite => 0,
            _ if other.is_inner() => 1,
            _ => 2,
        }
    };
    let mut wires: SmallVec<[usize; 2]> = wiring.ports[junction].iter().flatten().map(|(wire, _)| *wire).collect();
    wires.sort_by_key(rank);
    wires
}

/// Gives a junction a bond that no other of its kind has, if need be by giving others another one.
fn take(
    flat: &Flat<'_>,
    candidates: &[SmallVec<[usize; 2]>],
    junction: usize,
    taken: &mut Taken,
    tried: &mut BTreeSet<usize>,
) -> bool {
    let zero = usize::from(flat.parts[junction].word == Word::Zero);
    for &wire in &candidates[junction] {
        if !tried.insert(wire) {
            continue;
        }
        let holder = taken[wire][zero];
        if holder.is_none_or(|other| take(flat, candidates, other as usize, taken, tried)) {
            taken[wire][zero] = Some(junction as u32);
            return true;
        }
    }
    false
}

impl Builder<'_, '_> {
    /// The common variable of a junction.
    pub fn common_variable(&self, junction: usize, effort: bool) -> Option<Symbol> {
        let wire = self.representative(junction)?;
        Some(match self.beyond.get(&wire) {
            Some(&(end, symbol)) if effort && end == junction => symbol,
            _ if effort => self.pairs[wire].effort,
            _ => self.pairs[wire].flow,
        })
    }

    /// The end of a bond without a 1-junction that a constraint on its flow leaves to a bond of its own: the drawn one
    /// stays at the element outside of the junction structure, whose variables have its name.
    pub fn left_end(&self, wire: usize) -> (usize, usize) {
        let w = &self.wiring.wires[wire];
        let inner = |end: (usize, usize)| self.part(end.0).word.is_inner();
        if inner(w.to) && !inner(w.from) { w.to } else { w.from }
    }

    /// Efforts of 0-junctions that a constraint parts from that of the bond which stands for them.
    pub fn make_parted(&mut self, parted: &BTreeSet<usize>) {
        for &wire in parted {
            let (junction, _) = self.left_end(wire);
            if self.part(junction).word == Word::Zero && self.representative(junction) == Some(wire) {
                let Pair { effort_in, .. } = self.pairs[wire].clone();
                let effort = self.fresh(&[&self.part(junction).name, ".e"].concat(), Facts::default());
                self.mean(effort, Meaning::Effort(Self::bond_id(wire)), effort_in);
                self.beyond.insert(wire, (junction, effort));
            }
        }
    }

    /// The bonds without a 1-junction whose flow a constraint reads: it acts between their ends.
    pub fn parted(&self, relations: &[Relation]) -> BTreeSet<usize> {
        let flows = relations.iter().flat_map(Relation::flows);
        let wires = flows.filter_map(|flow| match self.meaning(flow) {
            Some(Meaning::Flow(bond)) => Some(bond.index()),
            _ => None,
        });
        let one = |wire: usize| {
            let w = &self.wiring.wires[wire];
            [w.from, w.to].iter().any(|end| self.part(end.0).word == Word::One)
        };
        wires.filter(|&wire| !one(wire)).collect()
    }

    /// The bonds of all junctions, for the graph.
    pub fn common_bonds(&self) -> Map<ElementId, BondId> {
        let known = self.common.iter().enumerate();
        known.filter_map(|(part, wire)| Some((ElementId::new(part), Self::bond_id((*wire)?)))).collect()
    }
}

impl Structure {
    /// The same as [`BondGraph::junction_of`], of what becomes a graph.
    pub fn junction_of(&self, bond: BondId, flow: bool) -> Option<ElementId> {
        let Bond { from, to, .. } = &self.bonds[bond];
        junction_of(
            [from.element, to.element],
            |e| &self.elements[e].kind,
            |e| self.common.get(&e) == Some(&bond),
            flow,
        )
    }
}

/// Of the ends of a bond the junction whose common flow (or effort) it has, first of all the one for which it stands.
fn junction_of<'g>(
    ends: [ElementId; 2],
    kind: impl Fn(ElementId) -> &'g Kind,
    stands_for: impl Fn(ElementId) -> bool,
    flow: bool,
) -> Option<ElementId> {
    let fits = |e: &ElementId| matches!((kind(*e), flow), (Kind::One, true) | (Kind::Zero, false));
    let ends = ends.into_iter().filter(fits);
    ends.clone().find(|e| stands_for(*e)).or_else(|| ends.clone().next())
}

impl BondGraph {
    /// The element at the other end of a bond of this one.
    pub fn far_end(&self, bond: BondId, element: ElementId) -> ElementId {
        let bond = &self.bonds[bond];
        if bond.from.element == element { bond.to.element } else { bond.from.element }
    }

    /// The junction whose common flow (or effort) a bond has: of two that touch, the one for which it stands.
    pub fn junction_of(&self, bond: BondId, flow: bool) -> Option<ElementId> {
        let Bond { from, to, .. } = &self.bonds[bond];
        junction_of(
            [from.element, to.element],
            |e| &self.elements[e].kind,
            |e| self.common.get(&e) == Some(&bond),
            flow,
        )
    }
}
