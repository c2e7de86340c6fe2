//! The same model with other variables independent, derived while it runs.

use std::collections::BTreeMap;

use halfarrow_compiler::algebra::Symbol;
use halfarrow_compiler::bond_graph::{BondGraph, Kind, Preference};
use halfarrow_compiler::causal_graph::assign_causality;
use halfarrow_compiler::equations::{Form, derive_equations};
use halfarrow_compiler::ids::Map;
use halfarrow_compiler::program::{Program, schedule};
use halfarrow_compiler::span::Span;
use halfarrow_exec as exec;

/// The bond graph of which programs are made.
#[derive(Debug)]
pub(crate) struct Alternatives {
    pub graph: BondGraph,
}

impl exec::Alternatives for Alternatives {
    fn most_states(&self) -> usize {
        let ports = self.graph.elements.values().map(|element| match &element.kind {
            Kind::Inertance(storage) | Kind::Compliance(storage) => storage.laws.len(),
            _ => 0,
        });
        ports.sum::<usize>() + self.graph.signals.len()
    }

    fn program(&self, branches: &[u32], independent: &[Symbol], point: &BTreeMap<Symbol, f64>) -> Option<Program> {
        let mut graph = match branches.is_empty() {
            true => self.graph.clone(),
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
        let causal = assign_causality(&graph).ok()?;
        let equations = derive_equations(&causal, Form::Minimal).ok()?;
        Some(schedule(&equations))
    }
}
