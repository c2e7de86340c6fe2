//! What the driver asks of a method.

use std::ops::DerefMut;

use super::Run;
use crate::Failure;
use crate::events::Events;

/// Where a run has to stop at the latest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Stop {
    /// When, in s.
    pub(crate) time: f64,
    /// Whether there is a time event; else the run ends there.
    pub(crate) is_event: bool,
}

/// Whether a method goes on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Flow {
    /// It does.
    GoOn,
    /// Another one is to take over from here; the stepper knows why.
    HandOver,
}

/// A method at work on a run, between its events.
///
/// The driver calls [`begin_interval`](Stepper::begin_interval) where the run stands, then for each step `step`, `accept`
/// (or `accept_crossing` at a zero crossing inside it), the events' own functions, `before_event` and `after_event` around a
/// time event, `after_change` after whatever has happened there, and `supervise`.
pub(crate) trait Stepper {
    /// Whether the solution is known inside a step. Then zero crossings are located and samples are taken there. Without it
    /// a step ends at the next sample, and a zero crossing counts from the end of the step in which it lies, unless
    /// [`Events::locates_crossings`] asks for shorter steps up to it.
    const DENSE: bool;

    /// The events of the system that is stepped, to be given back before the stepper is asked for anything else.
    fn events(&mut self) -> impl DerefMut<Target = dyn Events + '_>;

    /// Starts where the run stands, `stop` being the next time event or the end.
    ///
    /// # Errors
    /// What the system reports.
    fn begin_interval(&mut self, run: &mut Run<'_>, stop: f64, point: &[f64]) -> Result<Flow, Failure> {
        let _ = (run, stop, point);
        Ok(Flow::GoOn)
    }

    /// Takes one step from `(from, point)` that ends at `stop` at the latest, without dense output at `sample` at the latest;
    /// gives where it ends. Nothing is written to the point yet.
    ///
    /// # Errors
    /// No step is short enough, or what the system reports.
    fn step(&mut self, from: f64, sample: f64, stop: f64, point: &[f64]) -> Result<f64, Failure>;

    /// The step up to `end`, its end, is accepted: writes the point there.
    fn accept(&mut self, end: f64, point: &mut [f64]);

    /// Writes the point at a time inside the last step, to the accuracy of its dense output.
    fn interpolate(&mut self, t: f64, point: &mut [f64]);

    /// The same to the accuracy of its end, for samples.
    fn sample(&mut self, t: f64, point: &mut [f64]) {
        self.interpolate(t, point);
    }

    /// The same for a zero crossing, from which the run goes on.
    fn accept_crossing(&mut self, t: f64, point: &mut [f64]) {
        self.interpolate(t, point);
    }

    /// Makes the last step again so that it ends at a time inside it, if its dense output is less exact than its end.
    /// `false` if that is not so, or cannot be done.
    fn shorten(&mut self, t: f64) -> bool {
        let _ = t;
        false
    }

    /// Makes the step from `(from, point)` again, without dense output, so that it ends at `end`.
    ///
    /// # Errors
    /// What the system reports.
    fn again(&mut self, from: f64, end: f64, point: &[f64]) -> Result<(), Failure> {
        let _ = (from, end, point);
        Ok(())
    }

    /// The step ended at a time event, which is handled next; `corner` as [`Events::is_corner`] tells.
    ///
    /// # Errors
    /// What the system reports.
    fn before_event(&mut self, corner: bool) -> Result<(), Failure> {
        let _ = corner;
        Ok(())
    }

    /// The time event where the last step ended is handled, and has left this point.
    fn after_event(&mut self, corner: bool, point: &[f64]) {
        let _ = (corner, point);
    }

    /// Something has happened where the last step ended.
    fn after_change(&mut self) {}

    /// What was known of the last event holds no longer.
    fn forget(&mut self) {}

    /// Looks at the step just taken, when all that belongs to it is done.
    ///
    /// # Errors
    /// What the system reports.
    fn supervise(&mut self, run: &mut Run<'_>, stop: f64, point: &[f64]) -> Result<Flow, Failure> {
        let _ = (run, stop, point);
        Ok(Flow::GoOn)
    }
}

/// Whether `time` is `stop` to rounding, after a step from `start`.
pub(crate) fn is_at(time: f64, stop: f64, start: f64) -> bool {
    (stop - time).abs() <= 4000.0 * f64::EPSILON * (time - start) + 200.0 * f64::EPSILON * time.abs()
}
