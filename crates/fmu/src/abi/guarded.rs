//! An instance whose calls are guarded: it has floating-point modes of its own, and where it shares its process with others, a call of
//! `exit` in one of its functions is a failure of the process.

use foreign_calls::Guard;

use super::interface::{Instance, StateError, Status, Stepped, Texts, Values};

/// The guard of the FMU called `name`; in a process of its own it may call `exit`, which the orchestrator sees.
pub(super) fn guard(name: &str, own_process: bool) -> Guard {
    if own_process {
        return Guard::allowing_exit();
    }
    Guard::new(name, |function| {
        format!(
            "the FMU called exit() in {function}, which ends the process that it shares with the run; to give up it has to return Error or \
             Fatal. Leave out --in-process, so that the FMU has a process of its own"
        )
    })
}

/// `instance`, whose calls are guarded.
pub(super) struct Guarded<I> {
    pub(super) instance: I,
    pub(super) guard: Guard,
}

impl<I: Instance> Instance for Guarded<I> {
    fn configure(&mut self, entering: bool) -> Status {
        let function = if entering {
            "EnterConfigurationMode"
        } else {
            "ExitConfigurationMode"
        };
        self.guard.call(function, || self.instance.configure(entering))
    }

    fn enter_initialisation(&mut self, start: f64, tolerance: Option<f64>) -> Result<(), (&'static str, Status)> {
        self.guard.call("EnterInitializationMode", || {
            self.instance.enter_initialisation(start, tolerance)
        })
    }

    fn exit_initialisation(&mut self) -> Status {
        let call = || self.instance.exit_initialisation();
        self.guard.call("ExitInitializationMode", call)
    }

    fn get(&mut self, values: &mut Values) -> Status {
        self.guard.call("a Get function", || self.instance.get(values))
    }

    fn set(&mut self, values: &mut Values) -> Status {
        self.guard.call("a Set function", || self.instance.set(values))
    }

    fn set_text(&mut self, reference: u32, text: Texts<'_>) -> Status {
        let call = || self.instance.set_text(reference, text);
        self.guard.call("a Set function", call)
    }

    fn step(&mut self, t: f64, step: f64) -> Stepped {
        self.guard.call("DoStep", || self.instance.step(t, step))
    }

    fn serialise(&self) -> Result<Vec<u8>, StateError> {
        let call = || self.instance.serialise();
        self.guard.call("the functions that save its state", call)
    }

    fn deserialise(&mut self, bytes: &[u8]) -> Result<(), (&'static str, Status)> {
        let call = || self.instance.deserialise(bytes);
        self.guard.call("the functions that restore its state", call)
    }

    fn terminate(&mut self) -> Status {
        self.guard.call("Terminate", || self.instance.terminate())
    }

    fn free(&mut self) {
        self.guard.call("FreeInstance", || self.instance.free());
    }
}

#[cfg(test)]
#[path = "../../tests/guarded/mod.rs"]
mod tests;
