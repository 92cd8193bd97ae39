//! A healthy damper whose output follows from the step and its input alone, so it can take over at any activation without a
//! saved state.

use std::process::ExitCode;

use escapement_tests::participants::{Damper, Motion, Push};
use lockstep::participant::{Failure, Inputs, Interface, Outputs, ParameterError, Participant, Setup, Step};

struct Memoryless {
    interface: Interface,
    period: f64,
    /// Of the steps before, for a damper that takes its state over.
    count: u64,
}

impl Participant for Memoryless {
    fn interface(&self) -> Interface {
        self.interface.clone()
    }
    fn initialise(&mut self, t: f64, _: &mut Outputs) -> Result<(), Failure> {
        self.count = (t / self.period).round() as u64;
        Ok(())
    }
    fn step(&mut self, step: &Step, inputs: &Inputs, outputs: &mut Outputs) -> Result<(), Failure> {
        self.count = step.index + 1;
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

fn make(setup: &Setup) -> Result<Box<dyn Participant>, ParameterError> {
    Ok(Box::new(Memoryless {
        interface: Damper::factory(setup)?.interface(),
        period: setup.period,
        count: 0,
    }))
}

fn main() -> ExitCode {
    lockstep::host::run(make, "memoryless")
}
