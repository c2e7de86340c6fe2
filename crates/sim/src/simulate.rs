//! A whole run: from an initial state through jumps and switches to the end, samples on the way.

use std::cell::{RefCell, RefMut};
use std::fmt;
use std::ops::ControlFlow;

use crate::events::Sides;
use crate::fixed_step::{FixedMethod, FixedStep};
use crate::grid::Grid;
use crate::scene::Scene;
use crate::shared::Shared;
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
    /// Jacobians of a system in implicit form, or by [`Method::Radau`].
    pub jacobians: usize,
    /// Factorisations of matrices; for [`Method::Radau`] a real and a complex one count as one.
    pub factorisations: usize,
    /// Newton iterations of [`Method::Radau`], each the solution of a real and a complex system.
    pub iterations: usize,
    /// Jumps crossed that were known in advance, the start not counted.
    pub jumps: usize,
    /// Corners of inputs that steps ended at, where nothing jumps but slopes.
    pub corners: usize,
    /// Crossings of switching functions.
    pub switches: usize,
    /// Whether `auto` changed to the stiff method.
    pub stiff: bool,
}

impl Summary {
    /// Counts a corner, or a jump.
    pub(crate) fn meet(&mut self, corner: bool) {
        self.corners += usize::from(corner);
        self.jumps += usize::from(!corner);
    }
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
#[allow(clippy::result_large_err, reason = "a run fails once")]
pub fn simulate(
    system: &mut dyn System,
    options: &Options,
    x: &mut [f64],
    sink: &mut dyn Sink,
) -> Result<Summary, Stopped> {
    let shared = Shared::new(system);
    let mut run = Run::new(shared.scene(), options, sink);
    let end = match options.check(x.len()) {
        Err(failure) => Err(failure),
        Ok(()) => match (options.method, options.step) {
            (Method::Fixed(method), Some(step)) => run.fixed(&shared, method, step, x),
            _ => crate::variable_step::run(&mut run, &shared, x),
        },
    };
    let (system, time) = (shared.system(), run.time);
    let summary = Summary { rates: system.rates, tangents: system.tangents, ..run.counts };
    end.map(|()| summary).map_err(|failure| Stopped { failure, time, summary })
}

/// The parts of a run that all methods share.
pub(crate) struct Run<'a> {
    scene: &'a RefCell<dyn Scene + 'a>,
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
    pub(crate) fn new(scene: &'a RefCell<dyn Scene + 'a>, options: &'a Options, sink: &'a mut dyn Sink) -> Run<'a> {
        let (observed, switches) = (scene.borrow().observed(), scene.borrow().switches());
        Run {
            values: vec![0.0; observed],
            sides: Sides::new(switches),
            scene,
            options,
            time: options.from,
            counts: Summary::default(),
            sink,
            grid: options.every.map(|every| Grid::new(options.from, every)),
        }
    }

    /// The system, to be given back before anybody else asks for it.
    pub(crate) fn scene(&self) -> RefMut<'_, dyn Scene + 'a> {
        self.scene.borrow_mut()
    }

    /// The start counts as a jump.
    pub(crate) fn start(&mut self, x: &mut [f64]) -> Result<(), Failure> {
        if let Some(state) = x.iter().position(|value| !value.is_finite()) {
            return Err(Failure::NotFinite { time: self.time, what: self.scene().name(state) });
        }
        self.cross(self.time, x)?;
        self.scene().accept(self.time, x)?;
        self.record(self.time, self.time, x)
    }

    /// A step to `(t, x)` is accepted.
    pub(crate) fn reach(&mut self, t: f64, x: &[f64]) -> Result<(), Failure> {
        self.time = t;
        self.scene().accept(t, x)?;
        match self.sink.progress(t) {
            ControlFlow::Continue(()) => Ok(()),
            ControlFlow::Break(()) => Err(Failure::Interrupted { time: t }),
        }
    }

    /// Says how exact each state is kept.
    pub(crate) fn tell_tolerances(&mut self, magnitudes: &[f64], absolute: &[f64]) {
        self.sink.tolerances(magnitudes, absolute);
    }

    /// Says that the run crawls.
    pub(crate) fn tell_crawl(&mut self, crawl: &Crawl) {
        self.sink.crawls(crawl);
    }

    /// Samples where the run stands, if that is due. On a grid the sample bears the time of the grid, from which the run
    /// may be a rounding error away.
    pub(crate) fn settle(&mut self, x: &[f64]) -> Result<(), Failure> {
        let due = self.grid.as_ref().map_or(Some(self.time), |grid| grid.is_due(self.time).then(|| grid.next()));
        let at_end = (self.time >= self.options.to).then_some(self.options.to);
        at_end.or(due).map_or(Ok(()), |label| self.record(label, self.time, x))
    }

    /// Crosses the jump or crossing at which the run stands, and samples: on a grid what is true after it, else both.
    pub(crate) fn settle_at_jump(&mut self, x: &mut [f64]) -> Result<(), Failure> {
        if self.grid.is_none() {
            self.record(self.time, self.time, x)?;
        }
        self.cross(self.time, x)?;
        self.settle(x)
    }

    /// Counts what was announced for `t`; whether it is a mere corner.
    pub(crate) fn meet(&mut self, t: f64) -> bool {
        let corner = self.scene.borrow_mut().is_corner(t);
        self.counts.meet(corner);
        corner
    }

    fn cross(&mut self, t: f64, x: &mut [f64]) -> Result<(), Failure> {
        let scene = &mut *self.scene.borrow_mut();
        scene.cross_jump(t, x)?;
        self.sides.take(scene, t, x)
    }

    /// The next time of the grid that is clearly before `end`.
    pub(crate) fn sample_before(&self, end: f64) -> Option<f64> {
        self.grid
            .as_ref()
            .map(|grid| (grid.next(), grid.slack()))
            .filter(|(next, slack)| next + slack < end)
            .map(|(next, _)| next)
    }

    /// Hands over the values at `(t, x)` as the sample of time `label`.
    pub(crate) fn record(&mut self, label: f64, t: f64, x: &[f64]) -> Result<(), Failure> {
        self.scene.borrow_mut().observe(t, x, &mut self.values)?;
        if let Some(value) = self.values.iter().position(|value| value.is_nan()) {
            return Err(Failure::NotFinite { time: t, what: self.scene().observed_name(value) });
        }
        self.sink.sample(label, &self.values);
        if let Some(grid) = &mut self.grid {
            grid.pass(label);
        }
        Ok(())
    }

    fn fixed(&mut self, shared: &Shared<'_>, method: FixedMethod, step: f64, x: &mut [f64]) -> Result<(), Failure> {
        let mut stepper = FixedStep::new(method, shared.system().sparsity());
        let mut ticks = Grid::new(self.options.from, step);
        self.start(x)?;
        while self.time < self.options.to {
            ticks.pass(self.time);
            let jump = self.scene().next_jump(self.time);
            let target = self.target(ticks.next(), jump, ticks.slack());
            stepper.step(&mut *shared.system(), self.time, target - self.time, x)?;
            self.counts.steps += 1;
            let switched = self.sides.crossed(&mut *self.scene.borrow_mut(), target, x)?.is_some();
            self.counts.switches += usize::from(switched);
            if jump == Some(target) {
                self.meet(target);
            }
            self.reach(target, x)?;
            if switched || jump == Some(target) {
                self.settle_at_jump(x)?;
            } else {
                self.settle(x)?;
            }
        }
        Ok(())
    }

    /// Where the step that starts now has to end: at the tick, sooner at a sample, the end or a jump; a jump a rounding
    /// error later is waited for.
    fn target(&self, tick: f64, jump: Option<f64>, slack: f64) -> f64 {
        let target = tick.min(self.grid.as_ref().map_or(tick, Grid::next));
        let target = if target + slack >= self.options.to { self.options.to } else { target };
        jump.filter(|&jump| jump <= target + slack && jump <= self.options.to).unwrap_or(target)
    }
}
