//! An instance that shares its process with others: a call of `exit` in one of its functions is a failure of the process.

use exit_guard::Guard;

use super::interface::{Instance, Status, Stepped, Texts, Values};

/// The guard of the FMU called `name`.
pub(super) fn guard(name: &str) -> Guard {
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

    fn serialise(&self) -> Result<Vec<u8>, (&'static str, Status)> {
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
mod tests {
    use std::process::Command;

    use super::*;
    use crate::abi::Native;

    const CHILD: &str = "FMU_THAT_EXITS";

    /// Every function ends the process.
    struct Exits;

    fn exit<T>() -> T {
        // SAFETY: ends this process, which a test has started for that.
        unsafe { libc::exit(0) }
    }

    impl Instance for Exits {
        fn configure(&mut self, _: bool) -> Status {
            exit()
        }
        fn enter_initialisation(&mut self, _: f64, _: Option<f64>) -> Result<(), (&'static str, Status)> {
            exit()
        }
        fn exit_initialisation(&mut self) -> Status {
            exit()
        }
        fn get(&mut self, _: &mut Values) -> Status {
            exit()
        }
        fn set(&mut self, _: &mut Values) -> Status {
            exit()
        }
        fn set_text(&mut self, _: u32, _: Texts<'_>) -> Status {
            exit()
        }
        fn step(&mut self, _: f64, _: f64) -> Stepped {
            exit()
        }
        fn serialise(&self) -> Result<Vec<u8>, (&'static str, Status)> {
            exit()
        }
        fn deserialise(&mut self, _: &[u8]) -> Result<(), (&'static str, Status)> {
            exit()
        }
        fn terminate(&mut self) -> Status {
            exit()
        }
        fn free(&mut self) {
            exit()
        }
    }

    /// Not a test by itself: what the child does.
    #[test]
    fn child() {
        let Ok(function) = std::env::var(CHILD) else { return };
        let guard = guard("it");
        let mut fmu = Guarded { instance: Exits, guard };
        let mut values = Values::new(Native::F64, vec![1], 1);
        match function.as_str() {
            "EnterConfigurationMode" => drop(fmu.configure(true)),
            "ExitConfigurationMode" => drop(fmu.configure(false)),
            "EnterInitializationMode" => drop(fmu.enter_initialisation(0.0, None)),
            "ExitInitializationMode" => drop(fmu.exit_initialisation()),
            "a Get function" => drop(fmu.get(&mut values)),
            "a Set function" => drop(fmu.set(&mut values)),
            "DoStep" => drop(fmu.step(0.0, 1.0)),
            "the functions that save its state" => drop(fmu.serialise()),
            "the functions that restore its state" => drop(fmu.deserialise(&[])),
            "Terminate" => drop(fmu.terminate()),
            _ => fmu.free(),
        }
    }

    #[test]
    fn exit_in_any_function_is_a_failure_that_names_fmu_and_function() {
        for function in [
            "EnterConfigurationMode",
            "ExitConfigurationMode",
            "EnterInitializationMode",
            "ExitInitializationMode",
            "a Get function",
            "a Set function",
            "DoStep",
            "the functions that save its state",
            "the functions that restore its state",
            "Terminate",
            "FreeInstance",
        ] {
            let program = std::env::current_exe().expect("a test has a program");
            let mut command = Command::new(program);
            command.args(["--exact", "abi::guarded::tests::child", "--nocapture"]);
            let said = command
                .env(CHILD, function)
                .output()
                .expect("the program can be started");
            let err = String::from_utf8_lossy(&said.stderr);
            assert_eq!(said.status.code(), Some(1), "{function}: {err}");
            let words = format!("it: the FMU called exit() in {function}");
            assert!(err.contains(&words), "{function}: {err}");
        }
    }
}
