//! Why a set of participants and links is not a plan.

use std::fmt;

use crate::link::TimingError;
use crate::participant::InterfaceError;
use crate::time::{Rational, TickError};

/// One reason why a run cannot be planned. A scenario with several mistakes yields all of them at once.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PlanError {
    /// A run without participants.
    #[error("there are no participants")]
    Empty,
    /// Too many participants.
    #[error("{0} participants; at most {max} are allowed", max = super::limits::PARTICIPANTS_MAX)]
    TooMany(usize),
    /// Two participants or two links with the same name.
    #[error("the name `{0}` is used twice")]
    NameTwice(String),
    /// A name that cannot be part of a file name.
    #[error("`{0}` is not a name: use up to 64 letters, digits, `_` and `-`, starting with a letter")]
    Name(String),
    /// A period that is not positive.
    #[error("participant `{participant}`: the period is {period}; it must be positive")]
    Period {
        /// The participant.
        participant: String,
        /// Its period.
        period: Rational,
    },
    /// A first activation before the start.
    #[error("participant `{participant}`: the offset is {offset}; it must not be negative")]
    Offset {
        /// The participant.
        participant: String,
        /// Its offset.
        offset: Rational,
    },
    /// A run that ends before it starts.
    #[error("the duration is {0}; it must be positive")]
    Duration(Rational),
    /// The times have no common tick.
    #[error(transparent)]
    Ticks(#[from] TickError),
    /// The interface that a participant reports is invalid.
    #[error("participant `{participant}`: {source}")]
    Interface {
        /// The participant.
        participant: String,
        /// What is wrong.
        source: InterfaceError,
    },
    /// A link names a participant or port that does not exist.
    #[error("connection `{link}`: there is no {what} `{name}`; there is {known}")]
    Unknown {
        /// The link.
        link: String,
        /// `participant`, `output of …`, `input of …`.
        what: String,
        /// What was written.
        name: String,
        /// The names that exist.
        known: String,
    },
    /// The ports at the two ends do not match.
    #[error(
        "connection `{link}`: `{from}` does not fit `{to}`: {difference}; connect ports of one description, or say which fields belong \
         together: map = {{ INPUT-FIELD = \"OUTPUT-FIELD\", … }}"
    )]
    Mismatch {
        /// The link.
        link: String,
        /// The output.
        from: String,
        /// The input.
        to: String,
        /// The first difference.
        difference: String,
    },
    /// An input with two sources.
    #[error("the input `{input}` is fed twice, by connections `{first}` and `{second}`: remove one")]
    FedTwice {
        /// The input.
        input: String,
        /// The first link.
        first: String,
        /// The second link.
        second: String,
    },
    /// An element of an input that has two sources, not both of which are added.
    #[error(
        "`{input}` is fed twice, by connections `{first}` and `{second}`: remove one, or write sum = true in both to add them up"
    )]
    FieldFedTwice {
        /// The input with the element.
        input: String,
        /// The first link.
        first: String,
        /// The second link.
        second: String,
    },
    /// An input that must be fed in full, but has fields without a source.
    #[error(
        "the input `{input}` is not fed in full: {} is missing; add to a map a field for it or a number that it always is, such as \
         map = {{ \"{}\" = 0 }}, or a connection with to = \"{input}.{}\"",
        .fields.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", "), .fields[0], .fields[0]
    )]
    FieldsNotFed {
        /// The input.
        input: String,
        /// The fields and elements that are missing, at least one.
        fields: Vec<String>,
    },
    /// A required input without a source.
    #[error("the input `{input}` is not connected: add a connection with to = \"{input}\" from an output of type {message}{}", hint(.candidates))]
    NotConnected {
        /// The input.
        input: String,
        /// The message type it takes.
        message: String,
        /// The outputs that match.
        candidates: Vec<String>,
    },
    /// A link's timing is invalid.
    #[error("connection `{link}`: {source}")]
    Timing {
        /// The link.
        link: String,
        /// What is wrong.
        source: TimingError,
    },
    /// A fault that is not possible.
    #[error("fault `{fault}`: {reason}")]
    Fault {
        /// The fault.
        fault: String,
        /// What is wrong with it.
        reason: String,
    },
    /// An initial value of the wrong size.
    #[error("connection `{link}`: the initial value has {given} bytes; the message has {needed}")]
    InitialSize {
        /// The link.
        link: String,
        /// Bytes given.
        given: usize,
        /// Bytes needed.
        needed: usize,
    },
    /// The first sample of an output that is computed from inputs cannot exist before the run starts.
    #[error(
        "connection `{link}`: initial = \"first-sample\" needs an output that exists before the run starts, but `{from}` is \
         computed from its inputs: give an initial value instead"
    )]
    FirstSample {
        /// The link.
        link: String,
        /// The output.
        from: String,
    },
    /// The first sample of an output that starts later than its consumer.
    #[error(
        "connection `{link}`: initial = \"first-sample\", but `{from}` starts at {starts}, after its reader at {reads}: give an \
         initial value or move the offset"
    )]
    FirstSampleLate {
        /// The link.
        link: String,
        /// The output.
        from: String,
        /// When it starts.
        starts: Rational,
        /// When the consumer starts.
        reads: Rational,
    },
    /// The delay covers more samples than a link may hold.
    #[error("connection `{link}`: {samples} samples would be in flight; at most {max} are allowed: shorten {longest}", max = super::limits::CAPACITY_MAX)]
    Capacity {
        /// The link.
        link: String,
        /// Samples in flight.
        samples: u128,
        /// The longest part of the delay.
        longest: DelayPart,
    },
    /// A cycle of zero-delay links with direct feedthrough.
    #[error(
        "algebraic loop at t = {t}: {members}. Every member needs the output of the one before it at the same instant. \
         A delay on any one of these connections breaks the loop: {links}"
    )]
    AlgebraicLoop {
        /// The first instant at which all members are activated.
        t: String,
        /// The members in order, `a -> b -> a`.
        members: String,
        /// The connections in order.
        links: String,
    },
    /// The search for loops was abandoned.
    #[error(
        "the zero-delay connections between sampled participants have too many cycles to check: give some of them a delay"
    )]
    TooManyCycles,
}

fn hint(candidates: &[String]) -> String {
    if candidates.is_empty() {
        String::new()
    } else {
        format!(", such as {}", candidates.join(" or "))
    }
}

/// A part of the largest delay of a link.
#[derive(Debug, Clone, PartialEq)]
pub enum DelayPart {
    /// The fixed delay.
    Delay(Rational),
    /// The jitter.
    Jitter(Rational),
    /// The extra delay of a link fault.
    Fault {
        /// The fault.
        name: String,
        /// Its extra delay.
        extra: Rational,
    },
}

impl DelayPart {
    /// How long it is.
    pub fn time(&self) -> Rational {
        match self {
            DelayPart::Delay(time) | DelayPart::Jitter(time) | DelayPart::Fault { extra: time, .. } => *time,
        }
    }
}

impl fmt::Display for DelayPart {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            DelayPart::Delay(time) => write!(f, "its delay of {time}"),
            DelayPart::Jitter(time) => write!(f, "its jitter of {time}"),
            DelayPart::Fault { name, extra } => write!(f, "the extra delay of {extra} of the fault `{name}`"),
        }
    }
}
