//! Controllability and observability: by the rank of matrices, and by causal paths.

use halfarrow_compiler::algebra::{Node, Symbol};
use halfarrow_compiler::bond_graph::{BondGraph, ElementId, Kind, Meaning};
use halfarrow_compiler::causal_graph::{CausalGraph, Reach, control_reach, observe_reach};
use serde::Serialize;

use crate::error::Error;
use crate::model::Model;

use super::state_space::StateSpace;

/// Controllability or observability.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ReachReport {
    /// Number of states.
    pub order: usize,
    /// Rank of the matrices at the given parameters: how many combinations of states are reached or seen.
    pub rank: Option<usize>,
    /// What causal paths say, for nearly all parameters: bond-graph rank.
    pub structural_rank: Option<usize>,
    /// Independent storages, the order that the structural rank refers to.
    pub structural_order: Option<usize>,
    /// Storages that stay in integral causality.
    pub integral: Vec<String>,
    /// Storages that no causal path joins to an input (or output).
    pub unattained: Vec<String>,
    /// Why causal paths say nothing, or why the two ranks differ.
    pub note: Option<String>,
}

impl Model {
    /// What inputs reach and what outputs see.
    pub(super) fn reaches(
        &self,
        (system, n): (Option<StateSpace>, usize),
        inputs: &[String],
        outputs: &[String],
    ) -> Result<(ReachReport, ReachReport), Error> {
        let causal = self.causal_graph()?;
        let control = system.as_ref().map(|system| system.transposed().seen());
        let observe = system.map(StateSpace::seen);
        let sources = sources_of(&causal.graph, inputs);
        let by_paths = sources.as_ref().and_then(|sources| control_reach(&causal, sources));
        let seen = variables_of(&causal.graph, outputs);
        let by_views = seen.as_ref().and_then(|seen| observe_reach(&causal, seen));
        let why = |found: bool, what: &str| match found {
            false => format!("causal paths say nothing: {what}"),
            true => {
                "causal paths say nothing: the graph is not linear, or a modulus or source reads its variables".into()
            }
        };
        let control_why = why(sources.is_some(), "an input acts elsewhere than through the value of a source");
        let observe_why = why(seen.is_some(), "an output is no single effort, flow or stored quantity");
        Ok((report(&causal, n, control, by_paths, control_why), report(&causal, n, observe, by_views, observe_why)))
    }
}

fn report(causal: &CausalGraph, order: usize, rank: Option<usize>, reach: Option<Reach>, why: String) -> ReachReport {
    let names = |ports: &[_]| ports.iter().map(|&port| causal.graph.port_name(port)).collect();
    let Some(reach) = reach else {
        let nothing = ReachReport {
            order,
            rank,
            structural_rank: None,
            structural_order: None,
            integral: Vec::new(),
            unattained: Vec::new(),
            note: Some(why),
        };
        return nothing;
    };
    let structural = reach.rank.min(reach.order - reach.unattained.len().min(reach.order));
    let note = match rank {
        _ if reach.order != order => Some(format!(
            "{} independent storages, {order} states: integrated signals and conserved quantities make the difference",
            reach.order
        )),
        Some(rank) if rank < structural => {
            Some(
                "the rank is lower than the structure allows: the given parameters are special, or so far apart in size that rounding hides it"
                    .into(),
            )
        }
        Some(rank) if rank > structural => Some(
            "the rank is higher than causal paths promise: their condition is sufficient, not necessary, here".into(),
        ),
        _ => None,
    };
    ReachReport {
        order,
        rank,
        structural_rank: Some(structural),
        structural_order: Some(reach.order),
        integral: names(&reach.integral),
        unattained: names(&reach.unattained),
        note,
    }
}

/// The sources whose values read the inputs; `None` if an input acts elsewhere as well.
fn sources_of(graph: &BondGraph, inputs: &[String]) -> Option<Vec<ElementId>> {
    let symbols: Vec<Symbol> = graph.inputs.values().filter(|i| inputs.contains(&i.name)).map(|i| i.symbol).collect();
    let reads = |e| graph.exprs.symbols_of(e).iter().any(|s| symbols.contains(s));
    let mut sources = Vec::new();
    for (id, element) in graph.elements.iter() {
        match &element.kind {
            Kind::EffortSource { value } | Kind::FlowSource { value } if reads(*value) => sources.push(id),
            Kind::ZeroCompliance { flow } if reads(*flow) => return None,
            kind if kind.moduli().into_iter().any(reads) => return None,
            _ => {}
        }
    }
    let elsewhere = graph.signals.values().any(|s| reads(s.rate));
    (!elsewhere && !sources.is_empty()).then_some(sources)
}

/// The efforts and flows that the outputs are, up to a factor; `None` if one is something else.
fn variables_of(graph: &BondGraph, outputs: &[String]) -> Option<Vec<Symbol>> {
    outputs.iter().map(|name| variable_of(graph, name)).collect()
}

fn variable_of(graph: &BondGraph, name: &str) -> Option<Symbol> {
    let declared = graph.outputs.iter().chain(&graph.lets).find(|o| o.name == name);
    let symbol = match declared {
        Some(output) => match graph.exprs.node(output.value) {
            Node::Symbol(symbol) => *symbol,
            _ => *graph
                .exprs
                .symbols_of(output.value)
                .first()
                .filter(|_| graph.exprs.symbols_of(output.value).len() == 1)?,
        },
        None => graph.exprs.find_symbol(name)?,
    };
    match graph.variables.get(&symbol)?.meaning {
        Meaning::Effort(_) | Meaning::Flow(_) => Some(symbol),
        // What is stored is seen where its co-energy variable is.
        Meaning::Stored(port) => graph.storage_symbols(port).map(|pair| pair.0),
        _ => None,
    }
}
