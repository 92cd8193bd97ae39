//! Crashes in the middle of the run, and describes its output in another unit when it is started again: `changes_interface MARK`.

use std::fs::File;
use std::process::ExitCode;

use escapement_tests::participants::Damper;
use lockstep::participant::{Failure, Inputs, Interface, Outputs, ParameterError, Participant, Setup, Step};

struct ChangesInterface {
    damper: Damper,
    again: bool,
}

impl Participant for ChangesInterface {
    fn interface(&self) -> Interface {
        let mut interface = self.damper.interface();
        if self.again {
            interface.outputs[0].descriptor.fields[0].unit = "kN".into();
        }
        interface
    }
    fn initialise(&mut self, t: f64, outputs: &mut Outputs) -> Result<(), Failure> {
        self.damper.initialise(t, outputs)
    }
    fn step(&mut self, step: &Step, inputs: &Inputs, outputs: &mut Outputs) -> Result<(), Failure> {
        if step.t >= 2.0 {
            std::process::abort();
        }
        self.damper.step(step, inputs, outputs)
    }
    fn save(&self) -> Option<Vec<u8>> {
        self.damper.save()
    }
    fn restore(&mut self, state: &[u8]) -> Result<(), Failure> {
        self.damper.restore(state)
    }
}

fn make(_: &Setup) -> Result<Box<dyn Participant>, ParameterError> {
    let mark = std::env::args().nth(1).expect("the file to leave a mark in");
    Ok(Box::new(ChangesInterface {
        damper: Damper::default(),
        again: File::create_new(mark).is_err(),
    }))
}

fn main() -> ExitCode {
    lockstep::host::run(make, "changes_interface")
}
