//! The autopilot: follows the speed from which a constant deceleration comes to rest just above the ground.

use escapement::lockstep::units::{self, Acceleration, PerTime, Quantity, Speed};
use escapement::prelude::*;
use serde::Deserialize;

use crate::lander::GRAVITY;
use crate::messages::{Command, Motion};

/// The table `parameters` of an autopilot.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Parameters {
    deceleration: Quantity<Acceleration>,
    touchdown: Quantity<Speed>,
    gain: Quantity<PerTime>,
}

struct Autopilot {
    deceleration: f64,
    touchdown: f64,
    gain: f64,
}

/// Makes an autopilot.
pub fn make(setup: &Setup) -> Result<Box<dyn Participant>, ParameterError> {
    let parameters: Parameters = units::read(&setup.parameters)?;
    Ok(Box::new(Autopilot {
        deceleration: parameters.deceleration.si(),
        touchdown: parameters.touchdown.si(),
        gain: parameters.gain.si(),
    }))
}

impl Participant for Autopilot {
    fn interface(&self) -> Interface {
        Interface::new(Kind::Sampled)
            .input::<Motion>("motion")
            .output::<Command>("command")
    }

    fn initialise(&mut self, _t: f64, _outputs: &mut Outputs) -> Result<(), Failure> {
        Ok(())
    }

    fn step(&mut self, _step: &Step, inputs: &Inputs, outputs: &mut Outputs) -> Result<(), Failure> {
        let motion = inputs.get::<Motion>(0);
        let wanted = -(2.0 * self.deceleration * motion.height.max(0.0)).sqrt() - self.touchdown;
        let acceleration = self.deceleration + self.gain * (wanted - motion.velocity);
        outputs.get_mut::<Command>(0).thrust = motion.mass * (GRAVITY + acceleration);
        Ok(())
    }

    fn save(&self) -> Option<Vec<u8>> {
        // It has no state.
        Some(Vec::new())
    }

    fn restore(&mut self, state: &[u8]) -> Result<(), Failure> {
        if state.is_empty() {
            Ok(())
        } else {
            Err(format!("an autopilot has no state, not {} bytes of it", state.len()).into())
        }
    }
}
