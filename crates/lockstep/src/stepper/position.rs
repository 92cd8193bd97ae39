//! Whether a position fits a participant, and bringing a participant to a position.

use std::panic::{AssertUnwindSafe, catch_unwind};

use super::PositionError;
use crate::panic::message;
use crate::participant::{Log, Outputs, Participant};
use crate::plan::{Assignment, Position};

/// Prepares a participant to resume at `t` seconds, with this state or the one it has. A `fresh` one is initialised there first; its
/// outputs are then not published, because that instant has its samples already. Its log lines go to `log`.
///
/// # Errors
/// What the participant reports, or its panic.
pub fn prepare_to_resume(
    participant: &mut dyn Participant,
    t: f64,
    fresh: bool,
    state: Option<&[u8]>,
    log: &Log,
) -> Result<(), PositionError> {
    let work = || {
        if fresh {
            let mut unread = Outputs::zeroed(&participant.interface());
            unread.log = log.clone().at(t);
            participant
                .initialise(t, &mut unread)
                .map_err(|error| PositionError::Initialise(error.to_string()))?;
        }
        match state {
            Some(state) => participant
                .restore(state)
                .map_err(|error| PositionError::State(error.to_string())),
            None => Ok(()),
        }
    };
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| Err(PositionError::Panic(message(&*panic))))
}

impl Position {
    pub(super) fn check(&self, assignment: &Assignment) -> Result<(), PositionError> {
        let (next, activations) = (self.next, assignment.activations);
        if next > activations {
            return Err(PositionError::Beyond { next, activations });
        }
        let interface = &assignment.interface;
        let ports = [
            ("links", self.inputs.len(), assignment.inputs.len()),
            ("inputs", self.values.len(), interface.inputs.len()),
            ("outputs", self.outputs.len(), interface.outputs.len()),
        ];
        for (what, given, own) in ports {
            if given != own {
                return Err(PositionError::Ports { what, given, own });
            }
        }
        for (number, (value, port)) in self.values.iter().zip(&interface.inputs).enumerate() {
            let (port, given, own) = (port.name.clone(), value.len(), port.descriptor.size as usize);
            let fed = assignment.inputs.iter().any(|link| link.input as usize == number);
            match given {
                0 => {}
                _ if fed => return Err(PositionError::Fed { port }),
                size if size == own => {}
                _ => return Err(PositionError::Value { port, given, own }),
            }
        }
        for (bytes, port) in self.outputs.iter().zip(&interface.outputs) {
            let (given, own) = (bytes.len(), port.descriptor.size as usize);
            if given != own && given != 0 {
                let port = port.name.clone();
                return Err(PositionError::Size { port, given, own });
            }
        }
        Ok(())
    }
}
