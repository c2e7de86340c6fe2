//! Where work is done that may use all cores.

use std::sync::OnceLock;

use pyo3::prelude::*;
use rayon::ThreadPoolBuilder;

/// The process in which the module was loaded.
static LOADED_IN: OnceLock<u32> = OnceLock::new();

/// Notes the process in which the module is loaded.
pub fn loaded() {
    LOADED_IN.get_or_init(std::process::id);
}

/// Does something without the interpreter, for which others may wait.
///
/// A process that was forked has no threads but the one that forked it: those that its parent had made for all cores are
/// gone, and who gives them work waits forever. There the work is done on one thread.
pub fn apart<T: Send>(py: Python<'_>, work: impl FnOnce() -> T + Send) -> T {
    let forked = LOADED_IN.get().is_some_and(|&process| process != std::process::id());
    py.detach(|| if forked { on_one(work) } else { work() })
}

/// The same on one thread, whatever the process, where others have the other cores.
pub fn alone<T: Send>(py: Python<'_>, work: impl FnOnce() -> T + Send) -> T {
    py.detach(|| on_one(work))
}

fn on_one<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    match ThreadPoolBuilder::new().num_threads(1).build() {
        Ok(pool) => pool.install(work),
        // The system gives no more threads: this one does it.
        Err(_) => work(),
    }
}
