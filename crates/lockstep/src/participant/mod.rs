//! Participants: models that own their state and interact with the rest of the run only at communication points.

mod batch;
mod buffers;
mod handles;
mod interface;
mod log;
pub mod state;
mod step;
mod termination;

use std::sync::Arc;

pub use batch::{BatchStepper, BatchedStep, Member, PendingStep, StepBatch};
pub(crate) use buffers::ValueCheck;
pub use buffers::{Inputs, Outputs, Payload};
pub use handles::{InputPort, OutputPort, Ports};
pub use interface::{Input, Interface, InterfaceError, Kind, Output};
pub use log::{Line, Log, Sink};
pub use step::{Failure, Step};
pub use termination::Termination;

/// A parameter that a participant rejects.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{key}`: {reason}")]
pub struct ParameterError {
    /// The key below the participant's `parameters`, dotted; empty when the error concerns all of them.
    pub key: String,
    /// What is wrong, with the value and the remedy.
    pub reason: String,
}

impl ParameterError {
    /// Rejects the parameter `key`.
    pub fn new(key: impl Into<String>, reason: impl ToString) -> ParameterError {
        ParameterError {
            key: key.into(),
            reason: reason.to_string(),
        }
    }
}

/// What a participant receives before it is created. Nothing else may influence it: no clock, no file, no environment.
#[derive(Debug, Clone)]
pub struct Setup {
    /// The participant's name in the scenario.
    pub name: String,
    /// The table `participants.NAME.parameters`, with file names replaced by the contents of the files.
    pub parameters: toml::Table,
    /// The seed of the run; random streams come from [`crate::random::Stream`] with this seed and a name.
    pub seed: u64,
    /// The sample period, s.
    pub period: f64,
    /// The instant of the first activation, s.
    pub offset: f64,
}

/// Creates a participant from its setup.
pub type Factory = Arc<dyn Fn(&Setup) -> Result<Box<dyn Participant>, ParameterError> + Send + Sync>;

/// A model that can be stepped.
///
/// `step` must be a function of the state, the step and the inputs alone, and must not allocate: it is on the path that limits the speed
/// of the whole run.
pub trait Participant: Send {
    /// The ports, in the order in which they are numbered.
    fn interface(&self) -> Interface;

    /// Called once before the first step. A [`Kind::Continuous`] participant writes its outputs for the instant of its first activation;
    /// a [`Kind::Sampled`] one has nothing to write yet. By default, outputs are zeros.
    fn initialise(&mut self, t: f64, outputs: &mut Outputs) -> Result<(), Failure> {
        let _ = (t, outputs);
        Ok(())
    }

    /// One activation. A sampled participant writes the outputs for `step.t`; a continuous one holds the inputs over
    /// the step and writes the outputs for `step.t_next`.
    fn step(&mut self, step: &Step, inputs: &Inputs, outputs: &mut Outputs) -> Result<(), Failure>;

    /// This participant as a member of a batch that is stepped by one call, if it supports that: see [`StepBatch`]. The answer must
    /// always be the same.
    fn batch_member(&mut self) -> Option<Member<'_>> {
        None
    }

    /// Called once when the participant's part in the run is over, before it is dropped: at the end of the run, also when the participant
    /// itself or another component has failed, and when another participant replaces it. Not called after a panic, nor for a participant
    /// that only reported its ports. `log` is the participant's log, for its last lines. By default, nothing is done.
    fn terminate(&mut self, why: Termination, log: &Log) {
        let _ = (why, log);
    }

    /// Returns the complete state as bytes, so that [`Participant::restore`] in another process continues to the last bit;
    /// [`state::to_bytes`] serialises them by serde. `None` when the participant cannot be saved.
    fn save(&self) -> Option<Vec<u8>> {
        None
    }

    /// Why the last call of [`Participant::save`] returned `None`, in the participant's own words, if it failed. `None`, as by default,
    /// when it did not fail, or when the participant has no state that could be saved at all.
    fn save_failure(&self) -> Option<String> {
        None
    }

    /// Restores a state that [`Participant::save`] returned. The bytes may come from a file: they must be checked, which
    /// [`state::from_bytes`] does.
    fn restore(&mut self, state: &[u8]) -> Result<(), Failure> {
        let _ = state;
        Err("this participant cannot restore a state".into())
    }
}

impl<P: Participant + ?Sized> Participant for Box<P> {
    fn interface(&self) -> Interface {
        (**self).interface()
    }

    fn initialise(&mut self, t: f64, outputs: &mut Outputs) -> Result<(), Failure> {
        (**self).initialise(t, outputs)
    }

    fn step(&mut self, step: &Step, inputs: &Inputs, outputs: &mut Outputs) -> Result<(), Failure> {
        (**self).step(step, inputs, outputs)
    }

    fn batch_member(&mut self) -> Option<Member<'_>> {
        (**self).batch_member()
    }

    fn terminate(&mut self, why: Termination, log: &Log) {
        (**self).terminate(why, log);
    }

    fn save(&self) -> Option<Vec<u8>> {
        (**self).save()
    }

    fn save_failure(&self) -> Option<String> {
        (**self).save_failure()
    }

    fn restore(&mut self, state: &[u8]) -> Result<(), Failure> {
        (**self).restore(state)
    }
}
