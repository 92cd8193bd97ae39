//! Why a participant's process ends early.

use crate::stepper::StepError;
use crate::transport::TransportError;
use crate::transport::iceoryx::DomainError;

/// Why a participant's process ends early.
#[derive(Debug, thiserror::Error)]
pub enum HostError {
    /// The run's shared memory cannot be entered.
    #[error(transparent)]
    Domain(#[from] DomainError),
    /// A service broke.
    #[error("{0}")]
    Broken(#[from] TransportError),
    /// The kernel refused to bind this process's lifetime to its orchestrator.
    #[error("cannot be tied to the orchestrator's life: {0}")]
    Orphan(String),
    /// The participant's own step, or the protocol, failed.
    #[error("activation {activation} at t = {t} s: {source}")]
    Step {
        /// The activation.
        activation: u64,
        /// Its instant, s.
        t: f64,
        /// Why.
        source: StepError,
    },
}
