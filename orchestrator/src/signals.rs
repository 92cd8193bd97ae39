//! Ctrl-C and similar signals: the first one requests an orderly end, a second one ends the program at once.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

use engine::{Interrupt, Progress};
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};

/// How long a run in one process has to notice the request before the user is told what it waits for.
const NOTICED_WITHIN: Duration = Duration::from_secs(1);
/// The pause between two looks at the request.
const LOOK: Duration = Duration::from_millis(50);

/// One request for the whole program, so that a signal is seen by all parts of the program that check for it.
static INSTALLED: OnceLock<Interrupt> = OnceLock::new();
/// Whether a run has reported something since the request: its loop has come back, and checks for the request.
static NOTICED: AtomicBool = AtomicBool::new(false);

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
    INSTALLED.get_or_init(install).clone()
}

/// A run reports its time, or that it is over.
pub fn run_goes_on() {
    if INSTALLED.get().is_some_and(Interrupt::asked) {
        NOTICED.store(true, Ordering::Relaxed);
    }
}

/// Watches a run in one process until it is dropped: a step that does not come back also keeps the run from noticing a signal, which
/// the user would take for one that was lost.
pub struct Watch(Arc<AtomicBool>);

impl Watch {
    /// Watches the run that reports to `progress`.
    pub fn over(progress: &Progress) -> Watch {
        let (over, progress, interrupt) = (Arc::new(AtomicBool::new(false)), progress.clone(), interrupt());
        let watch = Watch(over.clone());
        // Which participant is in its step is known to the thread that is in it alone.
        std::thread::spawn(move || {
            let mut since = None;
            while !over.load(Ordering::Relaxed) && !NOTICED.load(Ordering::Relaxed) {
                if interrupt.asked() && since.get_or_insert_with(Instant::now).elapsed() >= NOTICED_WITHIN {
                    progress.say("waiting for a participant in its step; again to end at once");
                    return;
                }
                std::thread::sleep(LOOK);
            }
        });
        watch
    }
}

impl Drop for Watch {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}
