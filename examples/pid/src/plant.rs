//! A mass on a spring with a damper, pushed by a force.

use lockstep::participant::{Failure, Inputs, Interface, Kind, Outputs, ParameterError, Participant, Setup, Step};
use lockstep::units::{self, LinearDamping, LinearStiffness, Mass, Quantity};
use serde::Deserialize;

use crate::{Motion, Push};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Plant {
    mass: Quantity<Mass>,
    stiffness: Quantity<LinearStiffness>,
    damping: Quantity<LinearDamping>,
    #[serde(skip)]
    motion: (f64, f64),
}

/// Creates a plant at rest.
pub fn make(setup: &Setup) -> Result<Box<dyn Participant>, ParameterError> {
    Ok(Box::new(units::read::<Plant>(&setup.parameters)?))
}

impl Participant for Plant {
    fn interface(&self) -> Interface {
        Interface::new(Kind::Continuous)
            .input::<Push>("push")
            .output::<Motion>("motion")
    }

    fn initialise(&mut self, _t: f64, _outputs: &mut Outputs) -> Result<(), Failure> {
        Ok(())
    }

    fn step(&mut self, step: &Step, inputs: &Inputs, outputs: &mut Outputs) -> Result<(), Failure> {
        let (mut position, mut velocity) = self.motion;
        let force = inputs.get::<Push>(0).force - self.stiffness.si() * position - self.damping.si() * velocity;
        velocity += step.period * (force / self.mass.si());
        position += step.period * velocity;
        self.motion = (position, velocity);
        *outputs.get_mut(0) = Motion { position, velocity };
        Ok(())
    }

    fn save(&self) -> Option<Vec<u8>> {
        Some([self.motion.0.to_le_bytes(), self.motion.1.to_le_bytes()].concat())
    }

    fn restore(&mut self, state: &[u8]) -> Result<(), Failure> {
        let (position, velocity) = state.split_at_checked(8).ok_or("the state is too short")?;
        self.motion = (
            f64::from_le_bytes(position.try_into()?),
            f64::from_le_bytes(velocity.try_into()?),
        );
        Ok(())
    }
}
