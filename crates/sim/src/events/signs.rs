//! Signs of event indicators, and where they change.

use super::Events;
use crate::{Affected, Failure};

/// Points of a step of which values are kept.
pub(super) const PLACES: usize = 20;
/// Of these, where the present step begins, and where the one before it began.
const START: usize = PLACES - 1;
const BEFORE: usize = PLACES - 2;
/// Points for searches inside a step.
pub(super) const INSIDE: usize = PLACES - 2;
/// What an indicator bends by less, as part of its greatest magnitude, is rounding.
const NOISE: f64 = 1e-12;

/// The sign of each event indicator during the present mode.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Signs {
    pub(super) held: Vec<bool>,
    pub(super) values: Vec<f64>,
    /// The angles that they read, and those at the end of a step that is searched.
    pub(super) angles: Vec<f64>,
    pub(super) angles_at_end: Vec<f64>,
    /// Values at points of a step, one place after the other.
    seen: Vec<f64>,
    /// The greatest finite magnitude of each value.
    most: Vec<f64>,
    /// Whether steps are searched for two crossings of one indicator.
    pub(super) thorough: bool,
    /// How long the step before was, in s, if no event lies between.
    last: Option<f64>,
    /// How exact the run keeps the entries of its point, as far as it is known, and which signs count only beyond what that
    /// makes of their indicators.
    resolution: Vec<f64>,
    coarse: Vec<bool>,
    /// The coarse one whose sign counts nevertheless.
    sharp: Option<usize>,
}

/// Points within the resolution of the run at which a coarse indicator is looked at.
const SHAKEN: usize = 3;

impl Signs {
    pub(crate) fn new(indicators: usize) -> Signs {
        let values = vec![0.0; indicators];
        let (seen, most) = (vec![0.0; indicators * PLACES], values.clone());
        let coarse = vec![false; indicators];
        Signs {
            held: coarse.clone(),
            angles: Vec::new(),
            angles_at_end: Vec::new(),
            seen,
            most,
            values,
            thorough: false,
            last: None,
            resolution: Vec::new(),
            coarse,
            sharp: None,
        }
    }

    /// For another number of indicators.
    pub(crate) fn renew(&mut self, indicators: usize) {
        let resolution = std::mem::take(&mut self.resolution);
        *self = Signs { resolution, ..Signs::new(indicators) };
    }

    /// Says how exact the run keeps its point, first entries first.
    pub(crate) fn resolve(&mut self, resolution: impl Iterator<Item = f64>) {
        self.resolution.clear();
        self.resolution.extend(resolution);
    }

    /// From now on the sign of an indicator counts only where its value is greater than what the resolution of the run makes of
    /// it: what is zero but for rounding, as the side slip of a car that drives straight on, changes its sign by rounding.
    pub(crate) fn look_coarsely(&mut self, indicator: usize) {
        self.coarse[indicator] = !self.resolution.is_empty();
    }

    /// The sign of this indicator counts as it is, whether it is looked at coarsely or not: it is known to have changed. `None`:
    /// of no such indicator.
    pub(super) fn sharpen(&mut self, indicator: Option<usize>) {
        self.sharp = indicator;
    }

    /// One held sign, for tests.
    #[cfg(test)]
    pub(super) fn holding(held: bool) -> Signs {
        Signs { held: vec![held], ..Signs::new(1) }
    }

    pub(crate) fn len(&self) -> usize {
        self.held.len()
    }

    /// Keeps the values in a place.
    pub(super) fn keep(&mut self, place: usize) {
        let n = self.values.len();
        self.seen[place * n..][..n].copy_from_slice(&self.values);
    }

    /// What was kept in one place is kept in another one as well.
    pub(super) fn keep_as(&mut self, from: usize, to: usize) {
        let n = self.values.len();
        self.seen.copy_within(from * n..(from + 1) * n, to * n);
    }

    /// Whether an indicator may have been zero twice between two points, as one between them tells: it bends there by more
    /// than half of its least magnitude.
    pub(super) fn may_hide(&self, before: usize, middle: usize, after: usize) -> bool {
        let n = self.values.len();
        let at = |place: usize, indicator: usize| self.seen[place * n + indicator];
        (0..n).any(|i| {
            let (a, m, b) = (at(before, i), at(middle, i), at(after, i));
            let bend = (m - 0.5 * (a + b)).abs();
            bend > 0.5 * a.abs().min(m.abs()).min(b.abs()) && bend > NOISE * self.most[i]
        })
    }

    /// A step of this length has ended, whose values are the present ones.
    pub(crate) fn step_ended(&mut self, length: f64) {
        self.keep_as(START, BEFORE);
        self.keep(START);
        self.last = Some(length);
    }

    /// Whether an indicator may have been zero twice in a step of this length, whose end has the present values: on the way
    /// from the begin of the step before, it bends by more than half of its least magnitude. Known only where steps are
    /// searched, and not of the first step after an event, which is looked at anyway.
    pub(crate) fn may_hide_in_step(&self, length: f64) -> bool {
        let Some(last) = self.last.filter(|_| self.thorough) else { return false };
        let n = self.values.len();
        let part = last / (last + length);
        (0..n).any(|i| {
            let (a, b, c) = (self.seen[BEFORE * n + i], self.seen[START * n + i], self.values[i]);
            let bend = (b - a - part * (c - a)).abs();
            bend > 0.5 * b.abs().min(c.abs()) && bend > NOISE * self.most[i]
        })
    }

    /// Where, in parts, the values of an indicator turn round on their way to 0, judged by the parabola through those kept of
    /// the ends of the last parts.
    pub(super) fn turn(&self, indicator: usize, part: usize) -> Option<f64> {
        let n = self.values.len();
        let middle = part.checked_sub(1).filter(|middle| *middle > 0)?;
        let [a, b, c] = [middle - 1, middle, part].map(|part| self.seen[part * n + indicator]);
        let (slope, bend) = (0.5 * (c - a), a - 2.0 * b + c);
        let turn = (bend * b > 0.0).then(|| -slope / bend).filter(|turn| turn.abs() <= 1.0)?;
        Some(middle as f64 + turn)
    }

    /// Whether steps are searched for two crossings of one indicator.
    pub(crate) fn is_thorough(&self) -> bool {
        self.thorough
    }

    /// Whether there is nothing to watch.
    pub(crate) fn is_empty(&self) -> bool {
        self.held.is_empty()
    }

    /// Takes the signs at `(t, point)`, as the system does where it handles an event.
    pub(crate) fn take(&mut self, events: &mut dyn Events, t: f64, point: &[f64]) -> Result<(), Failure> {
        if self.is_empty() {
            return Ok(());
        }
        self.thorough = events.looks_between();
        events.event_indicators(t, point, &mut self.values)?;
        events.angles(&mut self.angles);
        self.keep(START);
        self.last = None;
        self.held.iter_mut().zip(&self.values).for_each(|(held, value)| *held = *value > 0.0);
        Ok(())
    }

    /// The first event indicator that at `(t, point)` has another sign than that held; `None` if all keep theirs.
    pub(crate) fn crossed(&mut self, events: &mut dyn Events, t: f64, point: &[f64]) -> Result<Option<usize>, Failure> {
        if self.is_empty() {
            return Ok(None);
        }
        events.event_indicators(t, point, &mut self.values)?;
        events.angles(&mut self.angles);
        let sizes = self.values.iter().map(|value| value.abs()).zip(&mut self.most);
        sizes.filter(|(size, most)| size.is_finite() && *size > **most).for_each(|(size, most)| *most = size);
        if let Some(indicator) = self.values.iter().position(|value| value.is_nan()) {
            return Err(Failure::NotFinite { time: t, what: Affected::Other(events.indicator_name(indicator)) });
        }
        let turned = |signs: &Signs, i: usize| signs.held[i] != (signs.values[i] > 0.0);
        let counts = |signs: &Signs, i: usize| !signs.coarse[i] || signs.sharp == Some(i);
        let n = self.values.len();
        let Some(first) = (0..n).find(|&i| turned(self, i)) else { return Ok(None) };
        if counts(self, first) {
            return Ok(Some(first));
        }
        let spread = self.spread(events, t, point);
        Ok((first..n).find(|&i| turned(self, i) && (counts(self, i) || self.values[i].abs() > spread[i])))
    }

    /// By how much indicators differ within the resolution of the run.
    fn spread(&self, events: &mut dyn Events, t: f64, point: &[f64]) -> Vec<f64> {
        let (mut spread, mut values) = (vec![0.0f64; self.values.len()], self.values.clone());
        for shift in 0..SHAKEN {
            let mut shaken = point.to_vec();
            for (i, (entry, resolution)) in shaken.iter_mut().zip(&self.resolution).enumerate() {
                *entry += if (i >> shift).is_multiple_of(2) { *resolution } else { -resolution };
            }
            // Where there are no values nothing is known.
            if events.event_indicators(t, &shaken, &mut values).is_ok() {
                let differences = values.iter().zip(&self.values).map(|(there, here)| (there - here).abs());
                spread.iter_mut().zip(differences).for_each(|(spread, other)| *spread = spread.max(other));
            }
        }
        spread
    }
}
