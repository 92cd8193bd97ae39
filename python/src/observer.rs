//! What happens in a run, for Python; and Ctrl-C, which the interpreter only looks for when it is asked to.

use std::time::{Duration, Instant};

use engine::{Event, Interrupt, Observer};
use pyo3::prelude::*;

/// The interpreter looks for signals this often while a run goes on.
const LOOK: Duration = Duration::from_millis(20);

/// Tells a function of Python's: `told(what, …)`.
pub(crate) struct Teller {
    told: Option<Py<PyAny>>,
    interrupt: Interrupt,
    looked: Instant,
}

impl Teller {
    pub(crate) fn new(told: Option<Py<PyAny>>, interrupt: Interrupt) -> Teller {
        Teller {
            told,
            interrupt,
            looked: Instant::now(),
        }
    }

    fn tell<'py>(&self, py: Python<'py>, event: Event<'_>) -> PyResult<()> {
        // A signal's handler may raise, and so may whoever is told: both end the run in order.
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
            if self.looked.elapsed() < LOOK {
                return;
            }
            self.looked = Instant::now();
        }
        Python::attach(|py| {
            if let Err(error) = self.tell(py, event) {
                error.write_unraisable(py, None);
                self.interrupt.ask();
            }
        });
    }
}
