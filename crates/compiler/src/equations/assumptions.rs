//! What the equations rest on of parameters that may change.

use std::collections::BTreeSet;

use crate::algebra::{Assumption, Exprs, Symbol};
use crate::bond_graph::BondGraph;

/// What was decided on the way to the equations by the values of parameters, as conditions on those that may change.
pub fn assumptions(x: &mut Exprs, graph: &BondGraph) -> Vec<Assumption> {
    let changing = changing(x, graph);
    x.assumptions(&|s| changing.contains(&s))
}

/// Parameters that may be set, and those and constants that follow from them.
fn changing(x: &Exprs, graph: &BondGraph) -> BTreeSet<Symbol> {
    let mut changing: BTreeSet<Symbol> = graph.parameters.values().filter(|p| !p.constant).map(|p| p.symbol).collect();
    loop {
        let follows = |p: &&crate::bond_graph::Parameter| x.depends_on_any(p.value, &|s| changing.contains(&s));
        let more: Vec<Symbol> = graph.parameters.values().filter(follows).map(|p| p.symbol).collect();
        let before = changing.len();
        changing.extend(more);
        if changing.len() == before {
            return changing;
        }
    }
}
