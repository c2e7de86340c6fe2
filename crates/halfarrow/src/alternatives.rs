//! The same model with other variables independent, derived while it runs.

use std::collections::BTreeMap;
use std::sync::Arc;

use halfarrow_compiler::algebra::Symbol;
use halfarrow_compiler::bond_graph::{BondGraph, Kind, Named, Preference};
use halfarrow_compiler::causal_graph::assign_causality;
use halfarrow_compiler::diagnostic::Diagnostics;
use halfarrow_compiler::equations::{Equations, Form, derive_equations, derive_minimal};
use halfarrow_compiler::ids::Map;
use halfarrow_compiler::program::{Program, schedule};
use halfarrow_compiler::span::Span;
use halfarrow_exec as exec;

/// The bond graph of which programs are made.
#[derive(Debug)]
pub(crate) struct Alternatives {
    graph: Arc<BondGraph>,
    form: Form,
    /// How many states constants stand for, at most, in the branches of the start.
    conserved: usize,
}

impl Alternatives {
    /// Programs of `graph` that go on where one stops that has no states but those of the graph.
    pub fn of_form(graph: &Arc<BondGraph>, form: Form) -> Alternatives {
        Alternatives { graph: Arc::clone(graph), form, conserved: 0 }
    }

    /// Programs of `graph` that go on where one of these equations stops. What these have as states and the graph does not,
    /// sums of stored quantities, has a value in all of them.
    pub fn new(graph: &Arc<BondGraph>, first: &Equations) -> Alternatives {
        let mut graph = Arc::clone(graph);
        for &(symbol, meaning) in &first.meanings {
            let Some(state) = first.states.iter().find(|s| s.symbol == symbol) else { continue };
            if graph.outputs.iter().chain(&graph.lets).any(|named| named.name == state.name) {
                continue;
            }
            let graph = Arc::make_mut(&mut graph);
            if let Some(value) = graph.exprs.taken_from(&first.graph.exprs, meaning) {
                graph.lets.push(Named {
                    name: state.name.clone(),
                    value,
                    unit: state.unit.clone(),
                    unit_is_written: false,
                    doc: String::new(),
                    span: state.span,
                });
            }
        }
        Alternatives { graph, form: first.form, conserved: first.conserved.len() }
    }
}

/// What is said first, in a line.
fn first(faults: &Diagnostics) -> String {
    faults.0.first().map_or_else(String::new, |fault| format!("{}: {}", fault.title, fault.primary.text))
}

impl exec::Alternatives for Alternatives {
    fn most_states(&self) -> Option<usize> {
        if !self.form.is_explicit() {
            return None;
        }
        let ports = self.graph.elements.values().map(|element| match &element.kind {
            Kind::Inertance(storage) | Kind::Compliance(storage) => storage.laws.len(),
            _ => 0,
        });
        Some(ports.sum::<usize>() + self.graph.signals.len())
    }

    fn program(
        &self,
        branches: &[u32],
        independent: &[Symbol],
        point: &BTreeMap<Symbol, f64>,
    ) -> Result<Program, String> {
        let mut graph = match branches.is_empty() {
            true => BondGraph::clone(&self.graph),
            false => self.graph.in_mode(&branches.iter().map(|&b| b as usize).collect::<Vec<_>>()),
        };
        let wanted = independent.iter().map(|&symbol| Preference {
            name: graph.exprs.name(symbol).to_string(),
            symbol: graph.exprs.untwinned(symbol),
            span: Span::default(),
        });
        // What the modeller prefers is next.
        graph.preferences = wanted.chain(graph.preferences.iter().cloned()).collect();
        if !point.is_empty() {
            graph.point = Some(point.iter().map(|(&symbol, &value)| (symbol, value)).collect::<Map<_, _>>());
        }
        let causal = assign_causality(&graph).map_err(|faults| first(&faults))?;
        let equations = match (self.form, branches.is_empty()) {
            (Form::Minimal, true) => derive_minimal(&causal, self.conserved),
            (form, _) => derive_equations(&causal, form),
        };
        Ok(schedule(&equations.map_err(|faults| first(&faults))?))
    }
}
