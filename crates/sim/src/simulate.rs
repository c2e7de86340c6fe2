//! A whole run: from an initial state through jumps and switches to the end, samples on the way.

use std::fmt;
use std::ops::ControlFlow;

use crate::events::Sides;
use crate::fixed_step::{FixedMethod, FixedStep};
use crate::grid::Grid;
use crate::{Failure, Method, Options, System};

/// Receives what a run computes.
pub trait Sink {
    /// The values that [`System::observe`] gives at `t`. Times never decrease; with samples at every step a jump gives
    /// two samples of equal time, before and after it.
    fn sample(&mut self, t: f64, values: &[f64]);

    /// The run has come to `t`. Called after every step. `Break` stops the run.
    fn progress(&mut self, t: f64) -> ControlFlow<()> {
        let _ = t;
        ControlFlow::Continue(())
    }
}

/// What a run took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Summary {
    /// Accepted steps.
    pub steps: usize,
    /// Steps tried in vain: error too large, Newton without convergence, or a failure of the system.
    pub rejected: usize,
    /// Evaluations of the rates.
    pub rates: usize,
    /// Directional derivatives of the rates.
    pub tangents: usize,
    /// Jumps crossed that were known in advance, the start not counted.
    pub jumps: usize,
    /// Crossings of switching functions.
    pub switches: usize,
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
}

impl fmt::Display for Stopped {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.failure.fmt(f)
    }
}

impl std::error::Error for Stopped {}

/// Integrates `system` from the state `x` at `options.from` to `options.to`, and leaves the last state reached in `x`.
///
/// # Errors
/// The run stopped; what was computed so far is with the sink, and `x` holds the state at `Stopped::time`.
pub fn simulate(
    system: &mut dyn System,
    options: &Options,
    x: &mut [f64],
    sink: &mut dyn Sink,
) -> Result<Summary, Stopped> {
    let mut run = Run::new(system, options, sink);
    let end = match options.check(x.len()) {
        Err(failure) => Err(failure),
        Ok(()) => match (options.method, options.step) {
            (Method::Fixed(method), Some(step)) => run.fixed(method, step, x),
            _ => crate::variable_step::run(&mut run, x),
        },
    };
    let summary = run.summary();
    end.map(|()| summary).map_err(|failure| Stopped { failure, time: run.time, summary })
}

/// The parts of a run that all methods share.
pub(crate) struct Run<'a> {
    pub(crate) system: Counted<'a>,
    pub(crate) options: &'a Options,
    pub(crate) sides: Sides,
    /// How far the run has come: `x` belongs to this time.
    pub(crate) time: f64,
    pub(crate) counts: Summary,
    sink: &'a mut dyn Sink,
    grid: Option<Grid>,
    values: Vec<f64>,
}

impl<'a> Run<'a> {
    fn new(system: &'a mut dyn System, options: &'a Options, sink: &'a mut dyn Sink) -> Run<'a> {
        Run {
            values: vec![0.0; system.observed()],
            sides: Sides::new(system.switches()),
            system: Counted { system, rates: 0, tangents: 0 },
            options,
            time: options.from,
            counts: Summary::default(),
            sink,
            grid: options.every.map(|every| Grid::new(options.from, every)),
        }
    }

    fn summary(&self) -> Summary {
        Summary { rates: self.system.rates, tangents: self.system.tangents, ..self.counts }
    }

    /// The start counts as a jump.
    pub(crate) fn start(&mut self, x: &mut [f64]) -> Result<(), Failure> {
        if let Some(state) = x.iter().position(|value| !value.is_finite()) {
            return Err(Failure::NotFinite { time: self.time, what: self.system.state_name(state) });
        }
        self.system.cross_jump(self.time, x)?;
        self.system.accept(self.time, x)?;
        self.sides.take(&mut self.system, self.time, x)?;
        self.record(self.time, x)
    }

    /// A step to `(t, x)` is accepted and no jump or crossing stands there.
    pub(crate) fn arrive(&mut self, t: f64, x: &[f64]) -> Result<(), Failure> {
        self.reach(t, x)?;
        self.sample_if_due(t, x)
    }

    /// A step to `(t, x)` is accepted and a jump or a crossing stands there: crosses it.
    pub(crate) fn arrive_at_jump(&mut self, t: f64, x: &mut [f64]) -> Result<(), Failure> {
        self.reach(t, x)?;
        if self.grid.is_none() {
            self.record(t, x)?;
        }
        self.system.cross_jump(t, x)?;
        self.sides.take(&mut self.system, t, x)?;
        self.sample_if_due(t, x)
    }

    /// The next time that has to be sampled exactly, if the samples stand on a grid.
    pub(crate) fn next_sample(&self) -> Option<f64> {
        self.grid.as_ref().map(Grid::next)
    }

    /// Hands over the sample due at `t`, which is that of the grid.
    pub(crate) fn record(&mut self, t: f64, x: &[f64]) -> Result<(), Failure> {
        self.system.observe(t, x, &mut self.values)?;
        if let Some(value) = self.values.iter().position(|value| value.is_nan()) {
            let what = self.system.observed_name(value);
            return Err(Failure::NotFinite { time: t, what });
        }
        self.sink.sample(t, &self.values);
        if let Some(grid) = &mut self.grid {
            grid.pass(t);
        }
        Ok(())
    }

    fn reach(&mut self, t: f64, x: &[f64]) -> Result<(), Failure> {
        self.system.accept(t, x)?;
        self.time = t;
        match self.sink.progress(t) {
            ControlFlow::Continue(()) => Ok(()),
            ControlFlow::Break(()) => Err(Failure::Interrupted { time: t }),
        }
    }

    fn sample_if_due(&mut self, t: f64, x: &[f64]) -> Result<(), Failure> {
        let due = self.grid.as_ref().is_none_or(|grid| grid.is_due(t)) || t >= self.options.to;
        if due { self.record(t, x) } else { Ok(()) }
    }

    fn fixed(&mut self, method: FixedMethod, step: f64, x: &mut [f64]) -> Result<(), Failure> {
        let mut stepper = FixedStep::new(method, self.system.sparsity());
        let mut ticks = Grid::new(self.options.from, step);
        self.start(x)?;
        while self.time < self.options.to {
            ticks.pass(self.time);
            let jump = self.system.next_jump(self.time);
            let target = self.target(ticks.next(), jump, ticks.slack());
            stepper.step(&mut self.system, self.time, target - self.time, x)?;
            self.counts.steps += 1;
            let switched = self.sides.crossed(&mut self.system, target, x)?.is_some();
            self.counts.switches += usize::from(switched);
            self.counts.jumps += usize::from(jump == Some(target));
            if switched || jump == Some(target) {
                self.arrive_at_jump(target, x)?;
            } else {
                self.arrive(target, x)?;
            }
        }
        Ok(())
    }

    /// Where the step that starts now has to end: at the tick, sooner at a sample, the end or a jump; a jump a rounding
    /// error later is waited for.
    fn target(&self, tick: f64, jump: Option<f64>, slack: f64) -> f64 {
        let target = tick.min(self.next_sample().unwrap_or(tick));
        let target = if target + slack >= self.options.to { self.options.to } else { target };
        jump.filter(|&jump| jump <= target + slack && jump <= self.options.to).unwrap_or(target)
    }
}

/// A system whose evaluations are counted.
pub(crate) struct Counted<'a> {
    system: &'a mut dyn System,
    rates: usize,
    tangents: usize,
}

impl System for Counted<'_> {
    fn states(&self) -> usize {
        self.system.states()
    }
    fn state_name(&self, state: usize) -> String {
        self.system.state_name(state)
    }
    fn switch_name(&self, switch: usize) -> String {
        self.system.switch_name(switch)
    }
    fn observed_name(&self, value: usize) -> String {
        self.system.observed_name(value)
    }
    fn scales(&self) -> &[f64] {
        self.system.scales()
    }
    fn rates(&mut self, t: f64, x: &[f64], dx: &mut [f64]) -> Result<(), Failure> {
        self.rates += 1;
        self.system.rates(t, x, dx)
    }
    fn tangent(&mut self, t: f64, x: &[f64], v: &[f64], jv: &mut [f64]) -> Result<(), Failure> {
        self.tangents += 1;
        self.system.tangent(t, x, v, jv)
    }
    fn sparsity(&self) -> &crate::Sparsity {
        self.system.sparsity()
    }
    fn observe(&mut self, t: f64, x: &[f64], out: &mut [f64]) -> Result<(), Failure> {
        self.system.observe(t, x, out)
    }
    fn observed(&self) -> usize {
        self.system.observed()
    }
    fn next_jump(&mut self, t: f64) -> Option<f64> {
        self.system.next_jump(t)
    }
    fn cross_jump(&mut self, t: f64, x: &mut [f64]) -> Result<(), Failure> {
        self.system.cross_jump(t, x)
    }
    fn accept(&mut self, t: f64, x: &[f64]) -> Result<(), Failure> {
        self.system.accept(t, x)
    }
    fn switches(&self) -> usize {
        self.system.switches()
    }
    fn switch_values(&mut self, t: f64, x: &[f64], g: &mut [f64]) -> Result<(), Failure> {
        self.system.switch_values(t, x, g)
    }
}
