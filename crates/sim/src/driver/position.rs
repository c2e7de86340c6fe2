//! Where a run stands.

use super::Summary;
use crate::events::Signs;

/// Where a run stands: its time, the signs of the event indicators, what it has taken so far.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Position {
    pub(super) time: f64,
    pub(super) signs: Signs,
    pub(super) counts: Summary,
}

impl Position {
    pub(crate) fn new(time: f64, indicators: usize) -> Position {
        Position { time, signs: Signs::new(indicators), counts: Summary::default() }
    }

    /// How far the run has come, in s.
    pub fn time(&self) -> f64 {
        self.time
    }

    /// What it took so far.
    pub fn summary(&self) -> Summary {
        self.counts
    }
}
