//! Faults as the scenario declares them.

use serde::{Deserialize, Serialize};

use super::slots::Slot;
use crate::time::Rational;

/// When a fault is there: from `at` on and before `until`; to the end of the run without it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Span {
    /// The first instant with the fault.
    pub at: Rational,
    /// The first instant without it.
    pub until: Option<Rational>,
}

/// Something is wrong with a link for samples that are stamped within the span.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LinkFault {
    /// The name, unique in the run; the draws are named after it.
    pub name: String,
    /// The stamps that it concerns.
    pub span: Span,
    /// The probability in [0, 1] that a sample never arrives, besides what the link drops anyway.
    pub drop: f64,
    /// How much later a sample is visible, s.
    pub extra_delay: Rational,
    /// In words, for events and drawings.
    pub words: String,
}

/// Where a signal is disturbed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Place {
    /// At a participant's input, in its activations within the span: nobody else sees it.
    Input {
        /// The participant.
        participant: usize,
        /// The input.
        port: usize,
    },
    /// At a participant's output, in its samples stamped within the span: all readers see the same.
    Output {
        /// The participant.
        participant: usize,
        /// The output.
        port: usize,
    },
}

/// What is done to the chosen elements. Values are in the units of the descriptor, one per element.
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
    /// With this probability zero, all elements at once.
    Dropout(f64),
    /// With this probability, one bit of one element is turned over; the element is drawn, and so is the bit unless it is
    /// given (0 is the least).
    BitFlip {
        /// The bit.
        bit: Option<u32>,
        /// How likely it is for each index.
        probability: f64,
    },
}

/// Something is wrong with the values of a signal.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SignalFault {
    /// The name, unique in the run; the draws are named after it.
    pub name: String,
    /// Where.
    pub place: Place,
    /// When.
    pub span: Span,
    /// The elements of the payload.
    pub slots: Vec<Slot>,
    /// What.
    pub effect: Effect,
    /// In words, for events and drawings.
    pub words: String,
}
