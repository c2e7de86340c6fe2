//! Reactions that are not unique: what repeats others is given an effort (or flow) from outside, its share, so that all
//! reactions have values for each choice of the shares. Nothing else depends on them.

use super::{Role, assign_causality};
use crate::algebra::{Facts, Symbol};
use crate::bond_graph::{BondGraph, ElementId, Input, InputId, Kind, Meaning, Variable};
use crate::diagnostic::Diagnostics;

/// A graph in which what repeats others carries a share that an input gives.
#[derive(Debug, Clone)]
pub struct SharedReactions {
    /// The graph: sources of effort (or flow) in the place of constraints and sources that repeat others.
    pub graph: BondGraph,
    /// The shares, 0 by default.
    pub shares: Vec<InputId>,
    /// The reactions of all other constraints and sources, which follow from the shares.
    pub reactions: Vec<Symbol>,
}

/// Gives shares to the constraints and sources that repeat what others impose; `None` where none does.
///
/// # Errors
/// As [`assign_causality`].
pub fn shared_reactions(graph: &BondGraph) -> Result<Option<SharedReactions>, Diagnostics> {
    let causal = assign_causality(graph)?;
    let redundant = causal.ports.ports.iter().filter(|p| p.role == Role::Redundant).map(|p| p.port.element);
    let repeated = causal.ports.repeated.iter().map(|&c| graph.constraints[c].element);
    let mut elements: Vec<ElementId> =
        redundant.chain(repeated).filter(|&e| carries(&graph.elements[e].kind)).collect();
    elements.sort_unstable();
    elements.dedup();
    if elements.is_empty() {
        return Ok(None);
    }
    let mut shared = graph.clone();
    let mut shares = Vec::new();
    for element in elements {
        let gives_flow = matches!(shared.elements[element].kind, Kind::EffortSource { .. });
        let bond = &shared.bonds[shared.elements[element].ports[0].bond];
        let reaction = if gives_flow { bond.flow } else { bond.effort };
        let unit = shared.variables.get(&reaction).and_then(|v| v.unit.clone());
        let name = format!("{}.share", shared.elements[element].name);
        let symbol = shared.exprs.fresh(&name, Facts::default());
        let (value, default) = (shared.exprs.sym(symbol), shared.exprs.int(0));
        let span = shared.elements[element].span;
        let input = shared.inputs.push(Input { name, symbol, default, unit: unit.clone(), doc: String::new(), span });
        shared.variables.insert(symbol, Variable { meaning: Meaning::Input(input), unit });
        shared.elements[element].kind =
            if gives_flow { Kind::FlowSource { value } } else { Kind::EffortSource { value } };
        shares.push(input);
    }
    let given: Vec<Symbol> = shares.iter().map(|&i| shared.inputs[i].symbol).collect();
    let mut reactions = Vec::new();
    for element in shared.elements.values().filter(|e| carries(&e.kind)) {
        let bond = &shared.bonds[element.ports[0].bond];
        match element.kind {
            Kind::EffortSource { value } if !shared.exprs.depends_on_any(value, &|s| given.contains(&s)) => {
                reactions.push(bond.flow);
            }
            Kind::FlowSource { value } if shared.exprs.depends_on_any(value, &|s| given.contains(&s)) => {}
            Kind::FlowSource { .. } | Kind::ZeroCompliance { .. } => reactions.push(bond.effort),
            _ => {}
        }
    }
    Ok(Some(SharedReactions { graph: shared, shares, reactions }))
}

/// Whether an element has a reaction that may be shared.
fn carries(kind: &Kind) -> bool {
    matches!(kind, Kind::ZeroCompliance { .. } | Kind::FlowSource { .. } | Kind::EffortSource { .. })
}
