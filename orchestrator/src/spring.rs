//! The participant `spring`: a mass on a spring, coupled to its neighbour by a second spring. A scenario with it needs no
//! other program.

use lockstep::participant::{Failure, Inputs, Interface, Kind, Outputs, ParameterError, Participant, Setup, Step};
use lockstep::units::{self, Length, LinearDamping, LinearStiffness, Mass, Quantity};
use serde::Deserialize;

lockstep::message! {
    /// Position and velocity of a mass.
    struct Motion {
        /// Displacement from rest along x.
        position: f64 = "m" in "N",
        /// Velocity along x.
        velocity: f64 = "m/s" in "N",
    }
}

/// The table `parameters`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Parameters {
    /// At the start, displacement from rest.
    position: Quantity<Length>,
    mass: Quantity<Mass>,
    /// Stiffness of its own spring.
    stiffness: Quantity<LinearStiffness>,
    /// Stiffness of the spring to the neighbour.
    coupling: Quantity<LinearStiffness>,
    damping: Quantity<LinearDamping>,
}

struct Spring {
    motion: Motion,
    /// Divided by the mass, 1/s².
    stiffness: f64,
    coupling: f64,
    /// Divided by the mass, 1/s.
    damping: f64,
}

/// Creates a spring.
pub fn make(setup: &Setup) -> Result<Box<dyn Participant>, ParameterError> {
    let read: Parameters = units::read(&setup.parameters)?;
    let mass = read.mass.si();
    if mass <= 0.0 {
        return Err(ParameterError::new("mass", format!("{mass} kg is not above zero")));
    }
    let of_springs = [
        ("stiffness", read.stiffness.si(), "N/m"),
        ("coupling", read.coupling.si(), "N/m"),
        ("damping", read.damping.si(), "N s/m"),
    ];
    for (key, value, unit) in of_springs {
        if value < 0.0 {
            let reason = format!("{value} {unit} is below zero: it would feed the motion; write 0 or more");
            return Err(ParameterError::new(key, reason));
        }
    }
    let [stiffness, coupling, damping] = of_springs.map(|(_, value, _)| value / mass);
    // The step is semi-implicit: stable as long as (period · frequency)² + 2 · period · damping stays below 4.
    let period = setup.period;
    if period * (period * (stiffness + coupling) + 2.0 * damping) >= 4.0 {
        let reason =
            format!("so stiff a spring is unstable with steps of {period} s: shorten the period or enlarge the mass");
        return Err(ParameterError::new("stiffness", reason));
    }
    let motion = Motion {
        position: read.position.si(),
        velocity: 0.0,
    };
    Ok(Box::new(Spring {
        motion,
        stiffness,
        coupling,
        damping,
    }))
}

impl Participant for Spring {
    fn interface(&self) -> Interface {
        Interface::new(Kind::Continuous)
            .input::<Motion>("neighbour")
            .output::<Motion>("motion")
    }

    fn initialise(&mut self, _t: f64, outputs: &mut Outputs) -> Result<(), Failure> {
        *outputs.get_mut(0) = self.motion;
        Ok(())
    }

    fn step(&mut self, step: &Step, inputs: &Inputs, outputs: &mut Outputs) -> Result<(), Failure> {
        let neighbour = inputs.get::<Motion>(0);
        let Motion { position, velocity } = self.motion;
        let pull = self.coupling * (neighbour.position - position) - self.stiffness * position;
        self.motion.velocity += step.period * (pull - self.damping * velocity);
        self.motion.position += step.period * self.motion.velocity;
        *outputs.get_mut(0) = self.motion;
        Ok(())
    }

    fn save(&self) -> Option<Vec<u8>> {
        let Motion { position, velocity } = self.motion;
        Some([position, velocity].map(f64::to_le_bytes).concat())
    }

    fn restore(&mut self, state: &[u8]) -> Result<(), Failure> {
        let (&[position, velocity], []) = state.as_chunks::<8>() else {
            return Err(format!("a state of a spring is two numbers, not {} bytes", state.len()).into());
        };
        self.motion = Motion {
            position: f64::from_le_bytes(position),
            velocity: f64::from_le_bytes(velocity),
        };
        Ok(())
    }
}
