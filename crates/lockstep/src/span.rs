//! Spans: a participant's activity in an interval of wall-clock time, for performance analysis.
//!
//! The run does not depend on them, and they are not on the tape. They are recorded only on request.

use serde::{Deserialize, Serialize};

/// The environment variable that requests spans from a participant's process: `steps`, or `waits` for waits too.
pub const SPANS: &str = "ESCAPEMENT_SPANS";

/// The requested detail.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Detail {
    /// Steps alone.
    Steps,
    /// Steps, and the waits between them.
    Waits,
}

impl Detail {
    /// The word in [`SPANS`].
    pub fn name(self) -> &'static str {
        match self {
            Detail::Steps => "steps",
            Detail::Waits => "waits",
        }
    }

    /// The detail that a word in [`SPANS`] requests; an unknown word requests nothing.
    pub fn parse(word: &str) -> Option<Detail> {
        [Detail::Steps, Detail::Waits]
            .into_iter()
            .find(|detail| detail.name() == word)
    }
}

/// The activity of a participant.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum SpanActivity {
    /// The participant reads inputs, steps, records and sends. A step that has to wait for room has several such spans, and is complete at
    /// the end of the last one.
    Computing {
        /// Whether the step is complete.
        done: bool,
    },
    /// The participant waits for sample `index` of link number `link` of its incoming links.
    Sample {
        /// The link.
        link: u32,
        /// The sample.
        index: u64,
    },
    /// The participant waits for room on the link to consumer `consumer` of output `output`.
    Room {
        /// The output.
        output: u32,
        /// The consumer's position among those of the output.
        consumer: u32,
    },
    /// The participant waits for room in the recording.
    Recorder,
    /// The participant waits for the horizon: all activations before it are complete.
    Horizon,
}

/// An interval of wall-clock time of one participant.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Span {
    /// The activation that it belongs to, or that comes next.
    pub activation: u64,
    /// Its activity.
    pub activity: SpanActivity,
    /// The core at the end of the interval.
    pub core: u32,
    /// The number of sleeps, whether the participant was woken or woke by itself.
    pub sleeps: u32,
    /// The beginning, ns of `CLOCK_MONOTONIC`.
    pub begin_ns: u64,
    /// The end.
    pub end_ns: u64,
}

/// The current time, ns of `CLOCK_MONOTONIC`, which all processes of a machine share.
pub fn now_ns() -> u64 {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::Monotonic);
    now.tv_sec.unsigned_abs() * 1_000_000_000 + now.tv_nsec.unsigned_abs()
}

/// The core that this thread runs on.
pub fn core() -> u32 {
    rustix::thread::sched_getcpu() as u32
}
