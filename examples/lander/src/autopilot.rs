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
    ports: Ports,
    motion: InputPort<Motion>,
    command: OutputPort<Command>,
    deceleration: f64,
    touchdown: f64,
    gain: f64,
}

/// Creates an autopilot.
pub fn make(setup: &Setup) -> Result<Box<dyn Participant>, ParameterError> {
    let parameters: Parameters = units::read(&setup.parameters)?;
    let mut ports = Ports::new(Kind::Sampled);
    Ok(Box::new(Autopilot {
        motion: ports.input("motion"),
        command: ports.output("command"),
        ports,
        deceleration: parameters.deceleration.si(),
        touchdown: parameters.touchdown.si(),
        gain: parameters.gain.si(),
    }))
}

impl Participant for Autopilot {
    fn interface(&self) -> Interface {
        self.ports.interface()
    }

    fn step(&mut self, _step: &Step, inputs: &Inputs, outputs: &mut Outputs) -> Result<(), Failure> {
        let motion = &inputs[self.motion];
        let wanted = -(2.0 * self.deceleration * motion.height.max(0.0)).sqrt() - self.touchdown;
        let acceleration = self.deceleration + self.gain * (wanted - motion.velocity);
        outputs[self.command].thrust = motion.mass * (GRAVITY + acceleration);
        Ok(())
    }

    fn save(&self) -> Option<Vec<u8>> {
        // It has no state.
        state::to_bytes(&())
    }

    fn restore(&mut self, bytes: &[u8]) -> Result<(), Failure> {
        state::from_bytes(bytes)
    }
}
