//! The lander: a point mass over a flat moon whose engine uses propellant.

use escapement::lockstep::units::{self, Force, Length, Mass, Quantity, Speed};
use escapement::prelude::*;
use serde::Deserialize;

use crate::messages::{Command, Motion};

/// Of the Moon at its surface, m/s².
pub const GRAVITY: f64 = 1.62;
/// Of a storable bipropellant engine, m/s.
const EXHAUST_SPEED: f64 = 3050.0;

/// The table `parameters` of a lander.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Parameters {
    height: Quantity<Length>,
    velocity: Quantity<Speed>,
    mass: Quantity<Mass>,
    dry_mass: Quantity<Mass>,
    thrust_max: Quantity<Force>,
}

struct Lander {
    motion: Motion,
    dry_mass: f64,
    thrust_max: f64,
}

/// Makes a lander.
pub fn make(setup: &Setup) -> Result<Box<dyn Participant>, ParameterError> {
    let parameters: Parameters = units::read(&setup.parameters)?;
    let (mass, dry_mass) = (parameters.mass.si(), parameters.dry_mass.si());
    if !(dry_mass > 0.0 && mass >= dry_mass) {
        let reason = format!("{dry_mass} kg is not between zero and the mass of {mass} kg");
        return Err(ParameterError::new("dry_mass", reason));
    }
    Ok(Box::new(Lander {
        motion: Motion {
            height: parameters.height.si(),
            velocity: parameters.velocity.si(),
            mass,
            touchdown_speed: 0.0,
        },
        dry_mass,
        thrust_max: parameters.thrust_max.si(),
    }))
}

impl Participant for Lander {
    fn interface(&self) -> Interface {
        Interface::new(Kind::Continuous)
            .input::<Command>("command")
            .output::<Motion>("motion")
    }

    fn initialise(&mut self, _t: f64, outputs: &mut Outputs) -> Result<(), Failure> {
        *outputs.get_mut(0) = self.motion;
        Ok(())
    }

    fn step(&mut self, step: &Step, inputs: &Inputs, outputs: &mut Outputs) -> Result<(), Failure> {
        let asked = inputs.get::<Command>(0).thrust.clamp(0.0, self.thrust_max);
        let motion = &mut self.motion;
        if motion.touchdown_speed == 0.0 {
            let thrust = if motion.mass > self.dry_mass { asked } else { 0.0 };
            motion.mass = (motion.mass - step.period * thrust / EXHAUST_SPEED).max(self.dry_mass);
            motion.velocity += step.period * (thrust / motion.mass - GRAVITY);
            motion.height += step.period * motion.velocity;
            if motion.height <= 0.0 {
                motion.touchdown_speed = motion.velocity.abs();
                (motion.height, motion.velocity) = (0.0, 0.0);
            }
        }
        *outputs.get_mut(0) = *motion;
        Ok(())
    }

    fn save(&self) -> Option<Vec<u8>> {
        let Motion {
            height,
            velocity,
            mass,
            touchdown_speed,
        } = self.motion;
        Some([height, velocity, mass, touchdown_speed].map(f64::to_le_bytes).concat())
    }

    fn restore(&mut self, state: &[u8]) -> Result<(), Failure> {
        let (numbers, rest) = state.as_chunks::<8>();
        let &[height, velocity, mass, touchdown_speed] = numbers else {
            return Err(format!("a state of a lander is four numbers, not {} bytes", state.len()).into());
        };
        if !rest.is_empty() {
            return Err(format!("{} bytes too many for the state of a lander", rest.len()).into());
        }
        let [height, velocity, mass, touchdown_speed] =
            [height, velocity, mass, touchdown_speed].map(f64::from_le_bytes);
        self.motion = Motion {
            height,
            velocity,
            mass,
            touchdown_speed,
        };
        Ok(())
    }
}
