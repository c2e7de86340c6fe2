//! C99: one header, one source; no heap, no global state, no recursion, bounded loops.
//!
//! The operations are those of the interpreter, one by one and in its order, so that results are equal to the last bit
//! wherever C computes in double precision without contraction.

mod blocks;
mod cost;
mod derivatives;
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

use halfarrow_compiler::program::Program;

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
    let balanced = plan::EventTables::of(export.program).columns();
    if balanced > MOST_BALANCED {
        return Err(EmitError::Impulses(balanced));
    }
    if !(export.step > 0.0 && export.step.is_finite()) {
        return Err(EmitError::Step(export.step));
    }
    range::check(export)?;
    let program = export.program;
    let name = names::of_model(&program.name);
    let list = |names: &mut dyn Iterator<Item = &str>| names::unique(names.collect::<Vec<_>>().into_iter());
    let names = Names {
        states: list(&mut program.states.iter().map(|s| s.name.as_str())),
        inputs: list(&mut program.inputs.iter().map(|i| i.name.as_str())),
        parameters: list(&mut program.parameters.iter().map(|p| p.name.as_str())),
        outputs: list(&mut export.recorded.iter().map(|&i| program.observed[i].name.as_str())),
    };
    let plan = plan::Plan::new(export, &name)?;
    let cost = plan.cost();
    let header = header::header(&plan, &names, &cost);
    let source = plan.source(obligations::lines(&plan));
    let main = project::main(export, &name);
    let cmake = project::cmake(&name);
    Ok(Written { header, source, main, cmake, cost, names, name })
}
