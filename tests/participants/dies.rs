//! A healthy plant or controller that dies at each of the moments that its arguments name: `dies FOLDER MOMENT…`. At each
//! of them once, recorded by a marker file in the folder; always, if the folder is called `always`.

use std::fs::File;
use std::path::Path;
use std::process::ExitCode;

use escapement_tests::participants::{Damper, Oscillator};
use lockstep::participant::{Failure, Inputs, Interface, Outputs, ParameterError, Participant, Setup, Step};

struct Dying {
    inner: Box<dyn Participant>,
    name: String,
    steps: u64,
}

/// Aborts the process if the participant `name` is to die at `moment`.
fn die_if_due_at(name: &str, moment: &str) {
    let mut arguments = std::env::args().skip(1);
    let folder = arguments.next().expect("a folder");
    let mark = Path::new(&folder).join(format!("{name} {moment}"));
    if arguments.any(|named| named == moment) && (folder == "always" || File::create_new(mark).is_ok()) {
        std::process::abort();
    }
}

impl Dying {
    fn die_if_due_at(&self, moment: &str) {
        die_if_due_at(&self.name, moment);
    }
}

impl Participant for Dying {
    fn interface(&self) -> Interface {
        self.inner.interface()
    }
    fn initialise(&mut self, t: f64, outputs: &mut Outputs) -> Result<(), Failure> {
        self.die_if_due_at(if t > 0.0 { "take-over" } else { "start" });
        self.inner.initialise(t, outputs)
    }
    fn step(&mut self, step: &Step, inputs: &Inputs, outputs: &mut Outputs) -> Result<(), Failure> {
        self.die_if_due_at(if step.t >= 4.5 { "late" } else { "early" });
        self.steps += 1;
        self.inner.step(step, inputs, outputs)
    }
    fn save(&self) -> Option<Vec<u8>> {
        self.die_if_due_at(if self.steps > 0 { "save" } else { "first-save" });
        self.inner.save()
    }
    fn restore(&mut self, state: &[u8]) -> Result<(), Failure> {
        self.die_if_due_at("restore");
        self.inner.restore(state)
    }
}

fn make(setup: &Setup) -> Result<Box<dyn Participant>, ParameterError> {
    die_if_due_at(&setup.name, "made");
    let inner = if setup.name == "plant" {
        Oscillator::factory
    } else {
        Damper::factory
    };
    let (inner, name, steps) = (inner(setup)?, setup.name.clone(), 0);
    Ok(Box::new(Dying { inner, name, steps }))
}

fn main() -> ExitCode {
    lockstep::host::run(make, "dies")
}
