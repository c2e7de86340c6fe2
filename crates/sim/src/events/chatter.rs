//! Events without end.

/// Crossings in a row that may lie within [`SHORT`] of the run.
const MOST_CROSSINGS: usize = 200;

/// Part of the run in which so many crossings have no physical meaning.
const SHORT: f64 = 1e-9;

/// Crossings in a row within it from which on the sign of what is asked for is looked at more coarsely.
const FREQUENT: usize = 50;

/// Part of the time that has passed in which so many time events have none: that of a few thousand rounding errors.
const STILL: f64 = 1e-12;

/// Notices events that follow each other without time going on.
pub(crate) struct Chatter {
    short: f64,
    /// The same as part of the time.
    relative: f64,
    since: f64,
    crossings: usize,
}

impl Chatter {
    /// Of zero crossings, for a run of this length in s.
    pub(crate) fn new(length: f64) -> Chatter {
        Chatter { short: SHORT * length, relative: 0.0, since: f64::NEG_INFINITY, crossings: 0 }
    }

    /// Of time events.
    pub(crate) fn of_times() -> Chatter {
        Chatter { short: 0.0, relative: STILL, since: f64::NEG_INFINITY, crossings: 0 }
    }

    /// Takes notice of an event. `true` if it is one too many.
    pub(crate) fn is_one(&mut self, time: f64) -> bool {
        if time - self.since > self.short + self.relative * time.abs() {
            (self.since, self.crossings) = (time, 0);
        }
        self.crossings += 1;
        self.crossings > MOST_CROSSINGS
    }

    /// Whether the events noticed last follow each other so fast that more may be one too many.
    pub(crate) fn is_frequent(&self) -> bool {
        self.crossings >= FREQUENT
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frequent_switching_is_not_chatter() {
        let mut chatter = Chatter::new(1.0);
        assert!((0..1000).all(|i| !chatter.is_one(i as f64 * 1e-10)));
        assert!((0..1000).any(|i| chatter.is_one(0.5 + i as f64 * 1e-15)));
    }

    #[test]
    fn frequent_time_events_are_no_chatter() {
        let mut chatter = Chatter::of_times();
        assert!((0..1000).all(|i| !chatter.is_one(f64::from(i) * 1e-10)));
        let mut time = 1e-13_f64;
        assert!((0..1000).any(|_| {
            time = time.next_up();
            chatter.is_one(time)
        }));
    }
}
