//! The spans of one participant before they are sent to the orchestrator.

use crate::control::ParticipantEvent;
use crate::span::{Detail, Doing, Span, core, now_ns};

/// The most spans kept while the recorder has no room for them. Later ones are dropped and counted.
const KEPT: usize = 4096;
/// Spans in one event, which stays below the size of the longest one.
const TOGETHER: usize = 64;
/// The longest interval between two events, ns.
const EVERY_NS: u64 = 20_000_000;

/// The spans that have not been sent yet.
pub(super) struct Spans {
    detail: Detail,
    kept: Vec<Span>,
    /// The number of spans dropped since the last event.
    lost: u64,
    handed_ns: u64,
    /// When the participant reached the horizon, ns.
    resting_ns: Option<u64>,
}

impl Spans {
    pub(super) fn new(detail: Detail) -> Spans {
        Spans {
            detail,
            kept: Vec::with_capacity(KEPT),
            lost: 0,
            handed_ns: 0,
            resting_ns: None,
        }
    }

    /// Records that part of a step of `activation` was done since `begin_ns`.
    pub(super) fn computed(&mut self, activation: u64, begin_ns: u64, done: bool) {
        self.keep(Span {
            activation,
            doing: Doing::Computing { done },
            core: core(),
            sleeps: 0,
            begin_ns,
            end_ns: now_ns(),
        });
    }

    /// Records a wait.
    pub(super) fn waited(&mut self, activation: u64, doing: Doing, sleeps: u32, begin_ns: u64, end_ns: u64) {
        if self.detail == Detail::Waits {
            let core = core();
            self.keep(Span {
                activation,
                doing,
                core,
                sleeps,
                begin_ns,
                end_ns,
            });
        }
    }

    /// Records that the participant has reached the horizon.
    pub(super) fn rests(&mut self) {
        self.resting_ns = Some(now_ns());
    }

    /// Records that the participant continues from the horizon with `activation`.
    pub(super) fn goes_on(&mut self, activation: u64) {
        if let Some(begin_ns) = self.resting_ns.take() {
            self.waited(activation, Doing::Horizon, 0, begin_ns, now_ns());
        }
    }

    fn keep(&mut self, span: Span) {
        // Once a span is dropped, all later ones are too until there is room for the rest: the reported spans then have a single gap.
        if self.kept.len() < KEPT && self.lost == 0 {
            self.kept.push(span);
        } else {
            self.lost += 1;
        }
    }

    /// Whether an event is due.
    pub(super) fn is_due(&self) -> bool {
        let newest = self.kept.last().map_or(0, |span| span.end_ns);
        self.kept.len() >= TOGETHER || newest > self.handed_ns + EVERY_NS
    }

    /// The next event, if there is anything to report.
    pub(super) fn event(&self) -> Option<ParticipantEvent> {
        let spans = &self.kept[..self.kept.len().min(TOGETHER)];
        (!spans.is_empty() || self.lost > 0).then(|| ParticipantEvent::Spans {
            // The dropped spans came after all that are kept.
            lost: if spans.len() == self.kept.len() { self.lost } else { 0 },
            spans: spans.to_vec(),
        })
    }

    /// Records that the event was sent.
    pub(super) fn handed(&mut self) {
        let count = self.kept.len().min(TOGETHER);
        self.handed_ns = self.kept.get(count.saturating_sub(1)).map_or(0, |span| span.end_ns);
        self.kept.drain(..count);
        if self.kept.is_empty() {
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
        let count = KEPT as u64 + 10;
        (0..count).for_each(|at| spans.waited(at, Doing::Recorder, 0, at, at + 1));
        let (mut told, mut left_out) = (Vec::new(), 0);
        while let Some(ParticipantEvent::Spans { lost, spans: some }) = spans.event() {
            assert_eq!(left_out, 0, "nothing is told behind what is missing");
            left_out += lost;
            told.extend(some.iter().map(|span| span.activation));
            spans.handed();
        }
        assert_eq!((told, left_out), ((0..KEPT as u64).collect(), 10));
    }

    #[test]
    fn spans_omit_waits_unless_requested() {
        let mut spans = Spans::new(Detail::Steps);
        spans.waited(0, Doing::Horizon, 0, 0, 1);
        assert_eq!(spans.event(), None);
        spans.computed(3, now_ns(), true);
        assert!(matches!(spans.event(), Some(ParticipantEvent::Spans { lost: 0, spans }) if spans[0].activation == 3));
    }
}
