//! Signs of event indicators, and where they change.

use super::Events;
use crate::{Affected, Failure};

/// The sign of each event indicator during the present mode.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Signs {
    pub(super) held: Vec<bool>,
    pub(super) values: Vec<f64>,
}

impl Signs {
    pub(crate) fn new(indicators: usize) -> Signs {
        Signs { held: vec![false; indicators], values: vec![0.0; indicators] }
    }

    /// Whether there is nothing to watch.
    pub(crate) fn is_empty(&self) -> bool {
        self.held.is_empty()
    }

    /// Event indicators where they were asked for last.
    pub(crate) fn values(&self) -> &[f64] {
        &self.values
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
