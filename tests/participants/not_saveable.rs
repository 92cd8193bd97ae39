//! A healthy controller that cannot be saved.

use std::process::ExitCode;

use escapement_tests::participants::Damper;
use lockstep::participant::{Failure, Inputs, Interface, Outputs, ParameterError, Participant, Setup, Step};

struct NotSaveable(Damper);

impl Participant for NotSaveable {
    fn interface(&self) -> Interface {
        self.0.interface()
    }
    fn initialise(&mut self, t: f64, outputs: &mut Outputs) -> Result<(), Failure> {
        self.0.initialise(t, outputs)
    }
    fn step(&mut self, step: &Step, inputs: &Inputs, outputs: &mut Outputs) -> Result<(), Failure> {
        self.0.step(step, inputs, outputs)
    }
}

fn make(_: &Setup) -> Result<Box<dyn Participant>, ParameterError> {
    Ok(Box::new(NotSaveable(Damper::default())))
}

fn main() -> ExitCode {
    lockstep::host::run(make, "not_saveable")
}
