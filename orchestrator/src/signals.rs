//! Ctrl-C and similar signals: the first one requests an orderly end, a second one ends the program at once.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

use engine::{Interrupt, Progress};
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};

/// Time that a run in one process has to notice the request before a notice states what the run waits for.
const STALL_NOTICE_AFTER: Duration = Duration::from_secs(1);
/// Interval of the checks for the request.
const POLL_INTERVAL: Duration = Duration::from_millis(50);

/// One request for the whole program, so that a signal is seen by all parts of the program that check for it.
static REQUEST: OnceLock<Interrupt> = OnceLock::new();
/// Whether a run has reported an event since the request: its loop continues, and checks for the request.
static REQUEST_NOTICED: AtomicBool = AtomicBool::new(false);

/// Installs handlers of SIGINT, SIGTERM and SIGHUP; returns the request that they set.
pub fn interrupt() -> Interrupt {
    let install = || {
        let interrupt = Interrupt::default();
        for signal in [SIGINT, SIGTERM, SIGHUP] {
            // Registered first, so that it acts on the second signal: the flag is still clear at the first.
            let both = signal_hook::flag::register_conditional_shutdown(signal, 1, interrupt.flag())
                .and_then(|_| signal_hook::flag::register(signal, interrupt.flag()));
            both.expect("the system refuses only signals that do not exist");
        }
        interrupt
    };
    REQUEST.get_or_init(install).clone()
}

/// Records that a run has reported its time or its end.
pub fn record_run_event() {
    if REQUEST.get().is_some_and(Interrupt::is_requested) {
        REQUEST_NOTICED.store(true, Ordering::Relaxed);
    }
}

/// Watches a run in one process until this value is dropped: a step that does not return also keeps the run from noticing a signal, and
/// the signal would seem lost.
pub struct StallWatch(Arc<AtomicBool>);

impl StallWatch {
    /// Watches the run that reports to `progress`.
    pub fn start(progress: &Progress) -> StallWatch {
        let (finished, progress, interrupt) = (Arc::new(AtomicBool::new(false)), progress.clone(), interrupt());
        let watch = StallWatch(finished.clone());
        // Only the thread that executes the step knows the participant.
        std::thread::spawn(move || {
            let mut since = None;
            while !finished.load(Ordering::Relaxed) && !REQUEST_NOTICED.load(Ordering::Relaxed) {
                if interrupt.is_requested() && since.get_or_insert_with(Instant::now).elapsed() >= STALL_NOTICE_AFTER {
                    progress.notice("waiting for a participant in its step; again to end at once");
                    return;
                }
                std::thread::sleep(POLL_INTERVAL);
            }
        });
        watch
    }
}

impl Drop for StallWatch {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}
