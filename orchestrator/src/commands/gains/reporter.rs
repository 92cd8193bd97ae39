//! Progress of the work on gains, on standard error.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use synthesis::tuner::SearchControl;

use crate::line::Line;

/// Reports progress on standard error, and passes on a request to stop.
pub struct Reporter<'a> {
    stop: &'a AtomicBool,
    line: Mutex<Line>,
    started: Instant,
}

impl<'a> Reporter<'a> {
    pub fn new(stop: &'a AtomicBool) -> Reporter<'a> {
        Reporter {
            stop,
            line: Mutex::new(Line::new(false)),
            started: Instant::now(),
        }
    }

    fn line(&self) -> MutexGuard<'_, Line> {
        self.line.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Shows `text`, if an update is due.
    pub fn show(&self, text: impl FnOnce() -> String) -> SearchControl {
        self.line()
            .show(|| format!("{}, {:.0} s so far", text(), self.started.elapsed().as_secs_f64()));
        if self.stop.load(Ordering::Relaxed) {
            SearchControl::Stop
        } else {
            SearchControl::Continue
        }
    }

    /// Reports `what` number `done` of `all`; returns whether to stop before it.
    pub fn progress_or_stop(&self, what: &str, done: usize, all: usize) -> bool {
        self.show(|| format!("{what} {} of {all}", done + 1)) == SearchControl::Stop
    }

    /// Ends the report.
    pub fn finish(&self) {
        self.line().clear();
    }
}
