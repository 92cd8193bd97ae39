//! Buffer for the log lines of an FMU's participants until the end of the importer's call: the importer's log is for the calling thread.

use std::sync::{Arc, Mutex, PoisonError};

use engine::{Event, Observer};
use lockstep::participant::{Line, Sink};

/// Lines in the order of their arrival.
#[derive(Clone, Default)]
pub struct Lines(Arc<Mutex<Vec<String>>>);

impl Lines {
    /// Takes the lines that have arrived since the last call.
    pub fn take(&self) -> Vec<String> {
        std::mem::take(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }

    fn add(&self, line: String) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(line);
    }
}

impl Sink for Lines {
    fn write_line(&self, line: &Line<'_>) {
        self.add(line.to_string());
    }
}

impl Observer for Lines {
    fn event(&mut self, event: Event<'_>) {
        if let Event::LogLine { line, .. } = event {
            self.add(line.to_owned());
        }
    }
}
