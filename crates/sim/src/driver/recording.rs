//! When a run is sampled and shown.

use super::grid::inside;
use super::{Grid, Run, Stepper};
use crate::events::Events;
use crate::{Affected, Failure};

/// Steps shorter than this part of the time have no samples inside.
const SHORT: f64 = 1e-9;

/// Where samples are taken.
pub(super) enum Samples {
    /// At the end of every step, and on both sides of every event.
    EveryStep,
    /// At these times.
    Grid(Grid),
    /// Nowhere: somebody else does.
    Nowhere,
}

impl Run<'_> {
    /// Shows the sink where the run stands, if it wants to see every step.
    pub(super) fn show(&mut self, events: &mut dyn Events, point: &[f64]) -> Result<(), Failure> {
        if !self.watched {
            return Ok(());
        }
        self.seen = Some(self.time);
        self.observe(events, self.time, point)?;
        events.passed_pole(self.time)?;
        self.sink.watch(self.time, &self.values)
    }

    /// As which time a sample is due where the run stands, if it is. On a grid the sample bears the time of the grid, from
    /// which the run may be a rounding error away.
    pub(crate) fn due(&self) -> Option<f64> {
        let due = match &self.samples {
            Samples::Nowhere => return None,
            Samples::EveryStep => Some(self.time),
            Samples::Grid(grid) => grid.is_due(self.time).then(|| grid.next()),
        };
        (self.time >= self.to).then_some(self.to).or(due)
    }

    /// Samples where the run stands, if that is due.
    pub(super) fn settle(&mut self, events: &mut dyn Events, point: &[f64]) -> Result<(), Failure> {
        self.due().map_or(Ok(()), |label| self.record(events, label, self.time, point))
    }

    /// The next time of the grid.
    pub(crate) fn next_sample(&self) -> f64 {
        if let Samples::Grid(grid) = &self.samples { grid.next() } else { f64::INFINITY }
    }

    /// Samples inside the last step: those of the grid, clearly before its end, or those that every step has.
    pub(super) fn samples_inside<S: Stepper>(&mut self, stepper: &mut S, start: f64, end: f64) -> Result<(), Failure> {
        // Of a step that is next to nothing of the time the inside is rounding.
        let wanted = matches!(self.samples, Samples::EveryStep) && self.counts.steps <= self.options.inside;
        if wanted && end - start > SHORT * end.abs() {
            for t in inside(start, end.min(self.to)) {
                self.sample_inside(stepper, t)?;
            }
        }
        while let Samples::Grid(grid) = &self.samples
            && grid.next() + grid.slack() < end
        {
            self.sample_inside(stepper, grid.next())?;
        }
        Ok(())
    }

    fn sample_inside<S: Stepper>(&mut self, stepper: &mut S, t: f64) -> Result<(), Failure> {
        let mut inside = std::mem::take(&mut self.inside);
        stepper.sample(t, &mut inside);
        let recorded = self.record(&mut *stepper.events(), t, t, &inside);
        self.inside = inside;
        recorded
    }

    /// Hands over the values at `(t, point)` as the sample of time `label`.
    pub(super) fn record(&mut self, events: &mut dyn Events, label: f64, t: f64, point: &[f64]) -> Result<(), Failure> {
        if self.observed != Some(t) {
            self.observe(events, t, point)?;
        }
        if let Some(value) = self.values.iter().position(|value| value.is_nan()) {
            return Err(Failure::NotFinite { time: t, what: Affected::variable(events.observed_name(value)) });
        }
        self.hand_over(label);
        Ok(())
    }

    fn observe(&mut self, events: &mut dyn Events, t: f64, point: &[f64]) -> Result<(), Failure> {
        self.observed = None;
        events.observe(t, point, &mut self.values)?;
        self.observed = Some(t);
        Ok(())
    }

    /// Hands over values that were observed elsewhere, as the sample that is due.
    pub(crate) fn record_values(&mut self, label: f64, values: impl Iterator<Item = f64>) {
        self.observed = None;
        self.values.iter_mut().zip(values).for_each(|(own, value)| *own = value);
        self.hand_over(label);
    }

    fn hand_over(&mut self, label: f64) {
        self.sink.sample(label, &self.values);
        if let Samples::Grid(grid) = &mut self.samples {
            grid.pass(label);
        }
    }
}
