//! What a stepper is given, how far it came, and what it waits for.

use crate::link::Read;
use crate::participant::{Failure, Step};
use crate::transport::{Receiver, Recording, Sender};

/// What a stepper cannot go on without.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wait {
    /// Sample `index` of a link that feeds an input.
    Sample {
        /// The link's position in the assignment.
        input: usize,
        /// The sample.
        index: u64,
    },
    /// Room on the way to consumer `consumer` of output `output`.
    Room {
        /// The output.
        output: usize,
        /// The consumer's position among those of the output.
        consumer: usize,
    },
    /// Room in the recording.
    Recording,
}

/// How far a call of [`Stepper::poll`](super::Stepper::poll) came.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Progress {
    /// One activation is complete: stepped, recorded and published.
    Stepped,
    /// The next activation lies at or past the horizon; everything before it is complete and handed over.
    AtHorizon,
    /// All activations are complete and handed over.
    Finished,
    /// It has its inputs, and is held before its step: see [`Stepper::hold`](super::Stepper::hold).
    Held,
    /// It needs something first.
    Waiting(Wait),
    /// Its step is to be done beside others: see [`Stepper::park`](super::Stepper::park). Without that it never says so.
    Parked,
}

/// The ends of the links of one participant, in the order of its assignment.
pub struct Ends {
    /// One receiver per link that feeds an input.
    pub receivers: Vec<Box<dyn Receiver>>,
    /// One sender per consumer of each output.
    pub senders: Vec<Vec<Box<dyn Sender>>>,
    /// The way to the tape.
    pub recording: Box<dyn Recording>,
}

/// What is asked of a stepper from outside, and whether its participant is to be told of the end.
#[derive(Debug, Default)]
pub(super) struct Orders {
    /// Whether the participant has begun, has not panicked, and is to be told when its part is over.
    pub(super) begun: bool,
    /// The activation from which on it is held before each step.
    pub(super) hold: Option<u64>,
    /// Whether the outputs of the activation under way were given from outside.
    pub(super) answered: bool,
}

/// Where the work on an activation stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Phase {
    /// The outputs for the first instant have not been made.
    Initialise,
    /// Between activations.
    Rest,
    /// Getting the sample of this link; what it reads is asked once.
    Gather { input: usize, read: Option<Read> },
    /// The inputs are there as the participant sees them.
    Ready,
    /// Everything has come in; the step is done by others.
    Parked,
    /// Putting this output on the tape.
    Record { output: usize },
    /// Putting on the tape what an input has shown, where a fault may have changed it.
    Look { seen: usize },
    /// Sending this output to this consumer.
    Publish { output: usize, consumer: usize },
}

/// Where a step stands that others do.
#[derive(Default)]
pub(super) struct Parked {
    /// Whether steps are done by others at all.
    pub(super) wanted: bool,
    pub(super) step: Option<Step>,
    pub(super) result: Option<Result<(), Failure>>,
}
