//! The forms of a model, compiled: how large each is, and why some are left out.

use halfarrow_compiler::equations::{EquationStep, Equations, Form};
use serde::Serialize;

use super::subject::{Common, Subject, is_over};
use super::{Budget, Compare, Progress, Row, check, short};
use crate::clock::ProcessorTime;
use crate::error::Error;
use crate::model::Model;
use crate::run::{Run, Start};

/// Why a form was not measured.
pub(super) const LEFT_OUT: &str = "left out: the time for comparing was over";

/// All forms of a model at their start: what comparing tells before anything has run. [`Model::compared_forms`] makes them,
/// [`measured`](ComparedForms::measured) runs them.
pub struct ComparedForms<'m> {
    pub(super) common: Common<'m>,
    pub(super) compare: Compare,
    pub(super) budget: Budget,
    pub(super) run: Run,
    /// Each form that applies, and the equations of those with springs.
    pub(super) subjects: Vec<Option<Subject<'m>>>,
    pub(super) stiff: Option<Equations>,
    pub(super) rows: Vec<Row>,
}

/// Blocks of equations that each evaluation of a form solves.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct SolvedBlocks {
    /// Blocks of linear equations.
    pub linear: usize,
    /// Blocks solved by Newton.
    pub iterated: usize,
    /// Unknowns of the largest of them.
    pub largest: usize,
}

impl Model {
    /// Compiles all forms, as far as a budget goes: the rows have their sizes, and the reasons of those that are left out.
    ///
    /// # Errors
    /// The model has errors, or options make no sense.
    pub fn compared_forms(&self, compare: &Compare, progress: Progress) -> Result<ComparedForms<'_>, Error> {
        check(compare)?;
        let budget = Budget::new(compare.budget);
        let run = Run { inputs: compare.inputs.clone(), start: Start::Given, ..Run::default() };
        progress(0.0, Form::Minimal.name());
        let begun = ProcessorTime::now();
        let (common, equations) = Common::of(self)?;
        let minimal = common.subject(&equations, &run)?;
        let mut first = Row::of(Form::Minimal);
        first.take_sizes(&equations, &minimal, begun.elapsed().as_secs_f64());
        let (subjects, rows) = (vec![Some(minimal)], vec![first]);
        let mut forms = ComparedForms { common, compare: compare.clone(), budget, run, subjects, stiff: None, rows };
        for form in Form::ALL.into_iter().skip(1) {
            progress(0.02, form.name());
            forms.add(form);
        }
        Ok(forms)
    }
}

impl ComparedForms<'_> {
    /// One for each form; of one that does not apply, or is left out, with the reason.
    pub fn rows(&self) -> &[Row] {
        &self.rows
    }

    fn add(&mut self, form: Form) {
        let mut row = Row::of(form);
        let made = match is_over(self.budget.part(1.0)) {
            true => Err(LEFT_OUT.to_string()),
            false => self.compiled(form, &mut row).map_err(|error| short(&error)),
        };
        match made {
            Ok(subject) => self.subjects.push(Some(subject)),
            Err(reason) => {
                row.reason = Some(reason);
                self.subjects.push(None);
            }
        }
        self.rows.push(row);
    }
}

impl<'m> ComparedForms<'m> {
    fn compiled(&mut self, form: Form, row: &mut Row) -> Result<Subject<'m>, Error> {
        let begun = ProcessorTime::now();
        let equations = self.common.equations(form)?;
        let subject = self.common.subject(&equations, &Run { form, ..self.run.clone() })?;
        row.take_sizes(&equations, &subject, begun.elapsed().as_secs_f64());
        if form == Form::Stiff {
            self.stiff = Some(equations);
        }
        Ok(subject)
    }
}

impl Row {
    fn of(form: Form) -> Row {
        Row { form, meaning: meaning(form), ..Row::default() }
    }

    /// Counts, index, loops and operations.
    fn take_sizes(&mut self, equations: &Equations, subject: &Subject, seconds: f64) {
        self.differential = Some(equations.counts.differential);
        self.algebraic = Some(equations.counts.algebraic + equations.implicit.len());
        self.index = Some(equations.index);
        self.loops = Some(loops(equations));
        self.seconds_to_compile = Some(seconds);
        self.take_operations(subject);
    }
}

fn loops(equations: &Equations) -> SolvedBlocks {
    let mut loops = SolvedBlocks::default();
    for step in &equations.steps {
        let unknowns = match step {
            EquationStep::Linear(block) => {
                loops.linear += 1;
                block.unknowns.len()
            }
            EquationStep::Newton(block) => {
                loops.iterated += 1;
                block.unknowns.len()
            }
            _ => continue,
        };
        loops.largest = loops.largest.max(unknowns);
    }
    loops
}

/// What a form is.
fn meaning(form: Form) -> &'static str {
    match form {
        Form::Minimal => "an explicit equation for each independent variable, and nothing else",
        Form::Kane => "the same in speeds, without momenta as states",
        Form::Inverted => "storages on causal paths in derivative causality, whose rates open the paths",
        Form::Break => "storages in integral causality, paths opened by break variables and multipliers",
        Form::Relaxed => "the same with resistors first, storages as they come",
        Form::Lagrange => "all storages are states, every constraint has a multiplier",
        Form::Stiff => "all storages are states, every constraint is a stiff spring with a damper",
    }
}
