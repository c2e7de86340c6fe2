//! How a run is evaluated: bytecode or machine code, which of them for what, and why.

use halfarrow_exec::{Executed, Execution, Expected, Reason};
use halfarrow_sim::{Method, Options};
use serde::Serialize;

use crate::error::Problem;
use crate::run::Recording;

/// How a part of a model was evaluated in a run, and why so. The same for the same run everywhere.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct RoutineReport {
    /// What it evaluates: `rates`, `directional derivatives`, `recorded`, `event indicators` or `jacobian`.
    pub routine: &'static str,
    /// Its instructions.
    pub instructions: usize,
    /// Whether machine code of it was made; else it ran as bytecode.
    pub machine: bool,
    /// Evaluations by bytecode, before there was machine code if it was made.
    pub by_bytecode: u64,
    /// Evaluations after which machine code has certainly repaid the time to make it.
    pub repaid_after: u64,
    /// Why it ran as it did.
    pub reason: String,
}

impl RoutineReport {
    fn of(executed: &Executed) -> RoutineReport {
        let Executed { what, instructions, repaid_after, by_bytecode, machine, in_turns, ref reason } = *executed;
        let reason = match (reason, machine) {
            (Reason::Expected(_) | Reason::Counted, false) if in_turns => {
                format!("{by_bytecode} evaluations, equal cells together")
            }
            (Reason::Asked, _) => "asked for".to_string(),
            (Reason::Expected(n), true) => format!("{n:.0} evaluations to come, {repaid_after} repay it"),
            (Reason::Expected(n), false) => {
                format!("{n:.0} evaluations to come, {repaid_after} would repay machine code")
            }
            (Reason::Counted, true) => format!("after {by_bytecode} evaluations, which repay it"),
            (Reason::Counted, false) => format!("{by_bytecode} evaluations, {repaid_after} would repay machine code"),
            (Reason::Refused(why), _) => why.to_string(),
        };
        RoutineReport { routine: what.name(), instructions, machine, by_bytecode, repaid_after, reason }
    }
}

/// Says how a system runs; of a method with fixed step it is known before how often it is evaluated.
pub(crate) fn execute(system: &mut impl Recording, execution: Execution, options: &Options) -> Result<(), Problem> {
    let expected = match (options.method, options.step) {
        (Method::Fixed(method), Some(step)) => {
            let steps = (options.to - options.from) / step;
            Some(Expected { rates: method.evaluations() * steps, steps })
        }
        _ => None,
    };
    system.execute(execution, expected).map_err(|why| Problem::BadOption { reason: why.to_string() })
}

/// How it has been run.
pub(crate) fn executed(system: &impl Recording) -> Vec<RoutineReport> {
    system.executed().iter().map(RoutineReport::of).collect()
}
