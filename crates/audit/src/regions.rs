//! Regions: bonds joined by junctions, in which efforts add to efforts and flows to flows.

use crate::values::Values;
use halfarrow_compiler::bond_graph::{BondGraph, BondId, Kind};
use halfarrow_compiler::ids::{Id, Table};

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

/// The greatest effort and flow of each region during the run: rounding is measured against them.
pub(crate) struct Regions {
    efforts: Table<BondId, f64>,
    flows: Table<BondId, f64>,
}

impl Regions {
    pub fn new(graph: &BondGraph, values: &Values) -> Regions {
        let classes = Classes::new(graph, |kind| matches!(kind, Kind::Zero | Kind::One));
        let greatest = |of: &dyn Fn(BondId) -> Option<Vec<f64>>| {
            let mut most = vec![0.0f64; graph.bonds.len()];
            for bond in graph.bonds.ids() {
                let here = of(bond).unwrap_or_default().into_iter().fold(0.0f64, |most, v| most.max(v.abs()));
                let class = &mut most[classes.of(bond)];
                *class = class.max(here);
            }
            graph.bonds.ids().map(|bond| most[classes.of(bond)]).collect()
        };
        Regions {
            efforts: greatest(&|b| values.effort(b).map(<[f64]>::to_vec)),
            flows: greatest(&|b| values.flow(b).map(<[f64]>::to_vec)),
        }
    }

    pub fn effort(&self, bond: BondId) -> f64 {
        self.efforts[bond]
    }

    pub fn flow(&self, bond: BondId) -> f64 {
        self.flows[bond]
    }
}
