//! Steps of fixed length, as the driver takes them.

use std::ops::DerefMut;

use super::FixedStep;
use crate::Failure;
use crate::driver::{Grid, Stepper};
use crate::events::Events;
use crate::shared::Counted;

/// A method of fixed step at work on a run: from tick to tick, in shorter steps where something else comes before.
pub(crate) struct Ticks<'m, 'a> {
    method: &'m mut FixedStep,
    system: Counted<'a>,
    /// `None`: the run ends at the tick.
    grid: Option<Grid>,
}

impl<'m, 'a> Ticks<'m, 'a> {
    /// Steps of this length from this time on, in s.
    pub(crate) fn new(method: &'m mut FixedStep, system: Counted<'a>, (from, step): (f64, f64)) -> Ticks<'m, 'a> {
        Ticks { method, system, grid: Some(Grid::new(from, step)) }
    }

    /// One step, if nothing comes before the end of the run.
    pub(crate) fn one(method: &'m mut FixedStep, system: Counted<'a>) -> Ticks<'m, 'a> {
        Ticks { method, system, grid: None }
    }

    pub(crate) fn system(&mut self) -> &mut Counted<'a> {
        &mut self.system
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
        let end = self.grid.as_mut().map_or(stop, |ticks| target(ticks, from, sample, stop));
        self.method.advance(&mut self.system, from, end - from, x)?;
        Ok(end)
    }
    fn again(&mut self, from: f64, end: f64, x: &[f64]) -> Result<(), Failure> {
        self.method.advance(&mut self.system, from, end - from, x)
    }
    fn accept(&mut self, _: f64, x: &mut [f64]) {
        x.copy_from_slice(self.method.advanced());
    }
    /// Never asked for: there is no dense output.
    fn interpolate(&mut self, _: f64, _: &mut [f64]) {}
}
