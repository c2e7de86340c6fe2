//! The chain of stages.

use crate::ast::{Ast, Parsed, parse};
use std::collections::BTreeMap;
use std::sync::Arc;

use crate::bond_graph::{self, BondGraph, Counting, Files, Name, Override, elaborate_counting};
use crate::causal_graph::{self, CausalGraph, assign_causality};
use crate::diagnostic::{Diagnostic, DiagnosticCode, Diagnostics, Sources, render};
use crate::equations::{Equations, Form, derive_equations};
use crate::program::{Program, schedule};
use crate::span::Span;

/// The text of a model, and where the rest of it comes from.
#[derive(Clone, Copy)]
pub struct Text<'a> {
    /// Name under which places in it are reported; what it imports is looked for beside it.
    pub name: &'a str,
    /// The text.
    pub text: &'a str,
    /// Imported models and tables.
    pub files: &'a dyn Files,
    /// Values that replace those of parameters.
    pub overrides: &'a [Override],
}

/// A stage's result, with what was noticed on the way to it.
#[derive(Debug, Clone)]
pub struct Reached<T> {
    /// The result.
    pub ir: T,
    /// Warnings of this stage and those before it.
    pub found: Found,
}

/// What was found out about a model, and the texts it is about.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Found {
    /// Errors and warnings, stage by stage, each in the order of the text.
    pub diagnostics: Diagnostics,
    /// The files of the model.
    pub sources: Sources,
    /// The names that they declare, and where they are used.
    pub names: Arc<Vec<Name>>,
}

/// From model text to what is evaluated.
///
/// ```
/// use halfarrow_compiler::{bond_graph::NoFiles, compile::{Text, compile}, equations::Form};
/// let text = "model Drop\nSe:weight(9.81 N) -> I:mass(1 kg)\n";
/// let text = Text { name: "drop.bond", text, files: &NoFiles, overrides: &[] };
/// assert_eq!(compile(text, Form::Minimal).unwrap().ir.states.len(), 1);
/// ```
///
/// # Errors
/// All faults of the first stage that fails, and the warnings before it.
pub fn compile(text: Text<'_>, form: Form) -> Result<Reached<Program>, Found> {
    Ok(to_equations(text, form)?.then(|equations| schedule(&equations)))
}

/// Names, units and parts: the bond graph.
///
/// # Errors
/// All faults of the text; if there are none, all those of the names, units and bonds in it.
pub fn to_bond_graph(text: Text<'_>) -> Result<Reached<BondGraph>, Found> {
    bond_graph_of(read(text), text)
}

/// A text that was read, with its faults.
#[derive(Debug)]
pub struct Read {
    parsed: Parsed,
    sources: Sources,
}

impl Read {
    /// The text as its statements, as far as they could be read.
    pub(crate) fn ast(&self) -> &Ast {
        &self.parsed.ast
    }
}

/// Reads the text alone, without what it imports.
pub fn read(text: Text<'_>) -> Read {
    let mut sources = Sources::new();
    let file = sources.add(text.name, text.text);
    Read { parsed: parse(text.text, file), sources }
}

/// The bond graph of a text that was [`read`].
///
/// # Errors
/// As [`to_bond_graph`].
pub fn bond_graph_of(read: Read, text: Text<'_>) -> Result<Reached<BondGraph>, Found> {
    bond_graph_counting(read, text, None)
}

/// The same where a parameter of the model counts so many turns of repetitions, whatever its value.
pub(crate) fn bond_graph_counting(
    read: Read,
    text: Text<'_>,
    counting: Option<Counting<'_>>,
) -> Result<Reached<BondGraph>, Found> {
    let Read { parsed, sources } = read;
    let elaborated = elaborate_counting(parsed.ast, sources, text.files, text.overrides, counting);
    let mut diagnostics = Diagnostics(parsed.diagnostics);
    // What could not be read is not there: that others name it, or that its bonds are missing, are no faults of their own.
    if !diagnostics.has_errors() {
        diagnostics.0.extend(elaborated.diagnostics.0);
    }
    let names = Arc::new(elaborated.names);
    let mut found = Found { diagnostics, sources: elaborated.sources, names };
    match elaborated.graph {
        Some(ir) if !found.diagnostics.has_errors() => {
            found.diagnostics.0.extend(told_once(bond_graph::warnings(&ir), &ir));
            let ir = causal_graph::reading_shares(causal_graph::in_first_mode(ir));
            Ok(Reached { ir, found })
        }
        _ => Err(found),
    }
}

/// Causality.
///
/// # Errors
/// As [`to_bond_graph`], and sources, constraints or forced strokes that cannot hold together.
pub fn to_causal_graph(text: Text<'_>) -> Result<Reached<CausalGraph>, Found> {
    let mut causal = to_bond_graph(text)?.and_then(|bonds| assign_causality(&bonds))?;
    let warnings = told_once(causal_graph::warnings(&causal.ir), &causal.ir.graph);
    causal.found.diagnostics.0.extend(warnings);
    Ok(causal)
}

/// What is told of one place for many turns of a repetition is told once, and how many more there are.
fn told_once(all: Vec<Diagnostic>, graph: &BondGraph) -> Vec<Diagnostic> {
    if graph.cells.is_empty() {
        return all;
    }
    let mut at: BTreeMap<(Span, DiagnosticCode), (usize, usize)> = BTreeMap::new();
    let mut once: Vec<Diagnostic> = Vec::new();
    for told in all {
        match at.get_mut(&(told.primary.span, told.code)) {
            Some((_, more)) => *more += 1,
            None => {
                at.insert((told.primary.span, told.code), (once.len(), 0));
                once.push(told);
            }
        }
    }
    for (first, more) in at.into_values().filter(|(_, more)| *more > 0) {
        once[first].notes.push(format!("and so {more} more time{} here", if more == 1 { "" } else { "s" }));
    }
    once
}

/// The equations in one form.
///
/// # Errors
/// As [`to_causal_graph`], and equations that have no solution.
pub fn to_equations(text: Text<'_>, form: Form) -> Result<Reached<Equations>, Found> {
    to_causal_graph(text)?.and_then(|causal| derive_equations(&causal, form))
}

impl Found {
    /// For people, under the lines of the model; `color` adds terminal colours.
    pub fn render(&self, color: bool) -> String {
        render(&self.diagnostics, &self.sources, color)
    }
}

impl<T> Reached<T> {
    fn then<U>(self, stage: impl FnOnce(T) -> U) -> Reached<U> {
        Reached { ir: stage(self.ir), found: self.found }
    }

    fn and_then<U>(self, stage: impl FnOnce(T) -> Result<U, Diagnostics>) -> Result<Reached<U>, Found> {
        let Reached { ir, mut found } = self;
        match stage(ir) {
            Ok(ir) => Ok(Reached { ir, found }),
            Err(errors) => {
                found.diagnostics.0.extend(errors.0);
                Err(found)
            }
        }
    }
}
