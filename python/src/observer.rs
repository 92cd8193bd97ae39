//! Events of a run, for Python, and Ctrl-C, which the interpreter only checks on request.

use std::time::{Duration, Instant};

use engine::{Event, Interrupt, Observer};
use pyo3::prelude::*;

/// The interval at which the interpreter checks for signals during a run.
const LOOK: Duration = Duration::from_millis(20);

/// Calls a Python function: `told(what, …)`.
pub(crate) struct Teller {
    told: Option<Py<PyAny>>,
    interrupt: Interrupt,
    /// When a time was last told: the first one always is, however short the run.
    looked: Option<Instant>,
}

impl Teller {
    pub(crate) fn new(told: Option<Py<PyAny>>, interrupt: Interrupt) -> Teller {
        Teller {
            told,
            interrupt,
            looked: None,
        }
    }

    fn tell<'py>(&self, py: Python<'py>, event: Event<'_>) -> PyResult<()> {
        // A signal handler may raise, and so may the callback: both end the run in an orderly way.
        py.check_signals()?;
        let Some(told) = &self.told else { return Ok(()) };
        match event {
            Event::Begun { duration_s } => told.call1(py, ("begun", duration_s)),
            Event::Time { t_s } => told.call1(py, ("time", t_s)),
            Event::Notice { text } => told.call1(py, ("notice", text)),
            Event::Over => told.call1(py, ("over", 0.0)),
            _ => return Ok(()),
        }?;
        Ok(())
    }
}

impl Observer for Teller {
    fn event(&mut self, event: Event<'_>) {
        if matches!(event, Event::Time { .. }) {
            if self.looked.is_some_and(|looked| looked.elapsed() < LOOK) {
                return;
            }
            self.looked = Some(Instant::now());
        }
        Python::attach(|py| {
            if let Err(error) = self.tell(py, event) {
                error.write_unraisable(py, None);
                self.interrupt.ask();
            }
        });
    }
}
