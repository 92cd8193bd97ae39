//! A mass on a spring that its neighbour pulls along. One program, two participants: see `spring.toml`.

use lockstep::participant::{
    Failure, InputPort, Inputs, Interface, Kind, OutputPort, Outputs, ParameterError, Participant, Ports, Setup, Step,
    state,
};

lockstep::message! {
    /// Position and velocity of a mass.
    pub struct Motion {
        /// Distance from rest along x.
        pub position: f64 = "m" in "N",
        /// Velocity along x.
        pub velocity: f64 = "m/s" in "N",
    }
}

struct Spring {
    ports: Ports,
    neighbour: InputPort<Motion>,
    motion: OutputPort<Motion>,
    now: Motion,
}

/// The parameters that the scenario gives.
#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Parameters {
    /// Where the mass starts, m.
    position: f64,
}

fn make(setup: &Setup) -> Result<Box<dyn Participant>, ParameterError> {
    let parameters: Parameters = lockstep::units::read(&setup.parameters)?;
    let mut ports = Ports::new(Kind::Continuous);
    Ok(Box::new(Spring {
        neighbour: ports.input("neighbour"),
        motion: ports.output("motion"),
        ports,
        now: Motion {
            position: parameters.position,
            velocity: 0.0,
        },
    }))
}

impl Participant for Spring {
    fn interface(&self) -> Interface {
        self.ports.interface()
    }

    fn initialise(&mut self, _t: f64, outputs: &mut Outputs) -> Result<(), Failure> {
        outputs[self.motion] = self.now;
        Ok(())
    }

    fn step(&mut self, step: &Step, inputs: &Inputs, outputs: &mut Outputs) -> Result<(), Failure> {
        let now = &mut self.now;
        let pull = 5.0 * (inputs[self.neighbour].position - now.position); // stiffness over mass, 1/s²
        now.velocity += step.period * (pull - 40.0 * now.position);
        now.position += step.period * now.velocity;
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

fn main() -> std::process::ExitCode {
    lockstep::host::run(make, concat!("spring ", env!("CARGO_PKG_VERSION")))
}
