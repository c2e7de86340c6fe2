//! Ctrl-C, SIGTERM and SIGHUP end a run in order.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::Relaxed};
use std::time::Duration;

use signal_hook::consts::TERM_SIGNALS;
use signal_hook::flag;

use crate::screen;

#[cfg(unix)]
const HANG_UP: &[i32] = &[signal_hook::consts::SIGHUP];
#[cfg(not(unix))]
const HANG_UP: &[i32] = &[];

/// How long a run that looks for signals may take to come to where it does.
const PATIENCE: Duration = Duration::from_secs(3);
/// How often that is looked at.
const LOOK: Duration = Duration::from_millis(100);

/// Becomes true at the first signal; the second ends the program at once.
pub fn on_signals() -> Arc<AtomicBool> {
    let stop = Arc::new(AtomicBool::new(false));
    for signal in all() {
        // Where a signal cannot be caught it does what it does by itself.
        let _ = flag::register_conditional_shutdown(signal, 128 + signal, Arc::clone(&stop));
        let _ = flag::register(signal, Arc::clone(&stop));
    }
    stop
}

fn all() -> impl Iterator<Item = i32> {
    TERM_SIGNALS.iter().chain(HANG_UP).copied()
}

/// Signals that are listened to between the steps of a run. One that nobody has heard for a while ends the program: a start is
/// being searched, say, and there is no result to leave.
pub struct Listener {
    asked: Arc<AtomicBool>,
    heard: Arc<AtomicBool>,
}

impl Listener {
    /// Listens from now on.
    pub fn new() -> Listener {
        let asked = on_signals();
        let signal = Arc::new(AtomicUsize::new(0));
        for one in all() {
            let _ = flag::register_usize(one, Arc::clone(&signal), one as usize);
        }
        let heard = Arc::new(AtomicBool::new(false));
        let (seen, is_asked) = (Arc::clone(&heard), Arc::clone(&asked));
        std::thread::spawn(move || {
            while !is_asked.load(Relaxed) {
                std::thread::sleep(LOOK);
            }
            std::thread::sleep(PATIENCE);
            if !seen.load(Relaxed) {
                screen::note("error: ended as asked, before there was a result");
                std::process::exit(128 + signal.load(Relaxed) as i32);
            }
        });
        Listener { asked, heard }
    }

    /// Whether the run is to end.
    pub fn is_asked(&self) -> bool {
        let asked = self.asked.load(Relaxed);
        self.heard.fetch_or(asked, Relaxed);
        asked
    }

    /// The run is over: what is left is written in any case.
    pub fn over(&self) {
        self.heard.store(true, Relaxed);
    }
}
