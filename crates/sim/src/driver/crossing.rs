//! Zero crossings of event indicators in a step.

use super::{Run, Stepper};
use crate::Failure;
use crate::events::{FINEST, Signs, first_crossing};

/// Parts of a step by which it is made to go beyond a zero crossing.
const MARGINS: [f64; 2] = [1e-3, 1e-6];

/// Steps in a row that were made again for a crossing that was none then, from which on that is left behind.
const MOST_VANISHED: usize = 3;

impl Run<'_> {
    /// Writes the point that the step has led to: its end, or a zero crossing before it. Gives when that is, and whether an
    /// event indicator has changed its sign there.
    pub(super) fn accept_step<S: Stepper>(
        &mut self,
        stepper: &mut S,
        end: f64,
        point: &mut [f64],
    ) -> Result<(f64, bool), Failure> {
        let handled = std::mem::take(&mut self.handled);
        if !S::DENSE && !self.signs.is_empty() && stepper.events().locates_crossings() {
            return self.accept_by_shorter_steps(stepper, end, point, handled);
        }
        if !S::DENSE {
            stepper.accept(end, point);
            let crossed = self.signs.crossed(&mut *stepper.events(), end, point)?;
            return Ok((end, crossed.is_some()));
        }
        self.inside.resize(point.len(), 0.0);
        match self.exact_crossing(stepper, end)? {
            (end, None) => {
                stepper.accept(end, point);
                Ok((end, false))
            }
            (_, Some((time, indicator))) => {
                self.notice(stepper, time, indicator)?;
                stepper.accept_crossing(time, point);
                Ok((time, true))
            }
        }
    }

    /// The same where there is no dense output, by steps from the same start that end sooner. After an event the inside of the
    /// step is looked at as well, since what has been changed there may come back at once, and where indicators bend so much
    /// that they may have been zero twice.
    fn accept_by_shorter_steps<S: Stepper>(
        &mut self,
        stepper: &mut S,
        end: f64,
        point: &mut [f64],
        handled: bool,
    ) -> Result<(f64, bool), Failure> {
        let Run { signs, inside, time, .. } = self;
        inside.resize(point.len(), 0.0);
        // The step to the end has just been made.
        stepper.accept(end, inside);
        let switched = signs.crossed(&mut *stepper.events(), end, inside)?.is_some();
        let hidden = signs.may_hide_in_step(end - *time);
        if !(handled || switched || hidden) {
            signs.step_ended(end - *time);
            point.copy_from_slice(inside);
            return Ok((end, false));
        }
        let mut crossed = |signs: &mut Signs, t: f64| {
            match t > *time {
                true => {
                    stepper.again(*time, t, point)?;
                    stepper.accept(t, inside);
                }
                false => inside.copy_from_slice(point),
            }
            signs.crossed(&mut *stepper.events(), t, inside)
        };
        let crossing = first_crossing(signs, *time, end, &mut crossed)?;
        let (end, indicator) = crossing.map_or((end, None), |(time, indicator)| (time, Some(indicator)));
        crossed(signs, end)?;
        signs.step_ended(end - *time);
        point.copy_from_slice(inside);
        if let Some(indicator) = indicator {
            self.notice(stepper, end, indicator)?;
        }
        Ok((end, indicator.is_some()))
    }

    /// Takes notice of a zero crossing. What crosses zero again and again while time stands still may do so by rounding: it is
    /// looked at more coarsely then, unless something happens where it does.
    ///
    /// # Errors
    /// That was one too many.
    fn notice<S: Stepper>(&mut self, stepper: &mut S, time: f64, indicator: usize) -> Result<(), Failure> {
        if self.chatter.is_one(time) {
            return Err(Failure::Chattering { time, what: stepper.events().indicator_name(indicator) });
        }
        if self.chatter.is_frequent() && !stepper.events().locates_crossings() {
            self.signs.look_coarsely(indicator);
        }
        Ok(())
    }

    /// The first zero crossing in the step that ends at `end`, which it is, and where the step ends now: where its end is
    /// more exact than its inside, it is made again to just beyond the crossing.
    fn exact_crossing<S: Stepper>(
        &mut self,
        stepper: &mut S,
        mut end: f64,
    ) -> Result<(f64, Option<(f64, usize)>), Failure> {
        let mut crossing = self.crossing(stepper, end)?;
        let finest = 2.0 * FINEST * (end - self.time);
        let found = crossing.is_some();
        for margin in MARGINS {
            let Some((time, _)) = crossing else { break };
            // What was no crossing time after time is left behind by a part of the step at least, where steps are searched: a
            // contact that is grazed.
            let grazed = self.signs.is_thorough() && self.vanished >= MOST_VANISHED;
            let least = if grazed { end - time } else { 0.0 };
            let beyond = time + margin * (time - self.time).max(least);
            if time - self.time <= finest || beyond >= end || !stepper.shorten(beyond) {
                break;
            }
            end = beyond;
            crossing = self.crossing(stepper, end)?;
        }
        self.vanished = if found && crossing.is_none() { self.vanished + 1 } else { 0 };
        Ok((end, crossing))
    }

    /// The first zero crossing in the step that ends at `end`, by its dense output, and which it is.
    fn crossing<S: Stepper>(&mut self, stepper: &mut S, end: f64) -> Result<Option<(f64, usize)>, Failure> {
        let Run { signs, inside, time, .. } = self;
        first_crossing(signs, *time, end, |signs, t| {
            stepper.interpolate(t, inside);
            signs.crossed(&mut *stepper.events(), t, inside)
        })
    }

    /// Whether there is something to look at where a step ends: event indicators, or a sink that watches.
    pub(crate) fn looks_at_every_step(&self) -> bool {
        !self.signs.is_empty() || self.watched
    }
}
