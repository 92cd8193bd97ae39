//! The log of a participant: lines of text with the simulated time.

use std::fmt;
use std::io::Write;
use std::sync::Arc;

/// A line of a participant's log.
#[derive(Debug, Clone, Copy)]
pub struct Line<'a> {
    /// The participant's name.
    pub participant: &'a str,
    /// The instant, s; none outside of a run.
    pub t: Option<f64>,
    /// The text.
    pub text: fmt::Arguments<'a>,
}

impl fmt::Display for Line<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.t {
            Some(t) => write!(f, "{} at t = {t} s: {}", self.participant, self.text),
            None => write!(f, "{}: {}", self.participant, self.text),
        }
    }
}

/// Receives the log lines of participants that run in one process.
pub trait Sink: Send + Sync {
    /// Receives a line.
    fn write_line(&self, line: &Line<'_>);
}

/// A participant's log, which knows the simulated time. Without a [`Sink`], lines go to standard error, which is the log of a process
/// that hosts one participant.
#[derive(Clone)]
pub struct Log {
    participant: Arc<str>,
    t: Option<f64>,
    sink: Option<Arc<dyn Sink>>,
}

impl Log {
    /// The log of the participant called `name`.
    pub fn new(name: &str, sink: Option<Arc<dyn Sink>>) -> Log {
        Log {
            participant: name.into(),
            t: None,
            sink,
        }
    }

    /// The same log at the instant `t`, s.
    #[must_use]
    pub fn at(mut self, t: f64) -> Log {
        self.t = Some(t);
        self
    }

    /// The simulated time of the lines written now, s; none outside of a run.
    pub fn time(&self) -> Option<f64> {
        self.t
    }

    pub(crate) fn set_time(&mut self, t: f64) {
        self.t = Some(t);
    }

    /// Writes a line, with the simulated time.
    pub fn write(&self, text: impl fmt::Display) {
        let line = Line {
            participant: &self.participant,
            t: self.t,
            text: format_args!("{text}"),
        };
        match &self.sink {
            Some(sink) => sink.write_line(&line),
            // A pipe without a reader is no reason to fail. The line is written by one call, so that other lines do not interleave.
            None => drop(std::io::stderr().write_all(format!("{line}\n").as_bytes())),
        }
    }
}

impl fmt::Debug for Log {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Log({} at {:?})", self.participant, self.t)
    }
}
