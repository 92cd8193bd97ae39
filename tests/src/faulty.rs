//! Shared by the faulty participants: the healthy damper, with hooks for faults.

use std::process::ExitCode;
use std::sync::OnceLock;

use lockstep::participant::{Failure, Inputs, Interface, Outputs, ParameterError, Participant, Setup, Step};

use crate::participants::Damper;

type Fault = fn(&Step, &mut Outputs);

static FAULT: OnceLock<Fault> = OnceLock::new();
static BEFORE: OnceLock<fn(&Step)> = OnceLock::new();

struct Faulty(Box<dyn Participant>);

impl Participant for Faulty {
    fn interface(&self) -> Interface {
        self.0.interface()
    }
    fn initialise(&mut self, t: f64, outputs: &mut Outputs) -> Result<(), Failure> {
        self.0.initialise(t, outputs)
    }
    fn step(&mut self, step: &Step, inputs: &Inputs, outputs: &mut Outputs) -> Result<(), Failure> {
        if let Some(before) = BEFORE.get() {
            before(step);
        }
        self.0.step(step, inputs, outputs)?;
        if let Some(fault) = FAULT.get() {
            fault(step, outputs);
        }
        Ok(())
    }
    fn save(&self) -> Option<Vec<u8>> {
        self.0.save()
    }
    fn restore(&mut self, state: &[u8]) -> Result<(), Failure> {
        self.0.restore(state)
    }
}

fn make(setup: &Setup) -> Result<Box<dyn Participant>, ParameterError> {
    Ok(Box::new(Faulty(Damper::factory(setup)?)))
}

/// The damper, with `before` called before every step.
pub fn run_before_step(name: &str, before: fn(&Step)) -> ExitCode {
    let _ = BEFORE.set(before);
    lockstep::host::run(make, name)
}

/// The damper, with `after` applied to its outputs.
pub fn run_after_step(name: &str, after: Fault) -> ExitCode {
    let _ = FAULT.set(after);
    lockstep::host::run(make, name)
}
