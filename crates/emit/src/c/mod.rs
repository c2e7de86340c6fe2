//! C99: one header, one source; no heap, no global state, no recursion, bounded loops.
//!
//! The operations are those of the interpreter, one by one and in its order, so that results are equal to the last bit
//! wherever C computes in double precision without contraction.

mod blocks;
mod compose;
mod cost;
mod derivatives;
mod few;
pub(crate) mod flags;
mod fragment;
mod function;
mod givens;
mod header;
mod members;
mod messages;
mod obligations;
mod patterns;
mod plan;
mod project;
mod range;
mod real;
mod start;
pub(crate) mod template;
mod terms;
mod variables;
mod write;
pub(crate) mod written;

pub use cost::Cost;

use halfarrow_compiler::algebra::Symbol;
use halfarrow_compiler::program::Program;

use plan::Plan;

use crate::{EmitError, Method, Real, Start, names};

/// Unknowns at most that a balance of impulses at events may have: there is room for a full matrix.
pub(crate) const MOST_BALANCED: usize = 200;

/// What is to be written.
#[derive(Debug, Clone, Copy)]
pub struct Export<'a> {
    /// The program; its equations are explicit.
    pub program: &'a Program,
    /// Its start.
    pub start: &'a Start,
    /// The method of a step.
    pub method: Method,
    /// The length of a step, in s; it can be changed at run time.
    pub step: f64,
    /// What is computed after each step: indices into [`Program::observed`], all with a value.
    pub recorded: &'a [usize],
    /// Whether exact directional derivatives are wanted.
    pub derivatives: bool,
    /// Its real numbers.
    pub real: Real,
    /// Whether positions that only speeds keep together are put back onto the relations between them after each step.
    pub project: bool,
    /// The other modes: with other branches of set-valued laws, or with other independent variables.
    pub modes: &'a [Mode],
    /// The variables that are independent in the first mode, where there are others.
    pub independent: &'a [Symbol],
}

/// A mode of a model besides that in which runs begin.
#[derive(Debug, Clone)]
pub struct Mode {
    /// Its program.
    pub program: Program,
    /// What is computed after each step, the same variables as in the first mode.
    pub recorded: Vec<usize>,
    /// The variables that are independent in it, in ascending order.
    pub independent: Vec<Symbol>,
}

impl Export<'_> {
    /// Whether a run may come to other modes than the first one.
    pub(crate) fn has_modes(&self) -> bool {
        !(self.program.set_valued.is_empty() && self.modes.is_empty())
    }
}

/// What was written.
#[derive(Debug, Clone, PartialEq)]
pub struct Written {
    /// The name of the model in C: of its type, and before all its functions.
    pub name: String,
    /// The header, `NAME.h`.
    pub header: String,
    /// The source, `NAME.c`.
    pub source: String,
    /// A program that steps it.
    pub main: String,
    /// `CMakeLists.txt`.
    pub cmake: String,
    /// What a step costs at most.
    pub cost: Cost,
    /// Names in C of states, inputs, parameters and outputs, as in the enumerations of the header.
    pub names: Names,
}

/// Names in C.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Names {
    /// Of states.
    pub states: Vec<String>,
    /// Of inputs.
    pub inputs: Vec<String>,
    /// Of parameters.
    pub parameters: Vec<String>,
    /// Of what is computed after each step.
    pub outputs: Vec<String>,
}

/// Writes a program.
///
/// # Errors
/// The program is implicit or has states that jump, events move too much at once, the step makes no sense, a delay is too long for it, or a value does not fit the real numbers.
pub fn write(export: &Export) -> Result<Written, EmitError> {
    if export.program.implicit.is_some() {
        return Err(EmitError::Implicit);
    }
    if !export.program.kept.is_empty() {
        let name = |k: &(u32, _)| export.program.states[k.0 as usize].name.clone();
        return Err(EmitError::Jumps(export.program.kept.iter().map(name).collect()));
    }
    let programs = std::iter::once(export.program).chain(export.modes.iter().map(|mode| &mode.program));
    let balanced = programs.map(|p| plan::EventTables::of(p).columns()).max().unwrap_or(0);
    if balanced > MOST_BALANCED {
        return Err(EmitError::Impulses(balanced));
    }
    if !(export.step > 0.0 && export.step.is_finite()) {
        return Err(EmitError::Step(export.step));
    }
    if export.real == Real::Float && export.method.keeps_steps() {
        return Err(EmitError::SingleDifferences);
    }
    range::check(export)?;
    let program = export.program;
    let in_modes = export.has_modes();
    if export.real == Real::Float && in_modes {
        return Err(EmitError::SingleModes);
    }
    let name = names::of_model(&program.name);
    let list = |names: &mut dyn Iterator<Item = &str>| names::unique(names.collect::<Vec<_>>().into_iter());
    let names = Names {
        states: match in_modes {
            // What they are depends on the mode.
            true => (1..=program.states.len()).map(|i| format!("state_{i}")).collect(),
            false => list(&mut program.states.iter().map(|s| s.name.as_str())),
        },
        inputs: list(&mut program.inputs.iter().map(|i| i.name.as_str())),
        parameters: list(&mut program.parameters.iter().map(|p| p.name.as_str())),
        outputs: list(&mut export.recorded.iter().map(|&i| &*program.observed[i].name)),
    };
    let others = export.modes.iter().map(|mode| Export {
        program: &mode.program,
        recorded: &mode.recorded,
        independent: &mode.independent,
        ..*export
    });
    let exports: Vec<Export> = std::iter::once(*export).chain(others).collect();
    let programs: Vec<(&Program, &[Symbol])> = exports.iter().map(|e| (e.program, e.independent)).collect();
    let modes = in_modes.then(|| plan::Modes::of(&programs));
    let plans: Vec<Plan> = exports
        .iter()
        .enumerate()
        .map(|(i, export)| Plan::new(export, &name, modes.as_ref(), i == 0))
        .collect::<Result<_, _>>()?;
    let cost = Cost::of_modes(&plans);
    let header = header::header(&plans, &names, &cost);
    let obligations = obligations::lines(&plans);
    let source = match in_modes {
        true => source_of_modes(&plans, &obligations),
        false => plans[0].source(obligations),
    };
    let main = project::main(export, &name);
    let cmake = project::cmake(&name);
    Ok(Written { header, source, main, cmake, cost, names, name })
}

/// The source of a model that has several modes.
fn source_of_modes(plans: &[Plan], obligations: &str) -> String {
    let modes: Vec<_> = plans.iter().map(|plan| plan.fragments(obligations)).collect();
    let mut common = plans[0].changes_of_mode();
    common.extend(plans[0].beginning(obligations));
    compose::Composition::new(&modes, &common).text()
}
