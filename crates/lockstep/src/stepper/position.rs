//! Whether a position belongs to a participant.

use super::PositionError;
use crate::plan::{Assignment, Position};

impl Position {
    pub(super) fn check(&self, assignment: &Assignment) -> Result<(), PositionError> {
        let (next, activations) = (self.next, assignment.activations);
        if next > activations {
            return Err(PositionError::Beyond { next, activations });
        }
        let interface = &assignment.interface;
        let ports = [
            ("inputs", self.inputs.len(), interface.inputs.len()),
            ("outputs", self.outputs.len(), interface.outputs.len()),
        ];
        for (what, given, own) in ports {
            if given != own {
                return Err(PositionError::Ports { what, given, own });
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
