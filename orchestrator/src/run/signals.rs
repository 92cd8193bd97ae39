//! Ctrl-C and its relatives: the first asks the run to end in order, a second one ends it at once.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};

/// Whether somebody asked the run to end.
#[derive(Debug, Clone)]
pub struct Interrupt(Arc<AtomicBool>);

impl Interrupt {
    /// Takes over SIGINT, SIGTERM and SIGHUP.
    pub fn install() -> std::io::Result<Interrupt> {
        // One flag for the whole program: a signal between two who look for it is lost to neither.
        static ASKED: Mutex<Option<Arc<AtomicBool>>> = Mutex::new(None);
        let mut known = ASKED.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(asked) = &*known {
            return Ok(Interrupt(asked.clone()));
        }
        let asked = Arc::new(AtomicBool::new(false));
        for signal in [SIGINT, SIGTERM, SIGHUP] {
            // Registered first, so that it acts on the second signal: the flag is still clear at the first.
            signal_hook::flag::register_conditional_shutdown(signal, 1, asked.clone())?;
            signal_hook::flag::register(signal, asked.clone())?;
        }
        *known = Some(asked.clone());
        Ok(Interrupt(asked))
    }

    /// True after the first signal.
    pub fn asked(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}
