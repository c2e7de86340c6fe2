//! Zero crossings without end.

/// Crossings in a row that may lie within [`SHORT`] of the run.
const MOST_CROSSINGS: usize = 200;

/// Part of the run in which so many crossings have no physical meaning.
const SHORT: f64 = 1e-9;

/// Notices crossings that follow each other without time going on.
pub(crate) struct Chatter {
    short: f64,
    since: f64,
    crossings: usize,
}

impl Chatter {
    /// For a run of this length in s.
    pub(crate) fn new(length: f64) -> Chatter {
        Chatter { short: SHORT * length, since: f64::NEG_INFINITY, crossings: 0 }
    }

    /// Takes notice of a crossing. `true` if it is one too many.
    pub(crate) fn is_one(&mut self, time: f64) -> bool {
        if time - self.since > self.short {
            (self.since, self.crossings) = (time, 0);
        }
        self.crossings += 1;
        self.crossings > MOST_CROSSINGS
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
}
