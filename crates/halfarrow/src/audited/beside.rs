//! The audit of one part of a run while the next one is computed.

use std::collections::BTreeMap;
use std::panic::resume_unwind;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::thread::{Builder, JoinHandle};

use halfarrow_audit::{Auditor, Run};
use rayon::prelude::*;

/// A part of a run, as it was recorded.
pub struct Part {
    pub times: Vec<f64>,
    /// The values of all names at each time, one time after the other.
    pub samples: Vec<f64>,
}

/// What the numbers of all parts are.
pub struct Recorded {
    pub names: Vec<Arc<str>>,
    pub parameters: BTreeMap<String, f64>,
}

/// An auditor, here or in a thread of its own; the parts come to it in order, so that what it finds does not depend on where.
pub enum PlacedAuditor {
    Here(Box<Auditor>),
    Beside {
        sender: SyncSender<Part>,
        /// Room of parts that were looked at.
        room: Receiver<Vec<f64>>,
        thread: JoinHandle<Option<Box<Auditor>>>,
    },
}

impl PlacedAuditor {
    /// Looks at a part that another one follows; at most one waits. Gives the room of one that was looked at, if there is
    /// such: memory that is there is not asked for again.
    pub fn take(self, recorded: &Arc<Recorded>, part: Part) -> (PlacedAuditor, Vec<f64>) {
        match self.moved(recorded) {
            PlacedAuditor::Here(mut auditor) => {
                look(&mut auditor, recorded, &part, &mut Vec::new());
                (PlacedAuditor::Here(auditor), part.samples)
            }
            PlacedAuditor::Beside { sender, room, thread } => {
                // A thread that is gone has panicked: that is told where the auditor is asked for.
                let _ = sender.send(part);
                let free = room.try_recv().unwrap_or_default();
                (PlacedAuditor::Beside { sender, room, thread }, free)
            }
        }
    }

    /// The auditor, when it has looked at all parts.
    pub fn into_auditor(self) -> Box<Auditor> {
        match self {
            PlacedAuditor::Here(auditor) => auditor,
            PlacedAuditor::Beside { sender, thread, .. } => {
                drop(sender);
                let auditor = thread.join().unwrap_or_else(|panic| resume_unwind(panic));
                auditor.expect("the auditor is handed over before the first part")
            }
        }
    }

    /// The same in a thread of its own, where there are threads and this is none of several that have work of their own.
    fn moved(self, recorded: &Arc<Recorded>) -> PlacedAuditor {
        let PlacedAuditor::Here(auditor) = self else { return self };
        if cfg!(target_family = "wasm") || rayon::current_thread_index().is_some() {
            return PlacedAuditor::Here(auditor);
        }
        let (hand, handed) = sync_channel::<Box<Auditor>>(1);
        let (sender, parts) = sync_channel::<Part>(1);
        let (back, room): (Sender<Vec<f64>>, _) = channel();
        let recorded = recorded.clone();
        let audit = move || {
            let mut auditor = handed.recv().ok()?;
            let mut columns = Vec::new();
            for part in parts {
                look(&mut auditor, &recorded, &part, &mut columns);
                // The run may be over.
                let _ = back.send(part.samples);
            }
            Some(auditor)
        };
        match Builder::new().name("audit".to_string()).spawn(audit) {
            Ok(thread) => match hand.send(auditor) {
                Ok(()) => PlacedAuditor::Beside { sender, room, thread },
                Err(back) => PlacedAuditor::Here(back.0),
            },
            Err(_) => PlacedAuditor::Here(auditor),
        }
    }
}

/// Looks at a part. `columns` has room for its values.
pub fn look(auditor: &mut Auditor, recorded: &Recorded, part: &Part, columns: &mut Vec<f64>) {
    turn(&part.samples, recorded.names.len(), columns);
    let columns: Vec<&[f64]> = columns.chunks(part.times.len()).collect();
    let Recorded { names, parameters } = recorded;
    auditor.take(&Run { times: &part.times, names, columns: &columns, parameters });
}

/// So many columns are turned at a time.
const SIDE: usize = 32;

/// From so many values on rows are turned on all cores.
const MANY: usize = 1 << 20;

/// Rows of so many columns as columns, one after the other; small squares at a time, as memory is near then.
fn turn(rows: &[f64], columns: usize, all: &mut Vec<f64>) {
    let count = rows.len() / columns.max(1);
    all.resize(rows.len(), 0.0);
    let turn_some = |(some, turned): (usize, &mut [f64])| {
        let first = some * SIDE;
        for row in (0..count).step_by(SIDE) {
            for (j, column) in turned.chunks_mut(count).enumerate() {
                for (i, value) in column.iter_mut().enumerate().skip(row).take(SIDE) {
                    *value = rows[i * columns + first + j];
                }
            }
        }
    };
    let squares = SIDE * count.max(1);
    match rows.len() < MANY {
        true => all.chunks_mut(squares).enumerate().for_each(turn_some),
        false => all.par_chunks_mut(squares).enumerate().for_each(turn_some),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_column_has_its_values() {
        for (count, columns) in [(1, 1), (3, 5), (64, 100), (33, 31), (70, 16_000)] {
            let rows: Vec<f64> = (0..count * columns).map(|k| k as f64).collect();
            let mut turned = Vec::new();
            turn(&rows, columns, &mut turned);
            let right = |(k, &value): (usize, &f64)| value == ((k % count) * columns + k / count) as f64;
            assert!(turned.iter().enumerate().all(right), "{count} by {columns}");
        }
        turn(&[], 0, &mut Vec::new());
    }
}
