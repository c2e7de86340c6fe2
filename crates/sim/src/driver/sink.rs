//! What receives the results of a run, and what a run comes to.

use std::fmt;
use std::ops::ControlFlow;

use crate::Failure;

/// Receives what a run computes: a trace, a file, an audit.
pub trait Sink {
    /// The values that [`Events::observe`](crate::Events::observe) gives at `t`. Times never decrease; with samples at every
    /// step an event gives two samples of equal time, before and after it.
    fn sample(&mut self, t: f64, values: &[f64]);

    /// Whether every step is to be shown to [`watch`](Sink::watch). Asked once, before the run.
    fn watches(&self) -> bool {
        false
    }

    /// The values where a step ends, and once more where an event was handled, whether they are sampled there or not.
    ///
    /// # Errors
    /// What is wrong with them, which stops the run.
    fn watch(&mut self, t: f64, values: &[f64]) -> Result<(), Failure> {
        let _ = (t, values);
        Ok(())
    }

    /// The run has come to `t`. Called after every step. `Break` stops the run.
    fn progress(&mut self, t: f64) -> ControlFlow<()> {
        let _ = t;
        ControlFlow::Continue(())
    }

    /// How exact each state is kept from now on by a method of variable step: the magnitude that it is taken to have, and the
    /// absolute error allowed in a step, each in its own unit.
    fn tolerances(&mut self, magnitudes: &[f64], absolute: &[f64]) {
        let _ = (magnitudes, absolute);
    }

    /// The run takes so many steps that its end is far away. Told a few times at most.
    fn crawls(&mut self, crawl: &Crawl) {
        let _ = crawl;
    }
}

/// The sink that takes nothing.
pub struct Nobody;

impl Sink for Nobody {
    fn sample(&mut self, _: f64, _: &[f64]) {}
}

/// A run that takes very many steps. Times in s.
#[derive(Clone, Debug, PartialEq)]
pub struct Crawl {
    /// How far it has come.
    pub time: f64,
    /// Steps so far.
    pub steps: usize,
    /// The present step.
    pub step: f64,
    /// The state that asks for steps that short: its rate changes most for what is allowed of it.
    pub state: String,
}

/// What a run took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Summary {
    /// Accepted steps.
    pub steps: usize,
    /// Steps tried in vain: error too large, Newton without convergence, or a failure of the system.
    pub rejected: usize,
    /// Evaluations of the rates, or of the residuals of a system in implicit form.
    pub rates: usize,
    /// Directional derivatives of the rates.
    pub tangents: usize,
    /// Jacobians of a system in implicit form, or by [`Method::Radau`](crate::Method::Radau).
    pub jacobians: usize,
    /// Factorisations of matrices; for [`Method::Radau`](crate::Method::Radau) a real and a complex one count as one.
    pub factorisations: usize,
    /// Newton iterations of [`Method::Radau`](crate::Method::Radau), each the solution of a real and a complex system.
    pub iterations: usize,
    /// Time events, the start and mere corners not counted.
    pub jumps: usize,
    /// Corners of inputs that steps ended at, where nothing jumps but slopes.
    pub corners: usize,
    /// Zero crossings of event indicators.
    pub crossings: usize,
    /// How often other variables have become independent.
    pub exchanges: usize,
    /// How often the point was put back onto relations that its rates keep.
    pub projections: usize,
    /// Whether `auto` changed to the stiff method.
    pub stiff: bool,
}

/// A run that stopped before its end. All samples up to `time` were handed to the sink.
#[derive(Clone, Debug, PartialEq)]
pub struct Stopped {
    /// Why.
    pub failure: Failure,
    /// How far the run came, in s.
    pub time: f64,
    /// What it took so far.
    pub summary: Summary,
    /// Where the rates had no finite value last: time in s and state. `None` if they always had.
    pub without_rates: Option<(f64, Vec<f64>)>,
}

impl fmt::Display for Stopped {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.failure.fmt(f)
    }
}

impl std::error::Error for Stopped {}
