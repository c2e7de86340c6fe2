//! The clock on the wall.

use std::time::{Duration, Instant};

use halfarrow_sim::real_time::Clock;

/// The clock on the wall. It sleeps while there is time, and spins before a tick is due, since sleepers wake late.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WallClock {
    zero: Instant,
    spin: Duration,
}

impl WallClock {
    /// A clock that spins for the last `spin` before a tick.
    pub(crate) fn new(spin: Duration) -> WallClock {
        WallClock { zero: Instant::now(), spin }
    }
}

impl Clock for WallClock {
    fn now(&mut self) -> f64 {
        self.zero.elapsed().as_secs_f64()
    }

    fn wait(&mut self, until: f64) {
        self.wait_busily(until, &mut |_| ());
    }

    fn wait_busily(&mut self, until: f64, offer: &mut dyn FnMut(f64)) {
        let Ok(until) = Duration::try_from_secs_f64(until) else { return };
        if let Some(pause) = until.checked_sub(self.zero.elapsed() + self.spin) {
            std::thread::sleep(pause);
        }
        while let Some(left) = until.checked_sub(self.zero.elapsed()).filter(|left| !left.is_zero()) {
            offer(left.as_secs_f64());
            std::hint::spin_loop();
        }
    }
}
