//! Observers: what a run or a campaign reports while it runs, and what is decided in a pause.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// An event of a run or a campaign.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Event<'a> {
    /// A run of `duration_s` simulated seconds begins.
    Begun {
        /// Simulated time from start to end, s.
        duration_s: f64,
    },
    /// The newest sample is stamped `t_s`. Reported every few milliseconds at least.
    Time {
        /// Simulated time, s.
        t_s: f64,
    },
    /// A campaign has `done` of `all` points, `resumed` of them from an earlier start.
    Points {
        /// Points with a result.
        done: usize,
        /// Points of the campaign.
        all: usize,
        /// Points whose results existed when it began.
        resumed: usize,
        /// Whether more points may follow, depending on the results of these.
        grows: bool,
    },
    /// Something that a user should see; the run continues.
    Notice {
        /// One or more lines.
        text: &'a str,
    },
    /// A participant of a run in one process has logged a line, which is in its log too. The lines of an external program are only
    /// in its log.
    LogLine {
        /// The participant's name.
        participant: &'a str,
        /// The line, with its name and the simulated time.
        line: &'a str,
    },
    /// The run is paused at `t_s` until [`Observer::pause_decision`] or the live page lets it continue.
    Paused {
        /// Simulated time, s.
        t_s: f64,
        /// Which process is which participant, in words.
        processes: &'a str,
    },
    /// Nothing more will be reported.
    Over,
}

/// What happens to a paused run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PauseDecision {
    /// It continues.
    Continue,
    /// It ends here.
    End,
    /// The observer will not decide: only the live page can let the run continue, and without one it ends.
    Unavailable,
}

/// Receives the events of a run or a campaign. It is called on the thread that runs it, so an implementation must return at once.
pub trait Observer: Send {
    /// Receives `event`.
    fn event(&mut self, event: Event<'_>);

    /// What happens to the paused run; called repeatedly during the pause. `None` as long as nothing is decided.
    fn pause_decision(&mut self) -> Option<PauseDecision> {
        None
    }
}

/// An observer that reports nothing and leaves the decision on a paused run to the live page.
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl Observer for Silent {
    fn event(&mut self, _: Event<'_>) {}
}

/// The engine's access to the observer, if there is one.
#[derive(Clone, Default)]
pub struct Progress(Option<Arc<Mutex<dyn Observer>>>);

impl Progress {
    /// Reports to `observer`.
    pub fn new(observer: impl Observer + 'static) -> Progress {
        Progress(Some(Arc::new(Mutex::new(observer))))
    }

    fn observer(&self) -> Option<MutexGuard<'_, dyn Observer + 'static>> {
        let observer = self.0.as_ref()?;
        Some(observer.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Reports `event`.
    pub fn report(&self, event: Event<'_>) {
        if let Some(mut observer) = self.observer() {
            observer.event(event);
        }
    }

    /// Reports something that a user should see.
    pub fn notice(&self, text: &str) {
        self.report(Event::Notice { text });
    }

    /// What happens to the paused run, if that is decided.
    pub(crate) fn pause_decision(&self) -> Option<PauseDecision> {
        self.observer()?.pause_decision()
    }
}

/// A request for an orderly end, which any thread or signal handler can make.
#[derive(Debug, Clone, Default)]
pub struct Interrupt(Arc<AtomicBool>);

impl Interrupt {
    /// Requests an orderly end of everything that holds a copy of this.
    pub fn request(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Whether an end was requested.
    pub fn is_requested(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    /// The flag itself, for a signal handler.
    pub fn flag(&self) -> Arc<AtomicBool> {
        self.0.clone()
    }
}
