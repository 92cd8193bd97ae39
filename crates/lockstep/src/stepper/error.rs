//! Why a participant's activation failed.

use crate::participant::Failure;
use crate::transport::TransportError;

/// Why an activation cannot be completed. The error names the component at fault.
#[derive(Debug, thiserror::Error)]
pub enum StepError {
    /// The participant itself reported a failure.
    #[error("{0}")]
    Failed(Failure),
    /// The participant panicked.
    #[error("it panicked: {0}")]
    Panicked(String),
    /// The participant wrote a NaN, an infinity, or a byte that is not a valid truth value or value of the enumeration.
    #[error("its output `{port}` has {what}")]
    Invalid {
        /// The output.
        port: String,
        /// The element, its value and what it must be.
        what: String,
    },
    /// A received sample violates the protocol.
    #[error("`{from}` sent {what}")]
    BadSample {
        /// The output that sent it.
        from: String,
        /// What was wrong with it.
        what: String,
    },
    /// A link or the recording broke.
    #[error("the way {way} broke: {source}")]
    Broken {
        /// `from X`, `to Y` or `to the recorder`.
        way: String,
        /// What happened.
        source: TransportError,
    },
}

/// Why a position is rejected: it comes from another process or from a file.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum PositionError {
    /// More activations than the run has.
    #[error("the position is at activation {next}; the participant has {activations}")]
    Beyond {
        /// The activation at which it continues.
        next: u64,
        /// How many activations the run has.
        activations: u64,
    },
    /// The number of ports differs.
    #[error("the position has {given} {what}; the participant has {own}")]
    Ports {
        /// `links`, `inputs` or `outputs`.
        what: &'static str,
        /// In the position.
        given: usize,
        /// In the participant.
        own: usize,
    },
    /// The size of an output differs.
    #[error("the position has {given} bytes for output `{port}`, which has {own}")]
    Size {
        /// The output.
        port: String,
        /// In the position.
        given: usize,
        /// In the participant.
        own: usize,
    },
    /// The size of a value for an input without a link differs.
    #[error("the position has a value of {given} bytes for input `{port}`, which has {own}")]
    Value {
        /// The input.
        port: String,
        /// In the position.
        given: usize,
        /// In the participant.
        own: usize,
    },
    /// A value for an input that has a link.
    #[error("the position has a value for input `{port}`, which a link feeds")]
    Fed {
        /// The input.
        port: String,
    },
    /// The participant cannot be initialised.
    #[error("it cannot be initialised: {0}")]
    Initialise(String),
    /// The participant rejects the state.
    #[error("it cannot take the state: {0}")]
    State(String),
    /// The participant panicked during initialisation or restore.
    #[error("it panicked: {0}")]
    Panic(String),
}
