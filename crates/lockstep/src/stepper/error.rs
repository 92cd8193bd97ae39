//! Why a participant's activation failed.

use crate::participant::Failure;
use crate::transport::Broken;

/// Why an activation cannot be completed. Whoever is to blame is named.
#[derive(Debug, thiserror::Error)]
pub enum StepError {
    /// The participant itself gave up.
    #[error("{0}")]
    Failed(Failure),
    /// The participant panicked.
    #[error("it panicked: {0}")]
    Panicked(String),
    /// The participant wrote a NaN, an infinity, or a byte that is no value of a truth value or an enumeration.
    #[error("its output `{port}` has {what}")]
    Invalid {
        /// The output.
        port: String,
        /// The element, its value and what it must be.
        what: String,
    },
    /// A sample that came in breaks the protocol.
    #[error("`{from}` sent {what}")]
    BadSample {
        /// The output it came from.
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
        source: Broken,
    },
}

/// Why a position cannot be taken up: it comes from another process or from a file.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum PositionError {
    /// More activations than the run has.
    #[error("the position is at activation {next}; the participant has {activations}")]
    Beyond {
        /// Where it is to go on.
        next: u64,
        /// How many there are.
        activations: u64,
    },
    /// For another number of ports.
    #[error("the position has {given} {what}; the participant has {own}")]
    Ports {
        /// `links`, `inputs` or `outputs`.
        what: &'static str,
        /// In the position.
        given: usize,
        /// In the participant.
        own: usize,
    },
    /// An output of another size.
    #[error("the position has {given} bytes for output `{port}`, which has {own}")]
    Size {
        /// The output.
        port: String,
        /// In the position.
        given: usize,
        /// In the participant.
        own: usize,
    },
    /// A value of another size for an input that has no link.
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
    /// It cannot be initialised.
    #[error("it cannot be initialised: {0}")]
    Initialise(String),
    /// It does not take the state.
    #[error("it cannot take the state: {0}")]
    State(String),
    /// It panicked over that.
    #[error("it panicked: {0}")]
    Panic(String),
}
