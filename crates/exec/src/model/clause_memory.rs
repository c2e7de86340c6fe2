//! What a run remembers of what happens at events, and whether events accumulate.

/// Times in a row that a clause has to happen faster, or within no time, to accumulate.
const IN_A_ROW: u32 = 8;
/// The same where each interval is at most this part of the one before: after a few more it is below rounding.
const STEEPLY_IN_A_ROW: u32 = 3;
const STEEP: f64 = 0.1;
/// What is left until events accumulate, as part of the time that has passed, from which on they do.
const NEAR: f64 = 1e-10;
/// What passes between two events that is no time, in the same measure.
const NO_TIME: f64 = 1e-13;

/// What a run remembers of a clause.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum ClauseMemory {
    /// Of one with a condition.
    Becomes(Condition),
    /// Of one with a period: that, and the number of the next time.
    Every {
        /// In s.
        period: f64,
        /// A whole number.
        next: f64,
    },
}

/// What a run remembers of a condition.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Condition {
    /// Whether it holds.
    pub holds: bool,
    /// When the run began, and when the clause happened last, in s.
    start: f64,
    last: f64,
    /// What passed between the last two times, in s, and how many times in a row that was less than before, or nothing.
    interval: f64,
    faster: u32,
}

impl ClauseMemory {
    /// When it happens next whatever the state, in s.
    pub fn next_time(&self) -> Option<f64> {
        match self {
            ClauseMemory::Becomes(_) => None,
            ClauseMemory::Every { period, next } => Some(next * period),
        }
    }

    pub fn is_due(&self, t: f64) -> bool {
        self.next_time().is_some_and(|next| t >= next)
    }
}

impl Condition {
    pub fn begin(holds: bool, t: f64) -> Condition {
        Condition { holds, start: t, last: f64::NEG_INFINITY, interval: f64::INFINITY, faster: 0 }
    }

    /// Whether it has happened at `t`, and holds after it.
    pub fn holds_since(&self, t: f64) -> bool {
        self.holds && self.last == t
    }

    /// Takes notice that the clause happens at `t`. Gives what has passed since the last time and where its events accumulate,
    /// if they do.
    pub fn happens(&mut self, t: f64) -> Option<(f64, f64)> {
        if t <= self.last {
            return None;
        }
        let (interval, before, passed) = (t - self.last, self.interval, t - self.start);
        (self.last, self.interval) = (t, interval);
        let shrinks = interval < before || interval <= NO_TIME * passed;
        self.faster = if shrinks { self.faster + 1 } else { 0 };
        let ratio = interval / before;
        let left = if ratio < 1.0 { interval * ratio / (1.0 - ratio) } else { 0.0 };
        let near = left <= NEAR * passed && interval <= NEAR * passed;
        let in_a_row = if ratio <= STEEP { STEEPLY_IN_A_ROW } else { IN_A_ROW };
        (near && self.faster >= in_a_row).then_some((interval, t + left))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Where events accumulate that begin at 1 s and whose intervals shrink by a factor, if that is told.
    fn accumulated(factor: f64) -> Option<(usize, f64)> {
        let mut condition = Condition::begin(false, 0.0);
        let (mut time, mut interval) = (1.0, 0.5);
        for count in 0..100_000 {
            if let Some((_, end)) = condition.happens(time) {
                return Some((count, end));
            }
            (time, interval) = (time + interval, interval * factor);
        }
        None
    }

    #[test]
    fn a_geometric_series_is_told_with_its_end() {
        for factor in [1e-4, 0.01, 0.1, 0.5, 0.8, 0.99] {
            let (_, end) = accumulated(factor).expect("it accumulates");
            assert!((end - (1.0 + 0.5 / (1.0 - factor))).abs() < 1e-8, "{factor}: {end}");
        }
    }

    #[test]
    fn what_goes_on_evenly_does_not_accumulate() {
        assert_eq!(accumulated(1.0), None);
        assert_eq!(accumulated(1.01), None);
    }
}
