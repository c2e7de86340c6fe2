//! A system against the wall clock: a step of fixed length each tick, inputs before it and outputs after it.
//!
//! The loop only computes: it takes no lock and no memory and makes no call to the system but those of its clock and its
//! exchange. Source of the figures that it keeps: its own clock.

mod clock;
mod statistics;

pub use clock::{Clock, WallClock};
pub use statistics::{Histogram, Statistics};

use crate::events::Sides;
use crate::fixed_step::{FixedMethod, FixedStep};
use crate::shared::Counted;
use crate::{Failure, Stopped, Summary, System};

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
}

/// What a run exchanges with the outside.
pub trait Exchange<S> {
    /// Before the step that begins at `t`: inputs are set here. False ends the run.
    fn input(&mut self, t: f64, system: &mut S) -> bool;
    /// After the step that ended at `t`, with the values that [`System::observe`] gives there.
    fn output(&mut self, t: f64, values: &[f64]);
}

/// A step is taken in vain if so many times its last length are left before the tick.
const REHEARSED: f64 = 8.0;

/// Runs `system` from the state `x` at time 0, a step a tick.
///
/// # Errors
/// What the system reports: the run has stopped there, and `x` holds the last state reached.
#[allow(clippy::result_large_err, reason = "a run fails once")]
pub fn run_real_time<S: System>(
    system: &mut S,
    method: FixedMethod,
    pace: &Pace,
    x: &mut [f64],
    clock: &mut dyn Clock,
    exchange: &mut dyn Exchange<S>,
    statistics: &Statistics,
) -> Result<(), Stopped> {
    let mut ticker = Ticker::new(system, method);
    let mut values = vec![0.0; system.observed()];
    let mut vain = x.to_vec();
    let end = ticker.start(system, x).and_then(|()| {
        let mut due = clock.now();
        let mut last = f64::INFINITY;
        for tick in 0..pace.ticks.unwrap_or(u64::MAX) {
            // What has not run for a while has left the caches: while there is time, the step is taken in vain.
            clock.wait_busily(due, &mut |left| {
                if left > REHEARSED * last {
                    vain.copy_from_slice(x);
                    let done = ticker.stepper.step(system, ticker.time, pace.step, &mut vain);
                    let _ = done.and_then(|()| system.observe(ticker.time, &vain, &mut values));
                }
            });
            let begun = clock.now();
            if !exchange.input(ticker.time, system) {
                break;
            }
            let fed = clock.now();
            // Ticks are counted, not added up: a day of 1 ms is a day.
            ticker.advance(system, (tick + 1) as f64 * pace.step, x)?;
            system.observe(ticker.time, x, &mut values)?;
            let done = clock.now();
            exchange.output(ticker.time, &values);
            let late = clock.now() - (due + pace.step);
            last = done - fed;
            statistics.tick(ticker.time, begun - due, done - fed, late > 0.0);
            due += pace.step;
            if late > 0.0 && pace.on_miss == OnMiss::Skip {
                let left_out = (late / pace.step).ceil();
                statistics.leave_out(left_out as u64);
                due += left_out * pace.step;
            }
        }
        Ok(())
    });
    let Ticker { time, counts, .. } = ticker;
    end.map_err(|failure| Stopped { failure, time, summary: counts })
}

/// Steps of one tick: at jumps of time shorter ones.
struct Ticker {
    stepper: FixedStep,
    sides: Sides,
    time: f64,
    counts: Summary,
}

impl Ticker {
    fn new(system: &mut dyn System, method: FixedMethod) -> Ticker {
        Ticker {
            stepper: FixedStep::new(method, system.sparsity()),
            sides: Sides::new(system.switches()),
            time: 0.0,
            counts: Summary::default(),
        }
    }

    fn start(&mut self, system: &mut dyn System, x: &mut [f64]) -> Result<(), Failure> {
        self.cross(system, 0.0, x)?;
        system.accept(0.0, x)
    }

    fn cross(&mut self, system: &mut dyn System, t: f64, x: &mut [f64]) -> Result<(), Failure> {
        system.cross_jump(t, x)?;
        self.sides.take(&mut Counted::new(system), t, x)
    }

    /// Steps to `end`, meeting every jump on the way.
    fn advance(&mut self, system: &mut dyn System, end: f64, x: &mut [f64]) -> Result<(), Failure> {
        while self.time < end {
            let jump = system.next_jump(self.time).filter(|&jump| jump <= end);
            let target = jump.unwrap_or(end);
            self.stepper.step(system, self.time, target - self.time, x)?;
            self.counts.steps += 1;
            let switched = self.sides.crossed(&mut Counted::new(system), target, x)?.is_some();
            self.time = target;
            system.accept(target, x)?;
            if switched || jump.is_some() {
                self.counts.switches += usize::from(switched);
                if jump.is_some() {
                    self.counts.meet(system.is_corner(target));
                }
                self.cross(system, target, x)?;
            }
        }
        Ok(())
    }
}
