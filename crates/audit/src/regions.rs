//! Regions: bonds joined by junctions, in which efforts add to efforts and flows to flows.

use halfarrow_compiler::bond_graph::{BondGraph, BondId, Kind};
use halfarrow_compiler::ids::Id;

/// Bonds in classes that are joined.
#[derive(Default)]
pub(crate) struct Classes {
    class: Vec<u32>,
    count: usize,
}

impl Classes {
    /// Bonds joined by the elements for which `joins` holds.
    pub fn new(graph: &BondGraph, joins: impl Fn(&Kind) -> bool) -> Classes {
        let mut leader: Vec<u32> = (0..graph.bonds.len() as u32).collect();
        for element in graph.elements.values().filter(|e| joins(&e.kind)) {
            for pair in element.ports.windows(2) {
                let (a, b) = (find(&mut leader, pair[0].bond.0), find(&mut leader, pair[1].bond.0));
                leader[a.max(b) as usize] = a.min(b);
            }
        }
        let (mut class, mut count) = (vec![0; leader.len()], 0);
        for bond in 0..leader.len() {
            let first = find(&mut leader, bond as u32) as usize;
            if first == bond {
                class[bond] = count;
                count += 1;
            } else {
                class[bond] = class[first];
            }
        }
        Classes { class, count: count as usize }
    }

    /// The class of a bond, by its number in the order of their first bonds.
    pub fn of(&self, bond: BondId) -> usize {
        self.class[bond.index()] as usize
    }

    /// How many there are.
    pub fn count(&self) -> usize {
        self.count
    }
}

/// The first bond of a class.
fn find(leader: &mut [u32], mut bond: u32) -> u32 {
    while leader[bond as usize] != bond {
        leader[bond as usize] = leader[leader[bond as usize] as usize];
        bond = leader[bond as usize];
    }
    bond
}
