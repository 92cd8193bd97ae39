//! Every call into an FMU is guarded: one that ends the process fails with a name.

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
    fn serialise(&self) -> Result<Vec<u8>, StateError> {
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
    let guard = guard("it", false);
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
fn exit_in_any_function_fails_with_fmu_and_function_name() {
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
        let output = command
            .env(CHILD, function)
            .output()
            .expect("the program can be started");
        let err = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{function}: {err}");
        let words = format!("it: the FMU called exit() in {function}");
        assert!(err.contains(&words), "{function}: {err}");
    }
}
