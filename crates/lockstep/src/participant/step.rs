//! The instant of a step, and its failure.

use std::error::Error;

/// Why a participant failed; the text reaches the user, so it should name the quantity, its value and the remedy.
pub type Failure = Box<dyn Error + Send + Sync>;

/// The instant of an activation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// The number of the activation, from 0.
    pub index: u64,
    /// Its instant t_k: the double nearest to offset + k period, s.
    pub t: f64,
    /// The instant t_{k+1}, s.
    pub t_next: f64,
    /// The period, s: the double nearest to the exact value, not `t_next - t`.
    pub period: f64,
}
