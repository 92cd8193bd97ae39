//! Ctrl-C and similar signals: the first one requests an orderly end, a second one ends the program at once.

use std::sync::{Mutex, PoisonError};

use engine::Interrupt;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};

/// Installs handlers of SIGINT, SIGTERM and SIGHUP; returns the request that they set.
pub fn interrupt() -> Interrupt {
    // One flag for the whole program, so that a signal is seen by all parts of the program that check for it.
    static INSTALLED: Mutex<Option<Interrupt>> = Mutex::new(None);
    let mut installed = INSTALLED.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(interrupt) = &*installed {
        return interrupt.clone();
    }
    let interrupt = Interrupt::default();
    for signal in [SIGINT, SIGTERM, SIGHUP] {
        // Registered first, so that it acts on the second signal: the flag is still clear at the first.
        let both = signal_hook::flag::register_conditional_shutdown(signal, 1, interrupt.flag())
            .and_then(|_| signal_hook::flag::register(signal, interrupt.flag()));
        both.expect("the system refuses only signals that do not exist");
    }
    *installed = Some(interrupt.clone());
    interrupt
}
