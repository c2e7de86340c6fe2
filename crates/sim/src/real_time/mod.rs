//! A system against the wall clock: a step of fixed length each tick, inputs before it and outputs after it.
//!
//! The loop only computes: it takes no lock and no memory and makes no call to the operating system. Time comes from the clock
//! that the caller gives, values from the caller's exchange.

mod clock;
mod statistics;

pub use clock::Clock;
pub use statistics::{Histogram, Statistics};

use crate::fixed_step::FixedMethod;
use crate::{HybridSystem, Stepwise, Stopped, Summary};

/// What to do when a tick ends after the next one was due.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OnMiss {
    /// The ticks that are late run without a pause, until the model is back at the time of the clock.
    CatchUp,
    /// The ticks that are late are left out: the model falls behind the clock by them, and keeps its pace from there.
    Skip,
}

/// The pace of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pace {
    /// Time from tick to tick and length of a step, in s; above 0.
    pub step: f64,
    /// Number of ticks; `None`: until the exchange ends the run.
    pub ticks: Option<u64>,
    /// What to do when a tick takes too long.
    pub on_miss: OnMiss,
    /// Whether the state is [projected](crate::Events::project) at the end of each step.
    pub project: bool,
}

/// What a run exchanges with the outside.
pub trait Exchange<S> {
    /// Before the step that begins at `t`: inputs are set here. False ends the run.
    fn input(&mut self, t: f64, system: &mut S) -> bool;
    /// After the step that ended at `t`, with the values that [`Events::observe`](crate::Events::observe) gives there.
    fn output(&mut self, t: f64, values: &[f64]);
}

/// A step is taken in vain if so many times its last length are left before the tick.
const REHEARSED: f64 = 8.0;

/// Runs `system` from the state `x` at time 0, a step a tick; gives what it took.
///
/// # Errors
/// What the system reports: the run has stopped there, and `x` holds the last state reached.
#[allow(clippy::result_large_err, reason = "a run fails once")]
pub fn run_real_time<S: HybridSystem>(
    system: &mut S,
    method: FixedMethod,
    pace: &Pace,
    x: &mut [f64],
    clock: &mut dyn Clock,
    exchange: &mut dyn Exchange<S>,
    statistics: &Statistics,
) -> Result<Summary, Stopped> {
    let mut vain = x.to_vec();
    let mut run = Stepwise::new(method, 0.0, system).projecting(pace.project);
    let mut values = vec![0.0; system.observed()];
    run.start(system, x)?;
    run.prepare(system, pace.step, x);
    let mut due = clock.now();
    let mut last = f64::INFINITY;
    for tick in 0..pace.ticks.unwrap_or(u64::MAX) {
        // What has not run for a while has left the caches: while there is time, the step is taken in vain.
        clock.wait_busily(due, &mut |left| {
            if left > REHEARSED * last {
                vain.copy_from_slice(x);
                let done = run.try_step(system, pace.step, &mut vain);
                let _ = done.and_then(|()| system.observe(run.time(), &vain, &mut values));
            }
        });
        let begun = clock.now();
        if !exchange.input(run.time(), system) {
            break;
        }
        let fed = clock.now();
        // Ticks are counted, not added up: a day of 1 ms is a day.
        run.advance(system, (tick + 1) as f64 * pace.step, x)?;
        let observed = system.observe(run.time(), x, &mut values);
        observed.map_err(|failure| run.stopped(failure))?;
        let done = clock.now();
        exchange.output(run.time(), &values);
        let late = clock.now() - (due + pace.step);
        last = done - fed;
        statistics.tick(run.time(), begun - due, done - fed, late > 0.0);
        due += pace.step;
        if late > 0.0 && pace.on_miss == OnMiss::Skip {
            let left_out = (late / pace.step).ceil();
            statistics.leave_out(left_out as u64);
            due += left_out * pace.step;
        }
    }
    Ok(run.summary())
}
