//! A whole run of an explicit system.

use crate::driver::{Flow, Run, Sink, Stopped, Summary};
use crate::fixed_step::{FixedMethod, FixedStep, Ticks};
use crate::shared::{Counted, Shared, Work};
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
            let mut work = Work::default();
            let end = run.start(system, x).and_then(|()| fixed(&mut run, system, (method, step), x, &mut work));
            counted_in(run.ended(end), work)
        }
        _ => {
            let shared = Shared::new(system);
            let end = crate::variable_step::run(&mut run, &shared, x);
            let work = shared.system().work();
            counted_in(run.ended(end), work)
        }
    }
}

fn fixed(
    run: &mut Run<'_>,
    system: &mut dyn HybridSystem,
    (method, step): (FixedMethod, f64),
    x: &mut [f64],
    work: &mut Work,
) -> Result<(), Failure> {
    let mut begins = true;
    loop {
        let mut method = FixedStep::of_blocks(method, system.sparsity(), system.blocks());
        let mut counted = Counted::new(system);
        if std::mem::take(&mut begins) {
            method.prepare(&mut counted, run.time, step, x);
        }
        let mut ticks = Ticks::new(&mut method, counted, (run.options.from, step));
        let end = run.drive(&mut ticks, x);
        work.add(ticks.system().work());
        // Where it hands over, its states are others.
        if end? == Flow::GoOn {
            return Ok(());
        }
    }
}

/// What came of a run, with what was evaluated.
#[allow(clippy::result_large_err, reason = "a run fails once")]
pub(crate) fn counted_in(end: Result<Summary, Stopped>, work: Work) -> Result<Summary, Stopped> {
    let counted = |summary| Summary { rates: work.rates, tangents: work.tangents, ..summary };
    let stopped = |stopped: Stopped| Stopped {
        summary: counted(stopped.summary),
        without_rates: work.without_rates.clone(),
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
