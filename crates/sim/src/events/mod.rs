//! Events: where a system is not smooth, and what happens there.

mod chatter;
mod locate;
mod signs;

pub(crate) use chatter::Chatter;
pub(crate) use locate::{FINEST, first_crossing};
pub(crate) use signs::Signs;

use crate::Failure;

/// What has become of the last step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StepEnd {
    /// It has failed: the run stands where it began.
    Failed,
    /// Its error is what tolerances allow.
    Controlled,
    /// Its length was given: nothing says how exact it is.
    Fixed,
}

/// The events of a system, and what can be seen of it where a run stands.
///
/// A *point* is what a run moves: the states of a [`System`](crate::System); all unknowns, then all their rates, of an
/// [`ImplicitSystem`](crate::ImplicitSystem).
///
/// # Between events
///
/// Between two events every function of the system is smooth, so that a step may evaluate it anywhere, slightly beyond the
/// step included. A system therefore holds a *mode*, which only [`handle_event`](Events::handle_event) changes:
///
/// - the *current interval* of time, from the time event handled last to the one that
///   [`next_time_event`](Events::next_time_event) announces. Conditions on time alone, corners of tables and held samples
///   are evaluated as in the inside of this interval, whatever `t` they are asked at. So `if t < 0.3 then a else b` gives
///   `a` in a step that ends at 0.3, and `b` at the same instant after `handle_event(0.3, …)`.
/// - the *sign* of each event indicator: `true` while it is `> 0`, `false` while it is `<= 0` (a condition `x >= 0` is the
///   negation of the sign of `-x`). Both branches must be evaluable a little beyond the zero crossing.
///
/// An integration starts with `handle_event(from, point)`: the start counts as an event. It stops exactly at each time
/// event and each located zero crossing, calls `handle_event` and goes on from there.
///
/// All slices have the documented lengths; times are in s, everything else in the unit of its variable.
pub trait Events {
    /// The first time event after `t`, known in advance: a jump of a source, a corner of an input table, the next sample or
    /// the arrival of a delayed jump. `None`: there are no more. The integration stops exactly there, to the last bit.
    /// Between two calls of [`handle_event`](Events::handle_event) the answer stays the same.
    fn next_time_event(&mut self, t: f64) -> Option<f64>;

    /// Whether the time event announced at `t` is a mere corner, as between rows of an input table: neither values nor
    /// rates jump there, only slopes. Asked before it is handled.
    fn is_corner(&mut self, t: f64) -> bool {
        let _ = t;
        false
    }

    /// Number of event indicators, functions of the state whose zero crossings are events (`if x > 0`); 0 if there are none.
    fn indicators(&self) -> usize;

    /// How messages name an event indicator, as in `the condition of valve`. Called only when a run fails.
    fn indicator_name(&self, indicator: usize) -> String {
        format!("condition {}", indicator + 1)
    }

    /// Event indicators at `(t, point)`, [`indicators`](Events::indicators) of them, in the present mode, each continuous in
    /// time and point.
    ///
    /// # Errors
    /// A failure names time and element, as everywhere here.
    fn event_indicators(&mut self, t: f64, point: &[f64], g: &mut [f64]) -> Result<(), Failure>;

    /// The angles, in rad, of the sines and cosines that the event indicators evaluated last read: where they go far between two
    /// points, indicators may have been zero any number of times.
    fn angles(&self, angles: &mut Vec<f64>) {
        angles.clear();
    }

    /// The integration stands at `t`: at its start, exactly at an announced time event, or just past a located zero
    /// crossing. Up to here the old mode was used. Moves the current interval if `t` has reached the time event, takes the
    /// signs of all event indicators from their values at `(t, point)`, and may change the point. That of an implicit system
    /// it leaves consistent with the new mode: `F = 0`, and the hidden constraints of a higher index hold as well; the rate
    /// of an algebraic unknown may be anything finite.
    ///
    /// # Errors
    /// As [`event_indicators`](Events::event_indicators).
    fn handle_event(&mut self, t: f64, point: &mut [f64]) -> Result<(), Failure>;

    /// Looks, where a step has ended or one from `(t, point)` has failed, whether other variables tell the motion better from
    /// here on. If so the system goes on in these: the point is the same in them, of the same length; names and scales of
    /// its states, the sparsity and the event indicators may be others. `true` if it has changed.
    ///
    /// # Errors
    /// As [`event_indicators`](Events::event_indicators).
    fn exchange_independent(&mut self, t: f64, point: &mut [f64], step: StepEnd) -> Result<bool, Failure> {
        let _ = (t, point, step);
        Ok(false)
    }

    /// The states will be of these magnitudes, as a method of variable step takes them from `(t, point)` on: what is far below
    /// them is no sign of anything.
    ///
    /// # Errors
    /// As [`event_indicators`](Events::event_indicators).
    fn note_magnitudes(&mut self, t: f64, point: &[f64], magnitudes: &[f64]) -> Result<(), Failure> {
        let _ = (t, point, magnitudes);
        Ok(())
    }

    /// Whether steps are searched for two crossings of one indicator between the points that are looked at anyway, as where
    /// a law holds for a short while only.
    fn looks_between(&self) -> bool {
        false
    }

    /// Whether methods of fixed step locate zero crossings too, by shorter steps: what happens there may depend on their
    /// times. Else they count from the end of the step.
    fn locates_crossings(&self) -> bool {
        false
    }

    /// Looks whether a step of fixed length may end at `(t, point)`, before it is accepted.
    ///
    /// # Errors
    /// [`OffMotion`](Failure::OffMotion): one that ends sooner may; else as [`event_indicators`](Events::event_indicators).
    fn try_end(&mut self, t: f64, point: &[f64]) -> Result<(), Failure> {
        let _ = (t, point);
        Ok(())
    }

    /// Puts the point where a step has ended back onto relations that its rates alone keep, and from which it drifts. Called
    /// where [`Options::project`](crate::Options::project) asks for it; the first call, where a run starts, notes what is kept.
    /// `true` if the point has moved.
    ///
    /// # Errors
    /// As [`event_indicators`](Events::event_indicators), or no point near is on them.
    fn project(&mut self, t: f64, point: &mut [f64]) -> Result<bool, Failure> {
        let _ = (t, point);
        Ok(false)
    }

    /// The longest step with dense output from where the run stands that lets all be seen that moves, in s: what moves no
    /// state has no error that makes steps short.
    fn longest_step(&self) -> f64 {
        f64::INFINITY
    }

    /// Whether nothing that is seen of it changes between two time events as long as no state does. Then a system without
    /// states stands still from one to the next.
    fn stands_still(&self) -> bool {
        false
    }

    /// The step that ends at `(t, point)` is accepted, or the run starts there: Newton starting points and delay buffers,
    /// which belong to the model's memory, move on. Times never decrease from call to call.
    ///
    /// # Errors
    /// As [`event_indicators`](Events::event_indicators).
    fn accept(&mut self, t: f64, point: &[f64]) -> Result<(), Failure>;

    /// Number of values that [`observe`](Events::observe) writes.
    fn observed(&self) -> usize;

    /// How messages name a recorded value, as in `R1.e`. Called only when a run fails.
    fn observed_name(&self, value: usize) -> String {
        format!("recorded value {}", value + 1)
    }

    /// Whether equations have become singular between the point observed last and the one before: the trajectory ends there,
    /// whatever a step that led across has found. Asked in runs that are watched step by step.
    ///
    /// # Errors
    /// They have.
    fn passed_pole(&mut self, t: f64) -> Result<(), Failure> {
        let _ = t;
        Ok(())
    }

    /// Values recorded at `(t, point)`, [`observed`](Events::observed) of them.
    ///
    /// # Errors
    /// As [`event_indicators`](Events::event_indicators).
    fn observe(&mut self, t: f64, point: &[f64], out: &mut [f64]) -> Result<(), Failure>;
}
