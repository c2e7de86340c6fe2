//! What decided the causality of each element.

use std::collections::BTreeSet;

use halfarrow_compiler::bond_graph::{BondGraph, Kind, PortCausality, PortRef, ResistorLaw};
use halfarrow_compiler::causal_graph::{CausalGraph, PortState, Role};

use crate::loops::LoopsReport;

/// A port of an element, its causality, and what decided it.
pub(super) struct Decided {
    /// The element, with the port of a field.
    pub name: String,
    /// Kind, as in the model.
    pub kind: &'static str,
    /// Its law, as the modeller wrote it.
    pub law: String,
    /// Its causality, in the words of the field.
    pub causality: String,
    /// What decided it.
    pub why: String,
}

/// Every port of an element, in the order of the model.
pub(super) fn decided(causal: &CausalGraph, loops: &LoopsReport) -> Vec<Decided> {
    let on_paths: BTreeSet<&str> = loops.paths.iter().flat_map(|p| &p.route).map(String::as_str).collect();
    let mut all: Vec<(PortRef, Decided)> =
        causal.ports.ports.iter().map(|state| (state.port, one(causal, loops, state, &on_paths))).collect();
    all.sort_by_key(|(port, _)| *port);
    all.into_iter().map(|(_, decided)| decided).collect()
}

fn one(causal: &CausalGraph, loops: &LoopsReport, state: &PortState, on_paths: &BTreeSet<&str>) -> Decided {
    let graph = &causal.graph;
    let element = &graph.elements[state.port.element];
    let forced = graph.forced_causality.iter().any(|f| f.port == state.port);
    let (causality, why) = match (&element.kind, state.role) {
        (_, Role::Source) => given(&element.kind),
        (_, Role::Redundant) => ("undetermined".to_string(), "repeats what others impose already".to_string()),
        (Kind::Inertance(_) | Kind::Compliance(_), role) => storage(graph, loops, state.port, role),
        (Kind::Resistor(laws), Role::Algebraic(causality)) => {
            let on_path = on_paths.contains(element.name.as_str());
            resistor(laws.get(state.port.port as usize), causality, on_path)
        }
        (_, Role::Algebraic(_)) => {
            ("a law between effort and flow".to_string(), "what it reads depends on what it sets".to_string())
        }
        _ => ("-".to_string(), String::new()),
    };
    let why = if forced { format!("forced by the model; {why}") } else { why };
    Decided {
        name: graph.port_name(state.port),
        kind: graph.word(state.port.element),
        law: element.label.to_string(),
        causality,
        why,
    }
}

fn given(kind: &Kind) -> (String, String) {
    let (sets, why) = match kind {
        Kind::EffortSource { .. } => ("sets the effort", "a source of effort can do nothing else"),
        Kind::FlowSource { .. } => ("sets the flow", "a source of flow can do nothing else"),
        Kind::ZeroCompliance { .. } => ("sets the flow", "a constraint holds its flow; its effort is the multiplier"),
        Kind::ResidualEffort { .. } => ("sets the effort", "the effort that makes its residual vanish"),
        Kind::ResidualFlow { .. } => ("sets the flow", "the flow that makes its residual vanish"),
        Kind::EffortDetector => ("reads the effort", "a detector takes no flow"),
        Kind::FlowDetector => ("reads the flow", "a detector takes no effort"),
        _ => ("is given", "its value is imposed"),
    };
    (sets.to_string(), why.to_string())
}

fn storage(graph: &BondGraph, loops: &LoopsReport, port: PortRef, role: Role) -> (String, String) {
    let name = graph.port_name(port);
    let told = loops.storages.iter().find(|s| s.name == name);
    let causality = told.map_or("-", |s| s.causality).to_string();
    let own = graph.storage_symbols(port).map(|(co_energy, _)| co_energy);
    let preferred = graph.preferences.iter().any(|p| Some(p.symbol) == own);
    let why = match (role, told.and_then(|s| s.follows.clone())) {
        (Role::Dependent, Some(follows)) => format!("follows from others: {follows}"),
        (Role::Dependent, None) => "follows from sources and other storages".to_string(),
        _ if preferred => "the model prefers it as an independent variable".to_string(),
        _ => "independent of the sources and of the storages before it".to_string(),
    };
    (causality, why)
}

fn resistor(law: Option<&ResistorLaw>, causality: PortCausality, on_path: bool) -> (String, String) {
    let sets = match causality {
        PortCausality::Resistive => "resistive: sets the effort",
        PortCausality::Conductive => "conductive: sets the flow",
        _ => "sets one of its variables",
    };
    let as_written = matches!(
        (law, causality),
        (Some(ResistorLaw::Resistive(_)), PortCausality::Resistive)
            | (Some(ResistorLaw::Conductive(_)), PortCausality::Conductive)
    );
    let why = match (law, on_path, as_written) {
        (Some(ResistorLaw::Implicit(_)), ..) => "its law is implicit: both variables are unknown",
        (_, true, true) => "it stands on a zero-order path and may set either: taken as its law is written",
        (_, true, false) => {
            "it stands on a zero-order path and may set either: so that few and well-sized loops are left"
        }
        (_, false, _) => "sources and storages leave it nothing else",
    };
    (sets.to_string(), why.to_string())
}
