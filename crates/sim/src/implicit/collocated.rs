//! Radau IIA on a system in implicit form, as the driver takes it.

use std::ops::DerefMut;

use super::tolerances::Tolerances;
use crate::driver::{Flow, Run, Stepper, is_at};
use crate::events::Events;
use crate::radau::Radau;
use crate::{Failure, HybridImplicitSystem, Summary, halves, halves_mut};

/// Part of the time in which the unknowns would change altogether that the first step takes.
const CAREFUL: f64 = 0.01;

/// Part of the way to the stop that the first step takes where nothing moves yet.
const UNKNOWN: f64 = 1e-6;

/// The method at work on a run. A point holds all unknowns, then all their rates.
pub(super) struct Collocated<'a> {
    system: &'a mut dyn HybridImplicitSystem,
    radau: Radau,
    tolerances: Tolerances,
    /// Longest step allowed, in s.
    most: f64,
    /// Step to go on with, where the run stands at a mere corner.
    resume: Option<f64>,
    /// Where the step at hand started.
    from: f64,
    /// Longest step since the last event.
    longest: f64,
}

impl<'a> Collocated<'a> {
    /// Of a run whose system stands where it begins or goes on.
    ///
    /// # Errors
    /// What the system reports.
    pub(super) fn new(run: &Run<'_>, system: &'a mut dyn HybridImplicitSystem) -> Result<Collocated<'a>, Failure> {
        let tolerances = Tolerances::new(run.options, run.time, system)?;
        let radau = Radau::new(system, tolerances.relative(), tolerances.absolute());
        Ok(Collocated {
            system,
            radau,
            tolerances,
            most: run.options.step.unwrap_or(f64::INFINITY),
            resume: None,
            from: run.time,
            longest: 0.0,
        })
    }

    /// Adds what the method took.
    pub(super) fn add_work(&self, counts: &mut Summary) {
        self.radau.work().add_to(counts);
        counts.rates += self.radau.work().residuals;
    }

    /// Makes the method follow the tolerances, and says what they are.
    fn take_tolerances(&mut self, run: &mut Run<'_>) {
        self.radau.set_tolerances(self.tolerances.relative(), self.tolerances.absolute());
        run.report_tolerances(self.tolerances.magnitudes(), self.tolerances.absolute());
    }

    /// Takes magnitudes anew where no step is short enough; whether that helps.
    fn renew(&mut self, time: f64, interval: f64, point: &[f64]) -> Result<bool, Failure> {
        let (y, yp) = halves(point);
        let moved = self.radau.rates_alone(&mut *self.system, time, y, yp)?;
        if !self.tolerances.renew(&mut *self.system, time, (y, &moved), interval)? {
            return Ok(false);
        }
        self.radau.set_tolerances(self.tolerances.relative(), self.tolerances.absolute());
        self.radau.restart(time, y, yp, UNKNOWN * interval);
        Ok(true)
    }

    /// Whether the event left the unknowns alone and the step that ended there would not have told their rates from its own.
    fn is_corner(&self, point: &[f64]) -> bool {
        let (y, yp) = halves(point);
        let mut jump: Vec<f64> = yp.iter().zip(self.radau.rates()).map(|(after, before)| after - before).collect();
        self.radau.forget_algebraic(&mut jump);
        let length = self.radau.time() - self.radau.start();
        y == self.radau.state() && self.tolerances.norm(&jump, y) * length <= 1.0
    }
}

impl Stepper for Collocated<'_> {
    const DENSE: bool = true;

    fn events(&mut self) -> impl DerefMut<Target = dyn Events + '_> {
        let events: &mut (dyn Events + '_) = &mut *self.system;
        events
    }

    fn begin_interval(&mut self, run: &mut Run<'_>, stop: f64, point: &[f64]) -> Result<Flow, Failure> {
        let (time, (y, yp)) = (run.time, halves(point));
        let longest = (stop - time).min(self.most);
        self.longest = 0.0;
        if let Some(step) = self.resume.take() {
            self.radau.resume(time, y, yp, step.min(longest));
            return Ok(Flow::GoOn);
        }
        self.tolerances.guess(&mut *self.system, time, (y, yp), stop - time)?;
        self.take_tolerances(run);
        self.system.note_magnitudes(time, point, self.tolerances.magnitudes())?;
        let moved = self.radau.rates_alone(&mut *self.system, time, y, yp)?;
        // What passes through 0 has its size from elsewhere.
        let sizes: Vec<f64> = y.iter().zip(self.tolerances.magnitudes()).map(|(y, most)| y.abs().max(*most)).collect();
        let (size, speed) = (self.tolerances.norm(&sizes, y), self.tolerances.norm(&moved, y));
        let step = if size < 1e-5 || speed < 1e-5 { UNKNOWN * longest } else { CAREFUL * size / speed };
        self.radau.restart(time, y, yp, step.min(longest));
        Ok(Flow::GoOn)
    }

    fn step(&mut self, from: f64, _: f64, stop: f64, point: &[f64]) -> Result<f64, Failure> {
        self.from = from;
        let latest = stop.min(from + self.most);
        match self.radau.step(&mut *self.system, latest) {
            Err(Failure::StepTooSmall { .. }) if self.renew(from, latest - from, point)? => {
                self.radau.step(&mut *self.system, latest)?;
            }
            made => made?,
        }
        let end = self.radau.time();
        Ok(if is_at(end, stop, self.radau.start()) { stop } else { end })
    }

    fn accept(&mut self, end: f64, point: &mut [f64]) {
        self.longest = self.longest.max(end - self.from);
        let (y, yp) = halves_mut(point);
        y.copy_from_slice(self.radau.state());
        yp.copy_from_slice(self.radau.rates());
    }

    fn interpolate(&mut self, t: f64, point: &mut [f64]) {
        let (y, yp) = halves_mut(point);
        self.radau.interpolate(t, y);
        self.radau.rates_between(t, yp);
    }

    /// The point of a step to there, or by the polynomial if there is none: `F = 0` holds in samples as well.
    fn sample(&mut self, t: f64, point: &mut [f64]) {
        let (y, yp) = halves_mut(point);
        if !self.radau.visit(&mut *self.system, t, y, yp) {
            self.interpolate(t, point);
        }
    }

    fn accept_crossing(&mut self, t: f64, point: &mut [f64]) {
        self.sample(t, point);
    }

    fn shorten(&mut self, t: f64) -> bool {
        self.radau.shorten(&mut *self.system, t)
    }

    fn after_event(&mut self, _: bool, point: &[f64]) {
        self.resume = self.is_corner(point).then(|| self.longest.max(self.radau.next_step()));
    }

    fn forget(&mut self) {
        self.resume = None;
    }

    fn supervise(&mut self, run: &mut Run<'_>, _: f64, _: &[f64]) -> Result<Flow, Failure> {
        if self.tolerances.watch(self.radau.state()) {
            self.take_tolerances(run);
        }
        Ok(Flow::GoOn)
    }
}
