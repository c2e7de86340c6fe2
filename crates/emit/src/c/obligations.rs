//! What a certifying engineer asks of the code, one line each; tests hold the code to every line.

use halfarrow_compiler::bond_graph::HeldKind;

use super::cost::most_looks;
use super::members;
use super::plan::Plan;
use crate::{Method, Real};

/// Bytes of stack for all functions that do not depend on the model.
const OWN_STACK: usize = 6 * 1024 + 96;

/// The lines, as they stand in the comment at the head of the source.
pub(super) fn lines(plans: &[Plan]) -> String {
    let plan = &plans[0];
    let tables = plans.iter().any(|plan| !plan.newton.is_empty()) || plan.solves_start();
    let implicit = plan.export.method.is_implicit();
    let indirect = match (tables, implicit) {
        (true, true) => {
            "through constant tables to the equations of Newton blocks and of the start, and to derivatives"
        }
        (true, false) => "through constant tables to the equations of Newton blocks and of the start",
        (false, true) => "to derivatives of the rates, of functions named where they are called",
        (false, false) => "none",
    };
    let reals = match plan.export.real {
        Real::Double => "double".to_string(),
        Real::Float => "float; double where time or parameters alone are read, never by accident".into(),
    };
    let flags = if plan.export.real == Real::Float { " -Wdouble-promotion -Wfloat-conversion" } else { "" };
    let all: [(&str, String); 11] = [
        ("real numbers", reals),
        ("recursion", "none (MISRA C:2012 17.2)".into()),
        ("heap", "none: no malloc, calloc, realloc, free (21.3), no array of variable length (18.8)".into()),
        ("global data", "none that is written: all static data are constant; the model is the caller's".into()),
        (
            "functions called",
            "of <math.h> and <string.h> alone; no input or output (21.6), signal (21.5), setjmp (21.4)".into(),
        ),
        ("indirect calls", indirect.into()),
        ("loops", format!("bounded: {}", bounds(plans))),
        (
            "control flow",
            "no goto (15.1), no union (19.2), no stdarg (17.1); functions have several returns (against 15.5)".into(),
        ),
        ("stack", format!("at most {} bytes (gcc, 64 bits, -O2)", plans.iter().map(stack).max().unwrap_or(0))),
        ("state", format!("at most {} bytes, all in one {}", members::bytes(plans), plan.name)),
        ("conversions", format!("no warning by gcc -std=c99 -Wall -Wextra -Wconversion -pedantic{flags}")),
    ];
    all.iter()
        .map(|(what, how)| format!(" *     {:17} {how}\n", format!("{what}:")))
        .collect::<String>()
        .trim_end()
        .into()
}

/// What bounds the loops.
fn bounds(plans: &[Plan]) -> String {
    let plan = &plans[0];
    let mut bounds = vec![
        "sizes in the header".to_string(),
        format!("{}_MOST_JUMPS parts of a step", plan.name.to_ascii_uppercase()),
    ];
    if plans.iter().any(|plan| !plan.newton.is_empty()) {
        bounds.push("evaluations of Newton blocks by most_evaluations (20000 at the start and at jumps)".into());
    }
    let looks = plans.iter().map(most_looks).max().unwrap_or(0);
    if looks > 0 {
        bounds.push(format!("{looks} steps to locate a crossing"));
    }
    if !plan.program.clauses.is_empty() {
        bounds.push("200 rounds of events at one instant".into());
    }
    if plan.program.jumps.is_some() {
        bounds.push("50 iterations of the balance of impulses".into());
    }
    if let Some(tables) = plan.mode.as_ref().filter(|tables| tables.has_laws()) {
        let (modes, combinations) = tables.modes.counts();
        bounds
            .push(format!("{modes} modes tried at an instant, of {combinations} combinations of branches, 200 times"));
    }
    if plan.export.method == Method::ImplicitMidpoint {
        bounds.push("20 iterations of the method".into());
    }
    if plan.program.held.iter().any(|held| held.kind == HeldKind::Delay) {
        bounds.push(format!("{} points of delays", plan.delays.iter().map(|d| d.1).sum::<usize>()));
    }
    bounds.join(", ")
}

/// Bytes of stack: every value of the equations in a place of its own, and what solves for the start.
fn stack(plan: &Plan) -> usize {
    let generated: usize = plan.functions().iter().map(|f| f.stack).sum();
    let most = |of: &dyn Fn(&super::start::Group) -> usize| plan.groups.iter().map(of).max().unwrap_or(1);
    let (rows, columns) = (most(&|g| g.conditions.len()), most(&|g| g.unknowns.len()));
    let start = 8 * (rows * rows + 4 * rows * columns + 8 * (rows + columns) + 8 * plan.program.start.len());
    OWN_STACK + generated + start + plan.mode.as_ref().map_or(0, |mode| mode.stack(plan.program))
}
