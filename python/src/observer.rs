//! Events of a run, for Python, and Ctrl-C, which the interpreter only checks on request.

use std::time::{Duration, Instant};

use engine::{Event, Interrupt, Observer};
use pyo3::prelude::*;

/// The interval at which the interpreter checks for signals during a run.
const SIGNAL_CHECK_INTERVAL: Duration = Duration::from_millis(20);

/// Forwards events to a Python function: `callback(what, …)`.
pub(crate) struct EventForwarder {
    callback: Option<Py<PyAny>>,
    interrupt: Interrupt,
    /// When a time was last forwarded: the first one always is, however short the run.
    last_check: Option<Instant>,
}

impl EventForwarder {
    pub(crate) fn new(callback: Option<Py<PyAny>>, interrupt: Interrupt) -> EventForwarder {
        EventForwarder {
            callback,
            interrupt,
            last_check: None,
        }
    }

    fn forward<'py>(&self, py: Python<'py>, event: Event<'_>) -> PyResult<()> {
        // A signal handler may raise, and so may the callback: both end the run in an orderly way.
        py.check_signals()?;
        let Some(callback) = &self.callback else { return Ok(()) };
        match event {
            Event::Begun { duration_s } => callback.call1(py, ("begun", duration_s)),
            Event::Time { t_s } => callback.call1(py, ("time", t_s)),
            Event::Notice { text } => callback.call1(py, ("notice", text)),
            Event::Over => callback.call1(py, ("over", 0.0)),
            _ => return Ok(()),
        }?;
        Ok(())
    }
}

impl Observer for EventForwarder {
    fn event(&mut self, event: Event<'_>) {
        if matches!(event, Event::Time { .. }) {
            if self
                .last_check
                .is_some_and(|last_check| last_check.elapsed() < SIGNAL_CHECK_INTERVAL)
            {
                return;
            }
            self.last_check = Some(Instant::now());
        }
        Python::attach(|py| {
            if let Err(error) = self.forward(py, event) {
                error.write_unraisable(py, None);
                self.interrupt.request();
            }
        });
    }
}
