//! A mass on a spring that its neighbour pulls along. One program, two participants: see `spring.toml`.

use lockstep::participant::{Failure, Inputs, Interface, Kind, Outputs, ParameterError, Participant, Setup, Step};

lockstep::message! {
    /// Where a mass is and how fast it moves.
    pub struct Motion {
        /// Distance from rest along x.
        pub position: f64 = "m" in "N",
        /// Velocity along x.
        pub velocity: f64 = "m/s" in "N",
    }
}

struct Spring(Motion);

/// What the scenario may say below `parameters`.
#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Parameters {
    /// Where the mass starts, m.
    position: f64,
}

fn make(setup: &Setup) -> Result<Box<dyn Participant>, ParameterError> {
    let parameters: Parameters = lockstep::units::read(&setup.parameters)?;
    Ok(Box::new(Spring(Motion {
        position: parameters.position,
        velocity: 0.0,
    })))
}

impl Participant for Spring {
    fn interface(&self) -> Interface {
        Interface::new(Kind::Continuous)
            .input::<Motion>("neighbour")
            .output::<Motion>("motion")
    }

    fn initialise(&mut self, _t: f64, outputs: &mut Outputs) -> Result<(), Failure> {
        *outputs.get_mut(0) = self.0;
        Ok(())
    }

    fn step(&mut self, step: &Step, inputs: &Inputs, outputs: &mut Outputs) -> Result<(), Failure> {
        let neighbour = inputs.get::<Motion>(0);
        let acceleration = 5.0 * (neighbour.position - self.0.position) - 40.0 * self.0.position; // stiffness over mass, 1/s²
        self.0.velocity += step.period * acceleration;
        self.0.position += step.period * self.0.velocity;
        *outputs.get_mut(0) = self.0;
        Ok(())
    }
}

fn main() -> std::process::ExitCode {
    lockstep::host::run(make, concat!("spring ", env!("CARGO_PKG_VERSION")))
}
