//! Steps of fixed length, as the driver takes them.

use std::ops::DerefMut;

use super::FixedStep;
use crate::Failure;
use crate::driver::{Grid, Stepper};
use crate::events::Events;
use crate::shared::Counted;

/// Parts of a step, one after the other, by which it is tried where positions cannot be followed to its end: beside a
/// position through which another motion leads, not all of them are too near to it.
const SHORTER: [f64; 4] = [0.5, 0.7, 0.3, 0.1];

/// A method of fixed step at work on a run: from tick to tick, in shorter steps where something else comes before.
pub(crate) struct Ticks<'m, 'a> {
    method: &'m mut FixedStep,
    system: Counted<'a>,
    /// `None`: the run ends at the tick.
    grid: Option<Grid>,
    /// Where the next step ends, and what came of it, if it has been made elsewhere.
    made: Option<(f64, Result<(), Failure>)>,
}

impl<'m, 'a> Ticks<'m, 'a> {
    /// Steps of this length from this time on, in s.
    pub(crate) fn new(method: &'m mut FixedStep, system: Counted<'a>, (from, step): (f64, f64)) -> Ticks<'m, 'a> {
        Ticks { method, system, grid: Some(Grid::new(from, step)), made: None }
    }

    /// One step, if nothing comes before the end of the run.
    pub(crate) fn one(method: &'m mut FixedStep, system: Counted<'a>) -> Ticks<'m, 'a> {
        Ticks { method, system, grid: None, made: None }
    }

    /// A step that was made elsewhere: the method has the state where it ends.
    pub(crate) fn made(
        method: &'m mut FixedStep,
        system: Counted<'a>,
        end: f64,
        outcome: Result<(), Failure>,
    ) -> Ticks<'m, 'a> {
        Ticks { method, system, grid: None, made: Some((end, outcome)) }
    }

    pub(crate) fn system(&mut self) -> &mut Counted<'a> {
        &mut self.system
    }

    /// A step to `end`, which is given back.
    fn advance(&mut self, from: f64, end: f64, x: &[f64]) -> Result<f64, Failure> {
        self.method.advance(&mut self.system, from, end - from, x)?;
        self.system.events().try_end(end, self.method.advanced())?;
        Ok(end)
    }

    /// The same for a step that has been made.
    fn arrived(&mut self, end: f64, outcome: Result<(), Failure>) -> Result<f64, Failure> {
        outcome?;
        self.method.check(&self.system, end)?;
        self.system.events().try_end(end, self.method.advanced())?;
        Ok(end)
    }
}

/// Where the step has to end that starts at `time`: at the tick, sooner at a sample or the stop; a stop a rounding error
/// later is waited for.
pub(crate) fn target(ticks: &mut Grid, time: f64, sample: f64, stop: f64) -> f64 {
    ticks.pass(time);
    let target = ticks.next().min(sample);
    if target + ticks.slack() >= stop { stop } else { target }
}

impl Stepper for Ticks<'_, '_> {
    const DENSE: bool = false;

    fn events(&mut self) -> impl DerefMut<Target = dyn Events + '_> {
        self.system.events()
    }
    fn step(&mut self, from: f64, sample: f64, stop: f64, x: &[f64]) -> Result<f64, Failure> {
        let (end, done) = match self.made.take() {
            Some((end, outcome)) => (end, self.arrived(end, outcome)),
            None => {
                let end = self.grid.as_mut().map_or(stop, |ticks| target(ticks, from, sample, stop));
                (end, self.advance(from, end, x))
            }
        };
        let failure = match done {
            Err(failure @ Failure::OffMotion { .. }) => failure,
            other => return other,
        };
        let shorter = SHORTER.iter().map(|part| from + part * (end - from));
        shorter.filter(|&sooner| sooner > from).find_map(|sooner| self.advance(from, sooner, x).ok()).ok_or(failure)
    }
    fn again(&mut self, from: f64, end: f64, x: &[f64]) -> Result<(), Failure> {
        self.method.advance(&mut self.system, from, end - from, x)
    }
    fn accept(&mut self, _: f64, x: &mut [f64]) {
        x.copy_from_slice(self.method.advanced());
    }
    fn after_change(&mut self) {
        self.method.leave();
    }
    /// Never asked for: there is no dense output.
    fn interpolate(&mut self, _: f64, _: &mut [f64]) {}
}
