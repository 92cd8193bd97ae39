//! Small participants from which the tests build their scenarios.

use engine::run::{Options, Record};
use lockstep::participant::{Failure, Inputs, Interface, Kind, Outputs, ParameterError, Participant, Setup, Step};

/// Options for a run in this process with this record.
pub fn in_process_options(record: Record) -> Options {
    Options {
        in_process: true,
        record,
        ..Options::default()
    }
}

lockstep::message! {
    /// The state of an oscillator.
    pub struct Motion {
        /// Position along x.
        pub position: f64 = "m" in "N",
        /// Velocity along x.
        pub velocity: f64 = "m/s" in "N",
    }
}

lockstep::message! {
    /// The force on the oscillator.
    pub struct Push {
        /// Force along x.
        pub force: f64 = "N" in "N",
        /// Number of pushes so far.
        pub count: u64 = "1",
    }
}

/// A mass on a spring: continuous, reads a push, publishes its motion.
#[derive(Default)]
pub struct Oscillator {
    motion: Motion,
}

impl Oscillator {
    /// Starts one metre from equilibrium.
    pub fn factory(_: &Setup) -> Result<Box<dyn Participant>, ParameterError> {
        Ok(Box::new(Oscillator {
            motion: Motion {
                position: 1.0,
                velocity: 0.0,
            },
        }))
    }
}

impl Participant for Oscillator {
    fn interface(&self) -> Interface {
        Interface::new(Kind::Continuous)
            .input::<Push>("push")
            .output::<Motion>("motion")
    }

    fn initialise(&mut self, _: f64, outputs: &mut Outputs) -> Result<(), Failure> {
        *outputs.get_mut(0) = self.motion;
        Ok(())
    }

    fn step(&mut self, step: &Step, inputs: &Inputs, outputs: &mut Outputs) -> Result<(), Failure> {
        let push = inputs.get::<Push>(0);
        self.motion.velocity += step.period * (push.force - 4.0 * self.motion.position);
        self.motion.position += step.period * self.motion.velocity;
        *outputs.get_mut(0) = self.motion;
        Ok(())
    }

    fn save(&self) -> Option<Vec<u8>> {
        Some(bytemuck::bytes_of(&self.motion).to_vec())
    }

    fn restore(&mut self, state: &[u8]) -> Result<(), Failure> {
        self.motion = *bytemuck::checked::try_from_bytes(state).map_err(|error| error.to_string())?;
        Ok(())
    }
}

/// A damper: sampled, reads a motion, publishes a push.
#[derive(Default)]
pub struct Damper {
    count: u64,
}

impl Damper {
    /// Has no parameters.
    pub fn factory(_: &Setup) -> Result<Box<dyn Participant>, ParameterError> {
        Ok(Box::new(Damper::default()))
    }

    /// The force for a motion, N.
    pub fn force(motion: &Motion) -> f64 {
        -0.8 * motion.velocity
    }
}

impl Participant for Damper {
    fn interface(&self) -> Interface {
        Interface::new(Kind::Sampled)
            .input::<Motion>("motion")
            .output::<Push>("push")
    }

    fn initialise(&mut self, _: f64, _: &mut Outputs) -> Result<(), Failure> {
        Ok(())
    }

    fn step(&mut self, _: &Step, inputs: &Inputs, outputs: &mut Outputs) -> Result<(), Failure> {
        self.count += 1;
        *outputs.get_mut(0) = Push {
            force: Damper::force(inputs.get::<Motion>(0)),
            count: self.count,
        };
        Ok(())
    }

    fn save(&self) -> Option<Vec<u8>> {
        Some(self.count.to_le_bytes().to_vec())
    }

    fn restore(&mut self, state: &[u8]) -> Result<(), Failure> {
        self.count = u64::from_le_bytes(state.try_into()?);
        Ok(())
    }
}
