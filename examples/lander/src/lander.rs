//! The lander: a point mass over a flat moon whose engine uses propellant.

use escapement::lockstep::units::{self, Force, Length, Mass, Quantity, Speed};
use escapement::prelude::*;
use serde::Deserialize;

use crate::messages::{Command, Motion};

/// Gravity at the surface of the Moon, m/s².
pub const GRAVITY: f64 = 1.62;
/// Exhaust velocity of a storable bipropellant engine, m/s.
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
    ports: Ports,
    command: InputPort<Command>,
    motion: OutputPort<Motion>,
    now: Motion,
    dry_mass: f64,
    thrust_max: f64,
}

/// Creates a lander.
pub fn make(setup: &Setup) -> Result<Box<dyn Participant>, ParameterError> {
    let parameters: Parameters = units::read(&setup.parameters)?;
    let (mass, dry_mass) = (parameters.mass.si(), parameters.dry_mass.si());
    if !(dry_mass > 0.0 && mass >= dry_mass) {
        let reason = format!("{dry_mass} kg is not between zero and the mass of {mass} kg");
        return Err(ParameterError::new("dry_mass", reason));
    }
    let mut ports = Ports::new(Kind::Continuous);
    Ok(Box::new(Lander {
        command: ports.input("command"),
        motion: ports.output("motion"),
        ports,
        now: Motion {
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
        self.ports.interface()
    }

    fn initialise(&mut self, _t: f64, outputs: &mut Outputs) -> Result<(), Failure> {
        outputs[self.motion] = self.now;
        Ok(())
    }

    fn step(&mut self, step: &Step, inputs: &Inputs, outputs: &mut Outputs) -> Result<(), Failure> {
        let commanded = inputs[self.command].thrust.clamp(0.0, self.thrust_max);
        let now = &mut self.now;
        if now.touchdown_speed == 0.0 {
            let thrust = if now.mass > self.dry_mass { commanded } else { 0.0 };
            now.mass = (now.mass - step.period * thrust / EXHAUST_SPEED).max(self.dry_mass);
            now.velocity += step.period * (thrust / now.mass - GRAVITY);
            now.height += step.period * now.velocity;
            if now.height <= 0.0 {
                now.touchdown_speed = now.velocity.abs();
                (now.height, now.velocity) = (0.0, 0.0);
            }
        }
        outputs[self.motion] = *now;
        Ok(())
    }

    fn save(&self) -> Option<Vec<u8>> {
        state::to_bytes(&self.now)
    }

    fn restore(&mut self, bytes: &[u8]) -> Result<(), Failure> {
        self.now = state::from_bytes(bytes)?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use escapement::testing::{Harness, assert_repeats, assert_resumes};

    use super::*;

    fn lander() -> Harness {
        let parameters =
            r#"height = "10 m", velocity = "0 m/s", mass = "100 kg", dry_mass = "60 kg", thrust_max = "500 N""#;
        Harness::made(make, &parameters.replace(", ", "\n"), "10 ms")
    }

    #[test]
    fn lander_falls_without_thrust() {
        let mut lander = lander();
        lander.steps(100);
        // The step uses the speed at its end for the whole step: half a step more than g t²/2.
        assert!((lander.value("motion.height") - (10.0 - 0.5 * GRAVITY * 1.01)).abs() < 1e-9);
        lander.steps(300);
        assert_eq!(lander.get::<Motion>("motion").height, 0.0);
        assert!(lander.value("motion.touchdown_speed") > 5.6);
    }

    #[test]
    fn lander_state_is_saved_completely() {
        let thrust = |lander: &mut Harness| lander.set_value("command.thrust", 100.0 * lander.t());
        assert_resumes(lander, 400, thrust);
        assert_repeats(lander, 400, thrust);
    }
}
