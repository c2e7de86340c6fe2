//! What a run in real time knows of itself, readable from another thread while it goes on.

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// Buckets to each power of 2.
const FINE: u32 = 8;
/// Powers of 2 of a nanosecond: up to 18 minutes.
const POWERS: u32 = 40;
const BUCKETS: usize = (POWERS * FINE) as usize;

/// Durations, sorted into buckets that are an eighth of their magnitude wide.
#[derive(Debug)]
pub struct Histogram {
    counts: [AtomicU64; BUCKETS],
    /// Greatest duration, in ns.
    most: AtomicU64,
}

impl Default for Histogram {
    fn default() -> Histogram {
        Histogram { counts: [const { AtomicU64::new(0) }; BUCKETS], most: AtomicU64::new(0) }
    }
}

impl Histogram {
    /// Adds a duration in s; what is below 0 counts as 0.
    pub fn add(&self, duration: f64) {
        let nanoseconds = (duration * 1e9).max(0.0) as u64;
        self.counts[bucket(nanoseconds)].fetch_add(1, Relaxed);
        self.most.fetch_max(nanoseconds, Relaxed);
    }

    /// Number of durations.
    pub fn count(&self) -> u64 {
        self.counts.iter().map(|count| count.load(Relaxed)).sum()
    }

    /// The greatest, in s.
    pub fn most(&self) -> f64 {
        self.most.load(Relaxed) as f64 * 1e-9
    }

    /// The duration that a part of all do not exceed, in s: the upper end of its bucket, at most the greatest. 0 if there
    /// are none.
    pub fn quantile(&self, part: f64) -> f64 {
        let wanted = (part * self.count() as f64).ceil().max(1.0) as u64;
        let mut sum = 0;
        for (i, count) in self.counts.iter().enumerate() {
            sum += count.load(Relaxed);
            if sum >= wanted {
                return (upper(i) as f64 * 1e-9).min(self.most());
            }
        }
        self.most()
    }

    /// Upper ends of the buckets that are not empty, in s, and how many are in each.
    pub fn buckets(&self) -> Vec<(f64, u64)> {
        let counts = self.counts.iter().enumerate().map(|(i, count)| (upper(i) as f64 * 1e-9, count.load(Relaxed)));
        counts.filter(|(_, count)| *count > 0).collect()
    }
}

fn bucket(nanoseconds: u64) -> usize {
    if nanoseconds < u64::from(FINE) {
        return nanoseconds as usize;
    }
    let power = nanoseconds.ilog2();
    let part = (nanoseconds >> (power - FINE.ilog2())) as u32 - FINE;
    (((power - FINE.ilog2() + 1) * FINE + part) as usize).min(BUCKETS - 1)
}

/// The first duration beyond a bucket, in ns.
fn upper(bucket: usize) -> u64 {
    let (power, part) = (bucket as u32 / FINE, bucket as u32 % FINE);
    match power {
        0 => u64::from(part) + 1,
        _ => u64::from(FINE + part + 1) << (power - 1),
    }
}

/// What a run in real time knows of itself.
#[derive(Debug, Default)]
pub struct Statistics {
    /// Time from when a tick was due to its begin, in s.
    pub jitter: Histogram,
    /// Time that the step of a tick took, with the values to be handed out, in s.
    pub step: Histogram,
    misses: AtomicU64,
    left_out: AtomicU64,
    ticks: AtomicU64,
    /// Bits of the time that the model has reached, in s.
    time: AtomicU64,
}

impl Statistics {
    /// Ticks that are over.
    pub fn ticks(&self) -> u64 {
        self.ticks.load(Relaxed)
    }

    /// Ticks that ended after the next one was due.
    pub fn misses(&self) -> u64 {
        self.misses.load(Relaxed)
    }

    /// Ticks that were left out.
    pub fn skipped(&self) -> u64 {
        self.left_out.load(Relaxed)
    }

    /// The time that the model has reached, in s.
    pub fn time(&self) -> f64 {
        f64::from_bits(self.time.load(Relaxed))
    }

    pub(super) fn tick(&self, time: f64, jitter: f64, step: f64, missed: bool) {
        self.jitter.add(jitter);
        self.step.add(step);
        self.ticks.fetch_add(1, Relaxed);
        self.misses.fetch_add(u64::from(missed), Relaxed);
        self.time.store(time.to_bits(), Relaxed);
    }

    pub(super) fn leave_out(&self, ticks: u64) {
        self.left_out.fetch_add(ticks, Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_duration_is_in_its_bucket() {
        for n in (0..2000).chain([1 << 20, (1 << 30) + 12345, 1 << 39]) {
            let b = bucket(n);
            assert!(n < upper(b) && (b == 0 || n >= upper(b - 1)), "{n} in {b}");
            assert!(n < 8 || (upper(b) - n) as f64 <= 0.126 * n as f64, "{n}: {}", upper(b));
        }
        assert_eq!(bucket(u64::MAX), BUCKETS - 1);
    }

    #[test]
    fn quantiles_are_upper_bounds() {
        let all = Histogram::default();
        (1..=1000).for_each(|i| all.add(f64::from(i) * 1e-6));
        assert_eq!(all.count(), 1000);
        assert!((all.most() - 1e-3).abs() < 2e-9, "{}", all.most());
        for part in [0.5, 0.99, 1.0] {
            let exact = part * 1e-3;
            let found = all.quantile(part);
            assert!(found >= exact * (1.0 - 1e-12) && found <= exact * 1.13, "{part}: {found:e}");
        }
        assert_eq!(Histogram::default().quantile(0.5), 0.0);
    }
}
