//! The equations, as plain data.

use halfarrow_compiler::algebra::Symbol;
use halfarrow_compiler::diagnostic::nearest;
use halfarrow_compiler::equations::{Algebraic, AlgebraicRole, EquationStep, Equations, Form, StateKind};
use halfarrow_compiler::textbook::{
    Shown, Style, events_within, meanings_within, only, print, print_certificate, print_definitions, print_events,
    print_expr, print_form, print_meanings, print_symbol, print_within, show,
};
use serde::Serialize;

use crate::error::{Error, Problem};
use crate::loops::Count;
use crate::model::Model;

/// Writes the name of a form.
pub(crate) fn by_name<S: serde::Serializer>(form: &Form, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_str(form.name())
}

/// What `halfarrow equations` tells.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EquationsReport {
    /// Name of the model.
    pub model: String,
    /// The form, by its name on the command line.
    #[serde(serialize_with = "by_name")]
    pub form: Form,
    /// The states, in order.
    pub states: Vec<StateReport>,
    /// Unknowns without a rate, in order.
    pub algebraic: Vec<AlgebraicReport>,
    /// How few break variables open all loops.
    pub breaks: Breaks,
    /// Names of all unknowns: the states, then what stays implicit.
    pub unknowns: Vec<String>,
    /// The equations in the model language: one for each state, then what stays implicit.
    pub equations: Vec<String>,
    /// Names in `equations` for parts of them that would make them too long, each with what it stands for, in names
    /// before it; in the model language.
    pub definitions: Vec<String>,
    /// The same in Unicode, for people.
    pub text: Vec<String>,
    /// The same in LaTeX.
    pub latex: Vec<String>,
    /// What those states are that are no variable of an element, in the model language.
    pub meanings: Vec<String>,
    /// Quantities that stay at their start value, in the model language.
    pub conserved: Vec<String>,
    /// What the names in `text` stand for, in Unicode: parts of equations, sources that vary in time, states that are no
    /// variable of an element, conserved quantities.
    pub legend: Vec<String>,
    /// The same for `latex`.
    pub latex_legend: Vec<String>,
    /// What happens at events, in the model language; `+` marks what is after the event.
    pub events: Vec<String>,
    /// The same in Unicode.
    pub events_text: Vec<String>,
    /// The same in LaTeX.
    pub events_latex: Vec<String>,
    /// Form `inverted`: which storage was inverted for which path, and why no other, a line each.
    pub certificate: Vec<String>,
    /// Differentiation index of what is left; 0 for explicit ordinary differential equations.
    pub index: u8,
    /// Numbers of equations; integrated signals are not counted.
    pub counts: Count,
    /// Number of independent storages.
    pub dof: usize,
}

/// How few break variables open all loops.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Breaks {
    /// How many there are.
    pub number: usize,
    /// How many are needed at least.
    pub at_least: usize,
}

/// An unknown without a rate.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct AlgebraicReport {
    /// Its name.
    pub name: String,
    /// `break`, `law` or `multiplier`.
    pub cause: &'static str,
    /// The element whose law or constraint it stands for.
    pub element: Option<String>,
    /// Its index, at least 1.
    pub index: u8,
    /// SI unit, where known.
    pub unit: Option<String>,
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

/// The equations for people, up to a length.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BriefEquations {
    /// The form.
    pub form: Form,
    /// The equations; what is longer than a line may be ends with `…`.
    pub text: Vec<String>,
    /// What the names in them stand for.
    pub legend: Vec<String>,
    /// What happens at events.
    pub events: Vec<String>,
    /// See [`EquationsReport::certificate`].
    pub certificate: Vec<String>,
    /// Differentiation index.
    pub index: u8,
    /// Numbers of equations.
    pub counts: Count,
    /// How large they are, if not all of them stand here.
    pub size: Option<EquationsSize>,
}

/// How large equations are that are too long to be read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct EquationsSize {
    /// Number of states.
    pub states: usize,
    /// Number of equations.
    pub equations: usize,
    /// Number of names that stand in them for parts of them.
    pub names: usize,
    /// Numbers of unknowns of the systems of linear equations that are solved at each evaluation.
    pub linear: Vec<usize>,
    /// The same of those that are solved by iteration.
    pub iterated: Vec<usize>,
    /// Operations of one evaluation, if they can be counted.
    pub operations: Option<usize>,
}

/// How long equations may be for people, in characters and lines.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Length {
    /// Characters on a line.
    pub width: usize,
    /// Lines up to which all of them are told.
    pub lines: usize,
    /// Where they are longer, lines of one equation.
    pub each: usize,
    /// Where they are longer, equations, and names of parts that fit a line.
    pub most: usize,
}

impl Model {
    /// The equations in a form.
    ///
    /// # Errors
    /// The model has errors.
    pub fn equations(&self, form: Form) -> Result<EquationsReport, Error> {
        self.equations_for(form, &[])
    }

    /// The equations of some variables alone, named as `--record` takes them, with what stands behind the names in them; of
    /// none: all equations.
    ///
    /// # Errors
    /// The model has errors, or no variable of a name.
    pub fn equations_for(&self, form: Form, names: &[String]) -> Result<EquationsReport, Error> {
        let equations = self.equations_in(form)?;
        let asked = names.iter().map(|name| variable(&equations, name)).collect::<Result<Vec<_>, _>>()?;
        let states = states(&equations, &self.unknowns_at_start(&equations));
        let x = &equations.graph.exprs;
        let implicit = equations.implicit.iter().map(|&s| x.name(s).to_string());
        let implicit: Vec<String> = equations.algebraic.iter().map(|a| a.name.clone()).chain(implicit).collect();
        let algebraic = algebraic(&equations);
        let shown = show(equations);
        let shown = if asked.is_empty() { shown } else { only(shown, &asked) };
        let equations = &shown.equations;
        Ok(EquationsReport {
            model: equations.graph.name.clone(),
            form,
            unknowns: states.iter().map(|s| s.name.clone()).chain(implicit).collect(),
            states,
            algebraic,
            breaks: Breaks { number: equations.breaks.number, at_least: equations.breaks.at_least },
            equations: print(&shown, Style::Ascii),
            definitions: print_definitions(&shown, Style::Ascii),
            text: print(&shown, Style::Unicode),
            latex: print(&shown, Style::Latex),
            meanings: meanings(&shown, Style::Ascii),
            conserved: conserved(&shown, Style::Ascii),
            legend: print_meanings(&shown, Style::Unicode),
            latex_legend: print_meanings(&shown, Style::Latex),
            events: print_events(&shown, Style::Ascii),
            events_text: print_events(&shown, Style::Unicode),
            events_latex: print_events(&shown, Style::Latex),
            certificate: print_certificate(&shown),
            index: equations.index,
            counts: form_count(equations),
            dof: equations.dof,
        })
    }
}

impl Model {
    /// The equations for people: all of them, or if these take too many lines their size and the short ones.
    ///
    /// # Errors
    /// The model has errors.
    pub fn equations_in_brief(&self, form: Form, length: Length) -> Result<BriefEquations, Error> {
        let shown = show(self.equations_in(form)?);
        let equations = &shown.equations;
        let whole = length.width.saturating_mul(length.lines);
        let mut lines = 0;
        // All of it, or nothing as soon as it is too long.
        let fitting = |printed: &mut dyn Iterator<Item = String>, lines: &mut usize| {
            let mut kept = Vec::new();
            for line in printed {
                *lines += line.chars().count() / length.width.max(1) + 1;
                if *lines > length.lines {
                    return None;
                }
                kept.push(line);
            }
            Some(kept)
        };
        let all = fitting(&mut print_within(&shown, Style::Unicode, whole), &mut lines)
            .and_then(|text| Some((text, fitting(&mut meanings_within(&shown, Style::Unicode, whole), &mut lines)?)))
            .and_then(|(text, legend)| {
                let events = events_within(&shown, Style::Unicode, whole);
                Some((text, legend, fitting(&mut events.into_iter(), &mut lines)?))
            });
        let (text, legend, events, size) = match all {
            Some((text, legend, events)) => (text, legend, events, None),
            None => {
                let most = length.width * length.each;
                let text = print_within(&shown, Style::Unicode, most).take(length.most).collect();
                let names = meanings_within(&shown, Style::Unicode, length.width);
                let short = names.filter(|line| !line.ends_with('…')).take(length.most).collect();
                let events = events_within(&shown, Style::Unicode, most).into_iter().take(length.most).collect();
                (text, short, events, Some(self.size(&shown)))
            }
        };
        Ok(BriefEquations {
            form,
            text,
            legend,
            events,
            certificate: print_certificate(&shown),
            index: equations.index,
            counts: form_count(equations),
            size,
        })
    }

    fn size(&self, shown: &Shown) -> EquationsSize {
        let equations = &shown.equations;
        let (mut linear, mut iterated) = (Vec::new(), Vec::new());
        for step in &equations.steps {
            match step {
                EquationStep::Linear(block) => linear.push(block.unknowns.len()),
                EquationStep::Newton(block) => iterated.push(block.unknowns.len()),
                _ => {}
            }
        }
        let operations = match equations.form {
            Form::Minimal => self.system(equations).map(|system| system.operations()),
            _ => self.form_system(equations).map(|system| system.operations()),
        };
        EquationsSize {
            states: equations.states.len(),
            equations: shown.display.len(),
            names: shown.definitions.iter().filter(|d| !d.of_dependent).count(),
            linear,
            iterated,
            operations: operations.ok().map(|counted| counted.total()),
        }
    }

    /// A form as text: counts, index, unknowns with what they are there for, equations.
    ///
    /// # Errors
    /// The model has errors, or the form does not apply to it.
    pub fn form_text(&self, form: Form) -> Result<String, Error> {
        Ok(print_form(&show(self.equations_in(form)?)))
    }
}

/// The variable of a name.
fn variable(equations: &Equations, name: &str) -> Result<Symbol, Problem> {
    let x = &equations.graph.exprs;
    let known = || equations.graph.variables.keys().copied();
    x.find_symbol(name).filter(|s| equations.graph.variables.contains_key(s)).ok_or_else(|| Problem::UnknownVariable {
        name: name.into(),
        nearest: nearest(name, known().map(|s| x.name(s))).map(str::to_string),
    })
}

fn meanings(shown: &Shown, style: Style) -> Vec<String> {
    let line = |&(symbol, e)| format!("{} = {}", print_symbol(shown, symbol, style), print_expr(shown, e, style));
    shown.equations.meanings.iter().map(line).collect()
}

fn conserved(shown: &Shown, style: Style) -> Vec<String> {
    let value = |e| print_expr(shown, e, style);
    shown.equations.conserved.iter().map(|c| format!("{} = {}", c.name, value(c.value))).collect()
}

fn states(equations: &Equations, start: &[f64]) -> Vec<StateReport> {
    let report = |(i, state): (usize, &halfarrow_compiler::equations::State)| StateReport {
        name: state.name.clone(),
        initial: start.get(i).copied().filter(|v| v.is_finite()),
        kind: if state.kind == StateKind::Signal { "signal" } else { "storage" },
        unit: state.unit.as_ref().map(ToString::to_string),
    };
    equations.states.iter().enumerate().map(report).collect()
}

fn algebraic(equations: &Equations) -> Vec<AlgebraicReport> {
    let first = equations.states.len();
    let report = |(i, a): (usize, &Algebraic)| {
        let (cause, element) = match a.cause {
            AlgebraicRole::Break => ("break", None),
            AlgebraicRole::Law(element) => ("law", Some(element)),
            AlgebraicRole::Multiplier(element) => ("multiplier", Some(element)),
        };
        AlgebraicReport {
            name: a.name.clone(),
            cause,
            element: element.map(|e| equations.graph.elements[e].name.clone()),
            index: equations.indices.get(first + i).copied().unwrap_or(1),
            unit: a.unit.as_ref().map(ToString::to_string),
        }
    };
    equations.algebraic.iter().enumerate().map(report).collect()
}

/// Numbers of equations: those of the form, and what stays implicit in its steps.
fn form_count(equations: &Equations) -> Count {
    let counts = equations.counts;
    Count { differential: counts.differential, algebraic: counts.algebraic + equations.implicit.len() }
}
