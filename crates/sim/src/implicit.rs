//! A whole run of a system in implicit form.

mod drive;
mod tolerances;

use std::cell::RefCell;

use crate::scene::Implicit;
use crate::simulate::Run;
use crate::{Failure, ImplicitSystem, Method, Options, Sink, Stopped, Summary};

/// Integrates `system` in implicit form from the unknowns `y` and their rates `yp` at `options.from` to `options.to`, and
/// leaves the last ones reached in `y` and `yp`. The method must be [`Method::Radau`].
///
/// Start values may be rough: [`cross_jump`](ImplicitSystem::cross_jump), which is called at the start, makes them
/// consistent. Samples are exact: where a step does not end at one, it is made again up to there, so that `F = 0` holds in
/// every sample as well as at the ends of steps.
///
/// # Errors
/// The run stopped; what was computed so far is with the sink, and `y` and `yp` belong to `Stopped::time`.
#[allow(clippy::result_large_err, reason = "a run fails once")]
pub fn simulate_implicit(
    system: &mut dyn ImplicitSystem,
    options: &Options,
    y: &mut [f64],
    yp: &mut [f64],
    sink: &mut dyn Sink,
) -> Result<Summary, Stopped> {
    let mut point = [&*y, &*yp].concat();
    let shared = RefCell::new(Implicit(system));
    let mut run = Run::new(&shared, options, sink);
    let end = check(options, y.len()).and_then(|()| drive::run(&mut run, &shared, &mut point));
    let (time, summary) = (run.time, run.counts);
    let (last, rates) = crate::scene::halves(&point);
    y.copy_from_slice(last);
    yp.copy_from_slice(rates);
    end.map(|()| summary).map_err(|failure| Stopped { failure, time, summary })
}

fn check(options: &Options, unknowns: usize) -> Result<(), Failure> {
    options.check(unknowns)?;
    match options.method {
        Method::Radau => Ok(()),
        _ => Err(Failure::BadMethod { expected: "radau for equations in implicit form" }),
    }
}
