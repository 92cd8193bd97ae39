//! Declares its output in another unit than the input of the plant.

use std::process::ExitCode;

use lockstep::participant::{Failure, Inputs, Interface, Kind, Outputs, ParameterError, Participant, Setup, Step};

lockstep::message! {
    /// As the healthy one, but in kilonewtons.
    struct Push {
        force: f64 = "kN" in "N",
        count: u64 = "1",
    }
}

struct Imperial;

impl Participant for Imperial {
    fn interface(&self) -> Interface {
        Interface::new(Kind::Sampled)
            .input::<escapement_tests::participants::Motion>("motion")
            .output::<Push>("push")
    }
    fn initialise(&mut self, _: f64, _: &mut Outputs) -> Result<(), Failure> {
        Ok(())
    }
    fn step(&mut self, _: &Step, _: &Inputs, _: &mut Outputs) -> Result<(), Failure> {
        Ok(())
    }
}

fn make(_: &Setup) -> Result<Box<dyn Participant>, ParameterError> {
    Ok(Box::new(Imperial))
}

fn main() -> ExitCode {
    lockstep::host::run(make, "wrong_descriptor")
}
