//! Signs of event indicators, and where they change.

use super::Events;
use crate::{Affected, Failure};

/// The sign of each event indicator during the present mode.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Signs {
    pub(super) held: Vec<bool>,
    pub(super) values: Vec<f64>,
    /// The values at the ends of the last three parts of a step.
    seen: [Vec<f64>; 3],
}

impl Signs {
    pub(crate) fn new(indicators: usize) -> Signs {
        let values = vec![0.0; indicators];
        Signs { held: vec![false; indicators], seen: [values.clone(), values.clone(), values.clone()], values }
    }

    /// One held sign, for tests.
    #[cfg(test)]
    pub(super) fn holding(held: bool) -> Signs {
        Signs { held: vec![held], ..Signs::new(1) }
    }

    pub(crate) fn len(&self) -> usize {
        self.held.len()
    }

    /// Keeps the values as those at the end of a part of a step.
    pub(super) fn keep(&mut self, part: usize) {
        self.seen[part % 3].copy_from_slice(&self.values);
    }

    /// Where, in parts, the values of an indicator turn round on their way to 0, judged by the parabola through those kept last.
    pub(super) fn turn(&self, indicator: usize, part: usize) -> Option<f64> {
        let middle = part.checked_sub(1).filter(|middle| *middle > 0)?;
        let [a, b, c] = [middle - 1, middle, part].map(|part| self.seen[part % 3][indicator]);
        let (slope, bend) = (0.5 * (c - a), a - 2.0 * b + c);
        let turn = (bend * b > 0.0).then(|| -slope / bend).filter(|turn| turn.abs() <= 1.0)?;
        Some(middle as f64 + turn)
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
        events.event_indicators(t, point, &mut self.values)?;
        self.held.iter_mut().zip(&self.values).for_each(|(held, value)| *held = *value > 0.0);
        Ok(())
    }

    /// The first event indicator that at `(t, point)` has another sign than that held; `None` if all keep theirs.
    pub(crate) fn crossed(&mut self, events: &mut dyn Events, t: f64, point: &[f64]) -> Result<Option<usize>, Failure> {
        if self.is_empty() {
            return Ok(None);
        }
        events.event_indicators(t, point, &mut self.values)?;
        if let Some(indicator) = self.values.iter().position(|value| value.is_nan()) {
            return Err(Failure::NotFinite { time: t, what: Affected::Other(events.indicator_name(indicator)) });
        }
        Ok(self.held.iter().zip(&self.values).position(|(&held, &value)| held != (value > 0.0)))
    }
}
