//! The spans of one participant before they are sent to the orchestrator.

use crate::control::ParticipantEvent;
use crate::span::{Detail, Span, SpanActivity, core, now_ns};

/// The most spans retained while the recorder has no room for them. Later ones are dropped and counted.
const CAPACITY: usize = 4096;
/// Spans in one event, which stays below the size of the longest one.
const BATCH: usize = 64;
/// The longest interval between two events, ns.
const INTERVAL_NS: u64 = 20_000_000;

/// The spans that have not been sent yet.
pub(super) struct Spans {
    detail: Detail,
    pending: Vec<Span>,
    /// The number of spans dropped since the last event.
    lost: u64,
    sent_ns: u64,
    /// When the participant reached the horizon, ns.
    paused_ns: Option<u64>,
}

impl Spans {
    pub(super) fn new(detail: Detail) -> Spans {
        Spans {
            detail,
            pending: Vec::with_capacity(CAPACITY),
            lost: 0,
            sent_ns: 0,
            paused_ns: None,
        }
    }

    /// Records that part of a step of `activation` was done since `begin_ns`.
    pub(super) fn record_step(&mut self, activation: u64, begin_ns: u64, done: bool) {
        self.push(Span {
            activation,
            activity: SpanActivity::Computing { done },
            core: core(),
            sleeps: 0,
            begin_ns,
            end_ns: now_ns(),
        });
    }

    /// Records a wait.
    pub(super) fn record_wait(
        &mut self,
        activation: u64,
        activity: SpanActivity,
        sleeps: u32,
        begin_ns: u64,
        end_ns: u64,
    ) {
        if self.detail == Detail::Waits {
            let core = core();
            self.push(Span {
                activation,
                activity,
                core,
                sleeps,
                begin_ns,
                end_ns,
            });
        }
    }

    /// Records that the participant has reached the horizon.
    pub(super) fn begin_pause(&mut self) {
        self.paused_ns = Some(now_ns());
    }

    /// Records that the participant continues from the horizon with `activation`.
    pub(super) fn end_pause(&mut self, activation: u64) {
        if let Some(begin_ns) = self.paused_ns.take() {
            self.record_wait(activation, SpanActivity::Horizon, 0, begin_ns, now_ns());
        }
    }

    fn push(&mut self, span: Span) {
        // Once a span is dropped, all later ones are too until there is room for the rest: the reported spans then have a single gap.
        if self.pending.len() < CAPACITY && self.lost == 0 {
            self.pending.push(span);
        } else {
            self.lost += 1;
        }
    }

    /// Whether an event is due.
    pub(super) fn is_due(&self) -> bool {
        let newest = self.pending.last().map_or(0, |span| span.end_ns);
        self.pending.len() >= BATCH || newest > self.sent_ns + INTERVAL_NS
    }

    /// The next event, if there is anything to report.
    pub(super) fn event(&self) -> Option<ParticipantEvent> {
        let spans = &self.pending[..self.pending.len().min(BATCH)];
        (!spans.is_empty() || self.lost > 0).then(|| ParticipantEvent::Spans {
            // The dropped spans came after all that are kept.
            lost: if spans.len() == self.pending.len() {
                self.lost
            } else {
                0
            },
            spans: spans.to_vec(),
        })
    }

    /// Records that the event was sent.
    pub(super) fn mark_sent(&mut self) {
        let count = self.pending.len().min(BATCH);
        self.sent_ns = self.pending.get(count.saturating_sub(1)).map_or(0, |span| span.end_ns);
        self.pending.drain(..count);
        if self.pending.is_empty() {
            self.lost = 0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spans_count_dropped_after_kept() {
        let mut spans = Spans::new(Detail::Waits);
        let count = CAPACITY as u64 + 10;
        (0..count).for_each(|at| spans.record_wait(at, SpanActivity::Recorder, 0, at, at + 1));
        let (mut reported, mut lost_count) = (Vec::new(), 0);
        while let Some(ParticipantEvent::Spans { lost, spans: some }) = spans.event() {
            assert_eq!(lost_count, 0, "no span is reported after missing ones");
            lost_count += lost;
            reported.extend(some.iter().map(|span| span.activation));
            spans.mark_sent();
        }
        assert_eq!((reported, lost_count), ((0..CAPACITY as u64).collect(), 10));
    }

    #[test]
    fn spans_omit_waits_unless_requested() {
        let mut spans = Spans::new(Detail::Steps);
        spans.record_wait(0, SpanActivity::Horizon, 0, 0, 1);
        assert_eq!(spans.event(), None);
        spans.record_step(3, now_ns(), true);
        assert!(matches!(spans.event(), Some(ParticipantEvent::Spans { lost: 0, spans }) if spans[0].activation == 3));
    }
}
