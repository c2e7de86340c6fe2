//! A whole run of an explicit system.

use crate::driver::{Run, Sink, Stopped, Summary};
use crate::fixed_step::{FixedStep, Ticks};
use crate::shared::{Counted, Shared};
use crate::{Affected, Failure, HybridSystem, Method, Options, System};

/// Integrates `system` from the state `x` at `options.from` to `options.to`, and leaves the last state reached in `x`.
///
/// # Errors
/// The run stopped; what was computed so far is with the sink, and `x` holds the state at `Stopped::time`.
#[allow(clippy::result_large_err, reason = "a run fails once")]
pub fn simulate(
    system: &mut dyn HybridSystem,
    options: &Options,
    x: &mut [f64],
    sink: &mut dyn Sink,
) -> Result<Summary, Stopped> {
    let mut run = Run::new(options, sink, &*system);
    if let Err(failure) = options.check(x.len()).and_then(|()| check_start(system, options.from, x)) {
        return run.ended(Err::<(), _>(failure));
    }
    match (options.method, options.step) {
        (Method::Fixed(method), Some(step)) => {
            let mut method = FixedStep::new(method, system.sparsity());
            let mut ticks = Ticks::new(&mut method, Counted::new(system), (options.from, step));
            let end = fixed(&mut run, &mut ticks, x);
            counted_in(run.ended(end), ticks.system())
        }
        _ => {
            let shared = Shared::new(system);
            let end = crate::variable_step::run(&mut run, &shared, x);
            counted_in(run.ended(end), &shared.system())
        }
    }
}

fn fixed(run: &mut Run<'_>, ticks: &mut Ticks<'_, '_>, x: &mut [f64]) -> Result<(), Failure> {
    run.start(ticks.system().events(), x)?;
    run.drive(ticks, x).map(|_| ())
}

/// What came of a run, with what was evaluated.
#[allow(clippy::result_large_err, reason = "a run fails once")]
pub(crate) fn counted_in(end: Result<Summary, Stopped>, system: &Counted<'_>) -> Result<Summary, Stopped> {
    let counted = |summary| Summary { rates: system.rates, tangents: system.tangents, ..summary };
    let stopped = |stopped: Stopped| Stopped {
        summary: counted(stopped.summary),
        without_rates: system.without_rates.clone(),
        ..stopped
    };
    end.map(counted).map_err(stopped)
}

/// Whether all states are finite where a run starts.
pub(crate) fn check_start<S: System + ?Sized>(system: &S, time: f64, x: &[f64]) -> Result<(), Failure> {
    match x.iter().position(|value| !value.is_finite()) {
        Some(state) => Err(Failure::NotFinite { time, what: Affected::variable(system.state_name(state)) }),
        None => Ok(()),
    }
}
