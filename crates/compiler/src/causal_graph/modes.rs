//! The mode in which a run begins: where most variables are free, so that all start values have their say.

use super::{CausalGraph, Role, assign_causality};
use crate::bond_graph::{BondGraph, Kind};

/// The same model in the mode from which its runs begin. Branches are changed one by one as long as that leaves more
/// variables independent; which mode holds at the start of a run is found there.
pub fn in_first_mode(graph: BondGraph) -> BondGraph {
    if graph.set_valued.is_empty() {
        return graph;
    }
    let storages = graph.elements.values().map(|e| match &e.kind {
        Kind::Inertance(s) | Kind::Compliance(s) => s.laws.len(),
        _ => 0,
    });
    let all = storages.sum();
    let mut best = freed(&graph);
    loop {
        let before = best.0;
        for law in 0..graph.set_valued.len() {
            for (branch, held) in graph.set_valued[law].branches.iter().enumerate() {
                if best.0 == Some(all) {
                    return graph.in_mode(&best.1);
                }
                if held.released.is_some() && best.0.is_some() {
                    continue;
                }
                let mut mode = best.1.clone();
                if std::mem::replace(&mut mode[law], branch) != branch {
                    let freedom = freedom(&graph.in_mode(&mode));
                    if freedom > best.0 {
                        best = (freedom, mode);
                    }
                }
            }
        }
        if best.0 == before {
            break;
        }
    }
    if best.0.is_none() {
        let both = (0..graph.set_valued.len()).flat_map(|a| (0..a).map(move |b| (b, a)));
        let changed = both.map(|(a, b)| {
            let mut mode = graph.mode();
            for law in [a, b] {
                mode[law] = graph.set_valued[law].branches.len() - 1;
            }
            (freedom(&graph.in_mode(&mode)), mode)
        });
        best = changed.chain([best]).max_by_key(|(freedom, _)| *freedom).expect("there is one at least");
    }
    graph.in_mode(&best.1)
}

/// The mode in which nothing is held that lets go under impulses, which leaves less free than what it lets go to.
fn freed(graph: &BondGraph) -> (Option<usize>, Vec<usize>) {
    let branches = graph.set_valued.iter().map(|law| law.branches[law.present].released.unwrap_or(law.present));
    let mode: Vec<usize> = branches.collect();
    (freedom(&graph.in_mode(&mode)), mode)
}

/// How many variables are independent in a mode, on storages and without one, as speeds of joints are; `None` if its parts
/// contradict each other or a law has no reaction.
fn freedom(graph: &BondGraph) -> Option<usize> {
    let causal: CausalGraph = assign_causality(graph).ok()?;
    let mut free = causal.ports.virtual_speeds.len();
    for state in &causal.ports.ports {
        match state.role {
            Role::Independent => free += 1,
            Role::Redundant if graph.set_valued.iter().any(|law| law.element == state.port.element) => return None,
            _ => {}
        }
    }
    Some(free)
}
