//! The reference position: from rest to a height, without a jump in velocity.

use lockstep::participant::{Failure, Inputs, Interface, Kind, Outputs, ParameterError, Participant, Setup, Step};
use lockstep::units::{self, Length, Quantity, Time};
use serde::Deserialize;

use crate::Target;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Reference {
    height: Quantity<Length>,
    rise: Quantity<Time>,
}

/// Creates a reference.
pub fn make(setup: &Setup) -> Result<Box<dyn Participant>, ParameterError> {
    Ok(Box::new(units::read::<Reference>(&setup.parameters)?))
}

impl Participant for Reference {
    fn interface(&self) -> Interface {
        Interface::new(Kind::Sampled).output::<Target>("target")
    }

    fn initialise(&mut self, _t: f64, _outputs: &mut Outputs) -> Result<(), Failure> {
        Ok(())
    }

    fn step(&mut self, step: &Step, _inputs: &Inputs, outputs: &mut Outputs) -> Result<(), Failure> {
        let rise = self.rise.si();
        let part = if step.t < rise { step.t / rise } else { 1.0 };
        outputs.get_mut::<Target>(0).position = self.height.si() * part * part * (3.0 - 2.0 * part);
        Ok(())
    }

    fn save(&self) -> Option<Vec<u8>> {
        // There is no state.
        Some(Vec::new())
    }

    fn restore(&mut self, state: &[u8]) -> Result<(), Failure> {
        if state.is_empty() {
            Ok(())
        } else {
            Err(format!("a reference has no state, but {} bytes were given", state.len()).into())
        }
    }
}
