//! Regions: bonds joined by junctions, in which efforts add to efforts and flows to flows.

use halfarrow_compiler::bond_graph::{BondGraph, BondId, Kind};
use halfarrow_compiler::ids::Id;

/// Bonds in classes that are joined.
pub(crate) struct Classes {
    leader: Vec<usize>,
}

impl Classes {
    /// Bonds joined by the elements for which `joins` holds.
    pub fn new(graph: &BondGraph, joins: impl Fn(&Kind) -> bool) -> Classes {
        let mut classes = Classes { leader: (0..graph.bonds.len()).collect() };
        for element in graph.elements.values().filter(|e| joins(&e.kind)) {
            for pair in element.ports.windows(2) {
                let (a, b) = (classes.find(pair[0].bond.index()), classes.find(pair[1].bond.index()));
                classes.leader[a.max(b)] = a.min(b);
            }
        }
        for bond in 0..classes.leader.len() {
            classes.leader[bond] = classes.find(bond);
        }
        classes
    }

    /// The class of a bond: the index of its first bond.
    pub fn of(&self, bond: BondId) -> usize {
        self.leader[bond.index()]
    }

    fn find(&self, mut bond: usize) -> usize {
        while self.leader[bond] != bond {
            bond = self.leader[bond];
        }
        bond
    }
}
