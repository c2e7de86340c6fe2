//! The equations, as plain data.

use std::collections::BTreeMap;

use halfarrow_compiler::equations::{Equations, Form, Shown, StateKind, Style, print, print_expr, print_symbol, show};
use serde::Serialize;

use crate::error::Error;
use crate::loops::{Count, minimal_count};
use crate::model::Model;

/// What `halfarrow equations` tells.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EquationsReport {
    /// Name of the model.
    pub model: String,
    /// The form, `minimal`.
    pub form: &'static str,
    /// The states, in order.
    pub states: Vec<StateReport>,
    /// Names of all unknowns: the states, then what stays implicit.
    pub unknowns: Vec<String>,
    /// The equations in the model language: one for each state, then what stays implicit.
    pub equations: Vec<String>,
    /// The same in Unicode, for people.
    pub text: Vec<String>,
    /// The same in LaTeX.
    pub latex: Vec<String>,
    /// What those states are that are no variable of an element, in the model language.
    pub meanings: Vec<String>,
    /// Quantities that stay at their start value, in the model language.
    pub conserved: Vec<String>,
    /// `meanings` and `conserved` in Unicode, for people.
    pub legend: Vec<String>,
    /// Differentiation index of what is left; 0 for explicit ordinary differential equations.
    pub index: u8,
    /// Numbers of equations; integrated signals are not counted.
    pub counts: Count,
    /// Number of independent storages.
    pub dof: usize,
}

/// A state.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StateReport {
    /// Its name, as `--record` takes it.
    pub name: String,
    /// Its value at the start, in SI units; `None` if there is no start.
    pub initial: Option<f64>,
    /// `storage`, or `signal` for an integrated signal.
    pub kind: &'static str,
    /// SI unit, where known.
    pub unit: Option<String>,
}

impl Model {
    /// The equations in a form.
    ///
    /// # Errors
    /// The model has errors.
    pub fn equations(&self, form: Form) -> Result<EquationsReport, Error> {
        let equations = self.equations_in(form)?;
        let start = self.values_at_start(&equations);
        let x = &equations.graph.exprs;
        let states = states(&equations, &start);
        let implicit: Vec<String> = equations.implicit.iter().map(|&s| x.name(s).to_string()).collect();
        let shown = show(equations);
        let equations = &shown.equations;
        Ok(EquationsReport {
            model: equations.graph.name.clone(),
            form: form_name(form),
            unknowns: states.iter().map(|s| s.name.clone()).chain(implicit).collect(),
            states,
            equations: print(&shown, Style::Ascii),
            text: print(&shown, Style::Unicode),
            latex: print(&shown, Style::Latex),
            meanings: meanings(&shown, Style::Ascii),
            conserved: conserved(&shown, Style::Ascii),
            legend: [meanings(&shown, Style::Unicode), conserved(&shown, Style::Unicode)].concat(),
            index: equations.index,
            counts: minimal_count(equations),
            dof: equations.dof,
        })
    }
}

fn meanings(shown: &Shown, style: Style) -> Vec<String> {
    let line = |&(symbol, e)| format!("{} = {}", print_symbol(shown, symbol, style), print_expr(shown, e, style));
    shown.equations.meanings.iter().map(line).collect()
}

fn conserved(shown: &Shown, style: Style) -> Vec<String> {
    let value = |e| print_expr(shown, e, style);
    shown.equations.conserved.iter().map(|c| format!("{} = {}", c.name, value(c.value))).collect()
}

/// Its name on the command line.
fn form_name(form: Form) -> &'static str {
    match form {
        Form::Minimal => "minimal",
    }
}

fn states(equations: &Equations, start: &BTreeMap<String, f64>) -> Vec<StateReport> {
    let report = |state: &halfarrow_compiler::equations::State| StateReport {
        name: state.name.clone(),
        initial: start.get(&state.name).copied().filter(|v| v.is_finite()),
        kind: if state.kind == StateKind::Signal { "signal" } else { "storage" },
        unit: state.unit.as_ref().map(ToString::to_string),
    };
    equations.states.iter().map(report).collect()
}
