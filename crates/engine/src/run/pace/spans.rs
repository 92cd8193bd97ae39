//! Spans of wall time that participants report: evaluated for the pace, and written into the trace.

use std::sync::Arc;
use std::time::{Duration, Instant};

use lockstep::plan::Plan;
use lockstep::span::{Detail, Span, SpanActivity, core, now_ns};

use super::horizon::ClockController;
use super::lateness::Watchman;
use super::punctuality::Punctuality;
use super::trace::Trace;
use super::traced::Traced;
use crate::run::options::Options;
use crate::run::outcome::RunFailure;

/// How often the live page is informed of how the pace is kept.
const TELL: Duration = Duration::from_millis(250);

/// Everything that is derived from spans.
pub(crate) struct Times {
    plan: Arc<Plan>,
    watchman: Option<Watchman>,
    trace: Option<Trace>,
    /// In one loop: when the present activation began.
    begun_ns: u64,
    told: Option<Instant>,
}

impl Options {
    /// In how much detail participants are to report their spans; `None` when spans are not needed.
    pub(crate) fn detail(&self) -> Option<Detail> {
        match (&self.trace, self.pace) {
            (Some(_), _) => Some(Detail::Waits),
            (None, Some(_)) => Some(Detail::Steps),
            (None, None) => None,
        }
    }
}

impl Times {
    /// For a run of `plan`.
    ///
    /// # Errors
    /// When the file of the trace cannot be made.
    pub(crate) fn new(plan: &Arc<Plan>, options: &Options, title: &str) -> Result<Times, RunFailure> {
        let trace = options.trace.as_deref().map(|path| Trace::create(path, title));
        Ok(Times {
            watchman: (options.pace).map(|asked| Watchman::new(plan.participants.len(), asked, options.overrun)),
            trace: trace.transpose()?,
            plan: plan.clone(),
            begun_ns: 0,
            told: None,
        })
    }

    /// Whether spans are needed.
    pub(crate) fn wants(&self) -> bool {
        self.watchman.is_some() || self.trace.is_some()
    }

    /// Takes spans of participant number `number`, after which `lost` spans are missing.
    pub(crate) fn take(&mut self, number: usize, lost: u64, spans: &[Span], clock: &ClockController) {
        if let (Some(watchman), Some(pace)) = (&mut self.watchman, clock.pace()) {
            pace.look(now_ns);
            spans
                .iter()
                .for_each(|span| watchman.look(number, span, clock, &self.plan));
        }
        if let Some(trace) = &mut self.trace {
            trace.take(number, lost, spans, &self.plan);
        }
    }

    /// In one loop: a participant begins an activation.
    pub(crate) fn begins(&mut self) {
        self.begun_ns = now_ns();
    }

    /// In one loop: participant number `number`, the last one to begin, has completed `activation`.
    pub(crate) fn stepped(&mut self, number: usize, activation: u64, clock: &ClockController) {
        let span = Span {
            activation,
            activity: SpanActivity::Computing { done: true },
            core: core(),
            sleeps: 0,
            begin_ns: self.begun_ns,
            end_ns: now_ns(),
        };
        self.take(number, 0, &[span], clock);
    }

    /// Why the run is to end here: a step overran, and the run was to end then.
    pub(crate) fn stops(&self) -> Option<&str> {
        self.watchman.as_ref().and_then(Watchman::stops)
    }

    /// How the pace is kept, for the live page; `None` between two updates.
    pub(crate) fn news(&mut self) -> Option<Punctuality> {
        let watchman = self.watchman.as_ref()?;
        if self.told.is_some_and(|told| told.elapsed() < TELL) {
            return None;
        }
        self.told = Some(Instant::now());
        Some(watchman.account(&self.plan))
    }

    /// The results.
    pub(crate) fn finish(self) -> (Option<Punctuality>, Option<Traced>) {
        let punctuality = self.watchman.map(|watchman| watchman.account(&self.plan));
        (punctuality, self.trace.map(Trace::finish))
    }
}
