//! Spans: what a participant did in a stretch of wall time, for whoever asks where the time goes.
//!
//! Nothing of a run depends on them, and nothing of them is on the tape. They are made only where somebody asked.

use serde::{Deserialize, Serialize};

/// The environment variable that asks a participant's process for spans: `steps`, or `waits` for waits too.
pub const SPANS: &str = "ESCAPEMENT_SPANS";

/// How much is wanted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Detail {
    /// Steps alone.
    Steps,
    /// Steps, and what was waited for between them.
    Waits,
}

impl Detail {
    /// The word in [`SPANS`].
    pub fn word(self) -> &'static str {
        match self {
            Detail::Steps => "steps",
            Detail::Waits => "waits",
        }
    }

    /// What a word in [`SPANS`] asks for; a word that is not known asks for nothing.
    pub fn of(word: &str) -> Option<Detail> {
        [Detail::Steps, Detail::Waits]
            .into_iter()
            .find(|detail| detail.word() == word)
    }
}

/// What a participant does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Doing {
    /// It reads inputs, steps, records and sends. A step that has to wait for room has several such spans, and is complete at the end of
    /// the last one.
    Computing {
        /// Whether the step is complete.
        done: bool,
    },
    /// It waits for sample `index` of the link number `link` of those into it.
    Sample {
        /// The link.
        link: u32,
        /// The sample.
        index: u64,
    },
    /// It waits for room on the way to consumer `consumer` of output `output`.
    Room {
        /// The output.
        output: u32,
        /// The consumer's position among those of the output.
        consumer: u32,
    },
    /// It waits for room in the recording.
    Recorder,
    /// It waits for the horizon: everything before it is done.
    Horizon,
}

/// A stretch of wall time of one participant.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Span {
    /// The activation that it belongs to, or that comes next.
    pub activation: u64,
    /// What it did.
    pub doing: Doing,
    /// The core at the end.
    pub core: u32,
    /// How often it slept, and was woken or woke up by itself.
    pub sleeps: u32,
    /// The beginning, ns of `CLOCK_MONOTONIC`.
    pub begin_ns: u64,
    /// The end.
    pub end_ns: u64,
}

/// Now, ns of `CLOCK_MONOTONIC`, which all processes of a machine share.
pub fn now_ns() -> u64 {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::Monotonic);
    now.tv_sec.unsigned_abs() * 1_000_000_000 + now.tv_nsec.unsigned_abs()
}

/// The core that this thread runs on.
pub fn core() -> u32 {
    rustix::thread::sched_getcpu() as u32
}
