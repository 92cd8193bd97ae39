//! The ends of a stepper's links, its progress, and what it waits for.

use crate::participant::{Failure, Step};
use crate::time::{SampleTime, Timebase};
use crate::transport::{Receiver, Recording, Sender};

/// What a stepper needs to continue.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wait {
    /// Sample `index` of a link that feeds an input.
    Sample {
        /// The link's position in the assignment.
        input: usize,
        /// The sample.
        index: u64,
    },
    /// Room on the link to consumer `consumer` of output `output`.
    Room {
        /// The output.
        output: usize,
        /// The consumer's position among those of the output.
        consumer: usize,
    },
    /// Room in the recording.
    Recording,
}

/// The progress made by a call of [`Stepper::poll`](super::Stepper::poll).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Progress {
    /// One activation is complete: stepped, recorded and published.
    Stepped,
    /// The next activation lies at or past the horizon; everything before it is complete and published.
    AtHorizon,
    /// All activations are complete and published.
    Finished,
    /// The participant has its inputs, and is paused before its step: see [`Stepper::pause_before_step`](super::Stepper::pause_before_step).
    BeforeStep,
    /// The stepper needs something first.
    Waiting(Wait),
    /// The step is to be executed together with others: see [`Stepper::defer_steps`](super::Stepper::defer_steps). Never returned without
    /// that call.
    Deferred,
}

/// The ends of the links of one participant, in the order of its assignment.
pub struct LinkEnds {
    /// One receiver per link that feeds an input.
    pub receivers: Vec<Box<dyn Receiver>>,
    /// One sender per consumer of each output.
    pub senders: Vec<Vec<Box<dyn Sender>>>,
    /// The connection to the tape.
    pub recording: Box<dyn Recording>,
}

/// External requests to a stepper, and whether its participant is to be notified of the end.
#[derive(Debug, Default)]
pub(super) struct Requests {
    /// Whether the participant has begun, has not panicked, and is to be notified when its part is over.
    pub(super) notify_termination: bool,
    /// The first activation before whose step the participant is paused; it is then paused before each one.
    pub(super) pause_from: Option<u64>,
    /// Whether the outputs of the current activation were provided from outside.
    pub(super) outputs_provided: bool,
}

/// The phase of the work on an activation. It is written where the work stops or changes, not for every link and output: what is written
/// in parts and read at once has to wait for every write before it, also for those to lines of shared memory that another core has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Phase {
    /// The outputs for the first instant have not been written.
    Initialise,
    /// Between activations.
    Idle,
    /// Getting the sample of this link.
    Gather { input: usize },
    /// The inputs are complete, as the participant sees them.
    Ready,
    /// All inputs have been received; the caller executes the step.
    Deferred,
    /// Appending this output to the tape.
    Record { output: usize },
    /// Appending to the tape the value that an input had, where a fault may have changed it.
    RecordInputs { seen: usize },
    /// Sending this output to its consumers.
    Publish { output: usize },
}

/// A step that the caller executes.
#[derive(Default)]
pub(super) struct DeferredStep {
    /// Whether steps are left to the caller at all.
    pub(super) wanted: bool,
    pub(super) result: Option<Result<(), Failure>>,
}

/// What is known of the activation before activation `next`: its end. There is none before the first.
pub(super) fn step_before(next: u64, sample_time: SampleTime, timebase: Timebase) -> Step {
    Step {
        index: next.wrapping_sub(1),
        t: f64::NAN,
        t_next: timebase.seconds(sample_time.instant(next)),
        period: timebase.seconds(sample_time.period),
    }
}
