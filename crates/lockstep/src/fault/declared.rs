//! Faults as the scenario declares them.

use serde::{Deserialize, Serialize};

use super::slots::Slot;
use crate::time::Rational;

/// The time span of a fault: from `at` on and before `until`, or to the end of the run without `until`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct FaultWindow {
    /// The first instant with the fault.
    pub at: Rational,
    /// The first instant without it.
    pub until: Option<Rational>,
}

/// A fault of a link, for samples that are stamped within the span.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LinkFault {
    /// The name, unique in the run; it also names the random stream.
    pub name: String,
    /// The stamps that are affected.
    pub span: FaultWindow,
    /// The probability in [0, 1] that a sample never arrives, in addition to the link's own drops.
    pub drop: f64,
    /// The additional delay of a sample, s.
    pub extra_delay: Rational,
    /// A description, for events and drawings.
    pub description: String,
}

/// The port at which a signal fault acts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum FaultPort {
    /// At a participant's input, in its activations within the span: no other participant sees it.
    Input {
        /// The participant.
        participant: usize,
        /// The input.
        port: usize,
    },
    /// At a participant's output, in its samples stamped within the span: all consumers see the same.
    Output {
        /// The participant.
        participant: usize,
        /// The output.
        port: usize,
    },
}

/// The effect on the chosen elements. Values are in the units of the descriptor, one per element.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Effect {
    /// x + amount.
    Bias(Vec<f64>),
    /// x · factor.
    Scale(Vec<f64>),
    /// x + rate · (t - at), with t in s.
    Ramp(Vec<f64>),
    /// x + sigma · a standard normal draw for each element and index.
    Noise(Vec<f64>),
    /// These values; without them, those of the first index within the span.
    Stuck(Option<Vec<f64>>),
    /// Zero with this probability, all elements at once.
    Dropout(f64),
    /// With this probability, one bit of one element is flipped; the element is drawn at random, and so is the bit unless it is given (0
    /// is the least significant).
    BitFlip {
        /// The bit.
        bit: Option<u32>,
        /// The probability for each index.
        probability: f64,
    },
}

/// A signal fault: it changes the values of a signal.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SignalFault {
    /// The name, unique in the run; it also names the random stream.
    pub name: String,
    /// The port.
    pub place: FaultPort,
    /// The time span.
    pub span: FaultWindow,
    /// The elements of the payload.
    pub slots: Vec<Slot>,
    /// The effect.
    pub effect: Effect,
    /// A description, for events and drawings.
    pub description: String,
}
