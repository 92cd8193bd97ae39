//! The interface through which a live page controls the horizon of a run: a limit, and the progress of the run.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicI64, Ordering};
use std::sync::{Mutex, OnceLock, PoisonError};

use lockstep::plan::Plan;
use lockstep::time::{Rational, Ticks};

/// A command of a live page.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum LiveCommand {
    /// Pause as soon as possible.
    Pause,
    /// Go on.
    Resume,
    /// While paused: run up to and including the next activation of this participant.
    StepOf(String),
    /// While paused: run for this much simulated time.
    StepBy(Rational),
}

/// The constant data of a run that has begun.
pub struct RunContext {
    /// Its plan.
    pub plan: Plan,
    /// Its folder.
    pub folder: PathBuf,
}

/// Shared between a run and its live page. Neither waits for the other.
pub struct Steering {
    /// Upper limit of new horizons; a horizon already granted is not withdrawn.
    limit: AtomicI64,
    newest: AtomicI64,
    granted: AtomicI64,
    resting: AtomicBool,
    course: OnceLock<RunContext>,
    /// How the run keeps pace with the wall clock.
    pace: Mutex<serde_json::Value>,
    /// How the run ended, in words.
    ended: OnceLock<String>,
}

impl Default for Steering {
    fn default() -> Steering {
        Steering {
            limit: AtomicI64::new(Ticks::MAX),
            newest: AtomicI64::new(0),
            granted: AtomicI64::new(0),
            resting: AtomicBool::new(false),
            course: OnceLock::new(),
            pace: Mutex::default(),
            ended: OnceLock::new(),
        }
    }
}

impl Steering {
    /// Called when the run begins: its tape exists.
    pub fn begin(&self, plan: &Plan, folder: PathBuf) {
        let plan = plan.clone();
        let _ = self.course.set(RunContext { plan, folder });
    }

    /// The run that has begun.
    pub fn context(&self) -> Option<&RunContext> {
        self.course.get()
    }

    /// The present limit of the horizon.
    pub fn limit(&self) -> Ticks {
        self.limit.load(Ordering::Relaxed)
    }

    /// Whether the limit permits the run to go past `at`.
    pub fn allows_past(&self, at: Ticks) -> bool {
        self.limit() > at
    }

    /// Sets the limit so that no further horizon is granted.
    pub fn pause(&self) {
        self.limit.store(0, Ordering::Relaxed);
    }

    /// Removes the limit.
    pub fn resume(&self) {
        self.limit.store(Ticks::MAX, Ordering::Relaxed);
    }

    /// Sets the limit to this instant.
    pub fn go_to(&self, limit: Ticks) {
        self.limit.store(limit, Ordering::Relaxed);
    }

    /// Called by the run to report its progress.
    pub fn tell(&self, newest: Ticks, granted: Ticks, resting: bool) {
        self.newest.store(newest, Ordering::Relaxed);
        self.granted.store(granted, Ordering::Relaxed);
        self.resting.store(resting, Ordering::Relaxed);
    }

    /// Called by the run to report the pace so far.
    pub fn report_pace(&self, pace: &impl serde::Serialize) {
        let pace = serde_json::to_value(pace).expect("the figures of a pace are numbers and texts");
        *self.pace.lock().unwrap_or_else(PoisonError::into_inner) = pace;
    }

    /// Called when the run is over and its folder complete.
    pub fn end(&self, how: String) {
        let _ = self.ended.set(how);
    }

    /// How the run ended, when it has.
    pub fn ended(&self) -> Option<&str> {
        self.ended.get().map(String::as_str)
    }

    /// Executes a command, or returns why it is not possible.
    pub fn execute(&self, command: &LiveCommand) -> Result<(), String> {
        let Some(RunContext { plan, .. }) = self.context() else {
            return Err("the run has not begun yet".into());
        };
        if self.ended().is_some() {
            return Err("the run is over".into());
        }
        let granted = self.granted.load(Ordering::Relaxed);
        let target = match command {
            LiveCommand::Pause => {
                self.pause();
                return Ok(());
            }
            LiveCommand::Resume => {
                self.resume();
                return Ok(());
            }
            _ if self.limit() == Ticks::MAX => return Err("the run is not paused: pause it first".into()),
            LiveCommand::StepOf(name) => {
                let number = plan
                    .participant(name)
                    .ok_or_else(|| format!("there is no participant `{name}`"))?;
                let sample_time = plan.participants[number].sample_time;
                // The first activation that has not happened yet; the step includes all other activations at that instant.
                sample_time.instant(sample_time.count_before(granted)).saturating_add(1)
            }
            LiveCommand::StepBy(time) if time.is_positive() => {
                let ticks = plan.timebase.ceil(*time).map_err(|error| error.to_string())?;
                granted.saturating_add(ticks)
            }
            LiveCommand::StepBy(time) => return Err(format!("a step of {time} does not go ahead")),
        };
        self.go_to(target.min(plan.end));
        Ok(())
    }

    /// The progress of the run, for the page.
    pub fn state(&self) -> serde_json::Value {
        let seconds = |ticks: Ticks| {
            self.context()
                .map_or(0.0, |course| course.plan.timebase.seconds(ticks.max(0)))
        };
        serde_json::json!({
            "t": seconds(self.newest.load(Ordering::Relaxed)),
            "horizon": seconds(self.granted.load(Ordering::Relaxed)),
            "paused": self.limit() != Ticks::MAX,
            "resting": self.resting.load(Ordering::Relaxed),
            "ended": self.ended(),
            "pace": *self.pace.lock().unwrap_or_else(PoisonError::into_inner),
        })
    }
}
