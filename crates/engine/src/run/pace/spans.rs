//! Spans of wall time that participants report: evaluated for the pace, and written into the trace.

use std::sync::Arc;
use std::time::{Duration, Instant};

use lockstep::plan::Plan;
use lockstep::span::{Detail, Span, SpanActivity, core, now_ns};

use super::clock_controller::ClockController;
use super::lateness::LatenessMonitor;
use super::report::PaceReport;
use super::trace::Trace;
use super::traced::TraceSummary;
use crate::run::options::Options;
use crate::run::outcome::RunFailure;

/// How often the live page is informed of the pace.
const UPDATE_INTERVAL: Duration = Duration::from_millis(250);

/// Everything that is derived from spans.
pub(crate) struct SpanAnalysis {
    plan: Arc<Plan>,
    lateness: Option<LatenessMonitor>,
    trace: Option<Trace>,
    /// In one loop: when the present activation began.
    begun_ns: u64,
    last_update: Option<Instant>,
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

impl SpanAnalysis {
    /// For a run of `plan`.
    ///
    /// # Errors
    /// When the file of the trace cannot be made.
    pub(crate) fn new(plan: &Arc<Plan>, options: &Options, title: &str) -> Result<SpanAnalysis, RunFailure> {
        let trace = options.trace.as_deref().map(|path| Trace::create(path, title));
        Ok(SpanAnalysis {
            lateness: (options.pace)
                .map(|requested| LatenessMonitor::new(plan.participants.len(), requested, options.overrun)),
            trace: trace.transpose()?,
            plan: plan.clone(),
            begun_ns: 0,
            last_update: None,
        })
    }

    /// Whether spans are needed.
    pub(crate) fn needs_spans(&self) -> bool {
        self.lateness.is_some() || self.trace.is_some()
    }

    /// Takes spans of participant number `number`, after which `lost` spans are missing.
    pub(crate) fn take(&mut self, number: usize, lost: u64, spans: &[Span], clock: &ClockController) {
        if let (Some(lateness), Some(pace)) = (&mut self.lateness, clock.pace()) {
            pace.check_suspension(now_ns);
            spans
                .iter()
                .for_each(|span| lateness.evaluate(number, span, clock, &self.plan));
        }
        if let Some(trace) = &mut self.trace {
            trace.take(number, lost, spans, &self.plan);
        }
    }

    /// In one loop: a participant begins an activation.
    pub(crate) fn step_begins(&mut self) {
        self.begun_ns = now_ns();
    }

    /// In one loop: participant number `number`, the last one to begin, has completed `activation`.
    pub(crate) fn step_ends(&mut self, number: usize, activation: u64, clock: &ClockController) {
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
    pub(crate) fn stop_reason(&self) -> Option<&str> {
        self.lateness.as_ref().and_then(LatenessMonitor::stop_reason)
    }

    /// The pace so far, for the live page; `None` between two updates.
    pub(crate) fn pace_update(&mut self) -> Option<PaceReport> {
        let lateness = self.lateness.as_ref()?;
        if self
            .last_update
            .is_some_and(|last_update| last_update.elapsed() < UPDATE_INTERVAL)
        {
            return None;
        }
        self.last_update = Some(Instant::now());
        Some(lateness.pace_report(&self.plan))
    }

    /// The results.
    pub(crate) fn finish(self) -> (Option<PaceReport>, Option<TraceSummary>) {
        let pace = self.lateness.map(|lateness| lateness.pace_report(&self.plan));
        (pace, self.trace.map(Trace::finish))
    }
}
