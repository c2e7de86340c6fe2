//! The clocks of this machine. Where there is none, as in a browser, no time passes.

use std::ops::Add;
use std::time::{Duration, Instant};

/// Whether the standard library has a clock here.
const TICKS: bool = !cfg!(all(target_family = "wasm", target_os = "unknown"));

/// A time of the clock on the wall.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Moment(Option<Instant>);

impl Moment {
    pub fn now() -> Moment {
        Moment(TICKS.then(Instant::now))
    }

    /// The time that has passed since.
    pub fn elapsed(self) -> Duration {
        Moment::now().since(self)
    }

    /// The time that has passed since another moment; nothing if that came later.
    pub fn since(self, earlier: Moment) -> Duration {
        let both = self.0.zip(earlier.0);
        both.map_or(Duration::ZERO, |(now, then)| now.saturating_duration_since(then))
    }
}

impl Add<Duration> for Moment {
    type Output = Moment;
    fn add(self, more: Duration) -> Moment {
        Moment(self.0.map(|instant| instant + more))
    }
}

/// A time of the processor's clock for this thread, which other programs do not move.
#[cfg(any(unix, windows))]
pub(crate) struct ProcessorTime(cpu_time::ThreadTime);

#[cfg(any(unix, windows))]
impl ProcessorTime {
    pub fn now() -> ProcessorTime {
        ProcessorTime(cpu_time::ThreadTime::now())
    }

    /// The time that this thread has taken since.
    pub fn elapsed(&self) -> Duration {
        self.0.elapsed()
    }
}

/// Where threads have no clock of their own, that on the wall.
#[cfg(not(any(unix, windows)))]
pub(crate) use Moment as ProcessorTime;
