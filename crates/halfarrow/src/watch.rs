//! What each stage took, of a model that is worked on.

use std::fmt;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use serde::Serialize;

use crate::clock::Moment;

/// What a stage took.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct StageTime {
    /// The stage: `ast`, `bond_graph`, `causal_graph`, `causal_paths`, `equations`, `program`, `code`, `start`, `run`,
    /// `draw`, `write`.
    pub stage: &'static str,
    /// Time on the wall, in s.
    pub seconds: f64,
    /// Memory of the process in bytes when the stage was first over; `None` where the system does not tell.
    pub memory: Option<usize>,
}

/// Notes what stages take: those of one name together, in the order in which they first ended. Copies note in the same
/// list.
#[derive(Clone, Default)]
pub(crate) struct Watch(Arc<Mutex<Vec<StageTime>>>);

impl Watch {
    /// Does something, and notes what it took.
    pub fn time<T>(&self, stage: &'static str, work: impl FnOnce() -> T) -> T {
        let begun = Moment::now();
        let done = work();
        self.note(stage, begun.elapsed().as_secs_f64());
        done
    }

    /// Notes what a stage took, in s, that is over now.
    pub fn note(&self, stage: &'static str, seconds: f64) {
        let mut noted = self.lock();
        match noted.iter_mut().find(|known| known.stage == stage) {
            // A model that runs again and again does not ask the system each time.
            Some(known) => known.seconds += seconds,
            None => noted.push(StageTime { stage, seconds, memory: memory_in_use() }),
        }
    }

    /// What was noted.
    pub fn noted(&self) -> Vec<StageTime> {
        self.lock().clone()
    }

    fn lock(&self) -> MutexGuard<'_, Vec<StageTime>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl fmt::Debug for Watch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Watch")
    }
}

#[cfg(any(unix, windows))]
fn memory_in_use() -> Option<usize> {
    memory_stats::memory_stats().map(|stats| stats.physical_mem)
}

#[cfg(not(any(unix, windows)))]
fn memory_in_use() -> Option<usize> {
    None
}
