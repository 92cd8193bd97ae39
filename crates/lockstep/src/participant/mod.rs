//! Participants: models that own their state and meet the rest of the world only at communication points.

mod abreast;
mod buffers;
mod handles;
mod interface;
mod log;
pub mod state;
mod step;
mod termination;

use std::sync::Arc;

pub use abreast::{Abreast, Member, Pending, StepAbreast, Stride};
pub(crate) use buffers::ValueCheck;
pub use buffers::{Inputs, Outputs, Payload};
pub use handles::{InputPort, OutputPort, Ports};
pub use interface::{Input, Interface, InterfaceError, Kind, Output};
pub use log::{Line, Log, Sink};
pub use step::{Failure, Step};
pub use termination::Termination;

/// A parameter that a participant refuses.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{key}`: {reason}")]
pub struct ParameterError {
    /// The key below the participant's `parameters`, dotted; empty when it is about all of them.
    pub key: String,
    /// What is wrong, with the value and the remedy.
    pub reason: String,
}

impl ParameterError {
    /// A refusal of the parameter `key`.
    pub fn new(key: impl Into<String>, reason: impl ToString) -> ParameterError {
        ParameterError {
            key: key.into(),
            reason: reason.to_string(),
        }
    }
}

/// What a participant is told about itself before it is made. Nothing else may leak in: no clock, no file, no environment.
#[derive(Debug, Clone)]
pub struct Setup {
    /// The participant's name in the scenario.
    pub name: String,
    /// The table `participants.NAME.parameters`, with the contents of files in place of their names.
    pub parameters: toml::Table,
    /// The seed of the run; random streams come from [`crate::random::Stream`] with this seed and a name.
    pub seed: u64,
    /// The sample period, s.
    pub period: f64,
    /// The first activation, s.
    pub offset: f64,
}

/// Makes a participant from its setup.
pub type Factory = Arc<dyn Fn(&Setup) -> Result<Box<dyn Participant>, ParameterError> + Send + Sync>;

/// A model that can be stepped.
///
/// `step` must be a function of the state, the step and the inputs alone, and must not allocate: it is on the path that
/// decides how fast everybody runs.
pub trait Participant: Send {
    /// The ports, in the order in which they are numbered.
    fn interface(&self) -> Interface;

    /// Called once before the first step. A [`Kind::Continuous`] participant writes its outputs for the instant of its
    /// first activation; a [`Kind::Sampled`] one has nothing to write yet. Unless given: outputs are zeros.
    fn initialise(&mut self, t: f64, outputs: &mut Outputs) -> Result<(), Failure> {
        let _ = (t, outputs);
        Ok(())
    }

    /// One activation. A sampled participant writes the outputs for `step.t`; a continuous one holds the inputs over
    /// the step and writes the outputs for `step.t_next`.
    fn step(&mut self, step: &Step, inputs: &Inputs, outputs: &mut Outputs) -> Result<(), Failure>;

    /// This participant as one of several that are stepped at once, where it can be: see [`StepAbreast`]. It always gives the same
    /// answer.
    fn abreast(&mut self) -> Option<Member<'_>> {
        None
    }

    /// Called once when its part in the run is over, before it is dropped: at the end of the run, also when something has failed
    /// elsewhere or the participant itself, and when another one takes its place. Not called after a panic, nor for a participant that was only asked
    /// for its ports. `log` is its log; what it has to say further it says here. Unless given: nothing is done.
    fn terminate(&mut self, why: Termination, log: &Log) {
        let _ = (why, log);
    }

    /// The complete state as bytes, so that [`Participant::restore`] in another process continues to the last bit;
    /// [`state::to_bytes`] makes them by serde. `None` when the participant cannot be saved.
    fn save(&self) -> Option<Vec<u8>> {
        None
    }

    /// Takes over a state that [`Participant::save`] gave. The bytes may come from a file: they must be checked,
    /// which [`state::from_bytes`] does.
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

    fn abreast(&mut self) -> Option<Member<'_>> {
        (**self).abreast()
    }

    fn terminate(&mut self, why: Termination, log: &Log) {
        (**self).terminate(why, log);
    }

    fn save(&self) -> Option<Vec<u8>> {
        (**self).save()
    }

    fn restore(&mut self, state: &[u8]) -> Result<(), Failure> {
        (**self).restore(state)
    }
}
