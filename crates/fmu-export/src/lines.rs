//! What the participants of an FMU say, until the importer's call ends: its log belongs to the thread that calls.

use std::sync::{Arc, Mutex, PoisonError};

use engine::{Event, Observer};
use lockstep::participant::{Line, Sink};

/// Lines in the order in which they came.
#[derive(Clone, Default)]
pub struct Lines(Arc<Mutex<Vec<String>>>);

impl Lines {
    /// Those that came since they were taken last.
    pub fn take(&self) -> Vec<String> {
        std::mem::take(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }

    fn add(&self, line: String) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(line);
    }
}

impl Sink for Lines {
    fn say(&self, line: &Line<'_>) {
        self.add(line.to_string());
    }
}

impl Observer for Lines {
    fn event(&mut self, event: Event<'_>) {
        if let Event::Said { line, .. } = event {
            self.add(line.to_owned());
        }
    }
}
