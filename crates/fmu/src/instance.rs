//! A running FMU: unpacked, loaded, initialised, stepped, terminated.

use std::cell::Cell;
use std::collections::BTreeSet;
use std::sync::{Mutex, MutexGuard, PoisonError};

use lockstep::participant::Failure;

use crate::abi::{self, Instance, Log, StateError, Status, Texts};
use crate::model::Model;
use crate::scratch::Scratch;
use crate::settings::{Content, Setting, Settings};
use crate::transfer::Transfer;

/// The FMUs with an instance in this process that permit one instance only.
static SINGLE_INSTANCES: Mutex<BTreeSet<String>> = Mutex::new(BTreeSet::new());

/// How far from the end of a step the instant that the FMU reports may be, s. An FMU that sums up its steps reports the rounding
/// errors of all of them; an instant that is half a step away is no rounding error.
fn end_tolerance(end: f64, step: f64) -> f64 {
    let one = f64::EPSILON * end.abs();
    (1e-3 * step + one * (end / step).abs()).min(0.5 * step).max(4.0 * one)
}

fn single_instances() -> MutexGuard<'static, BTreeSet<String>> {
    SINGLE_INSTANCES.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Exclusive permission for the single instance.
struct SingleInstancePermit(String);

impl Drop for SingleInstancePermit {
    fn drop(&mut self) {
        single_instances().remove(&self.0);
    }
}

/// An instance with its resources. Fields are dropped in this order: first the library, last the folder.
pub struct Running {
    instance: Box<dyn Instance>,
    log: Log,
    _permit: Option<SingleInstancePermit>,
    _scratch: Scratch,
    /// True after the initialisation, until a failure.
    stepping: bool,
    /// Whether it must not be freed.
    fatal: bool,
    /// How saving its state failed last.
    unsaved: Cell<Status>,
}

impl Running {
    /// Unpacks, loads and initialises an FMU for a run that starts at `start`, s; `own_process` where it is the only participant of the
    /// process.
    ///
    /// # Errors
    /// Names the function that failed, with the FMU's own log.
    pub fn start(
        model: &Model,
        settings: &Settings,
        name: &str,
        start: f64,
        tolerance: Option<f64>,
        own_process: bool,
    ) -> Result<Running, Failure> {
        let description = &model.description;
        let permit = match description.capabilities.once_per_process {
            false => None,
            true => match single_instances().insert(description.token.clone()) {
                true => Some(SingleInstancePermit(description.token.clone())),
                false => {
                    return Err(format!(
                        "`{}` can be instantiated only once in a process, and this process has an instance already: leave out \
                         --in-process, so that each has a process of its own",
                        description.model
                    )
                    .into());
                }
            },
        };
        let library = model.library()?;
        let scratch = Scratch::create().map_err(|error| format!("it cannot be unpacked: {error}"))?;
        let folder = scratch.unpacked();
        model.archive.unpack(&folder)?;
        // Some FMUs are exported without resources, and read the folder nevertheless.
        let _ = std::fs::create_dir(folder.join("resources"));
        let log = Log::default();
        let instance = abi::instantiate(description, &folder.join(library), &folder, name, &log, own_process)?;
        let mut running = Running {
            instance,
            log,
            _permit: permit,
            _scratch: scratch,
            stepping: false,
            fatal: false,
            unsaved: Cell::new(Status::Ok),
        };
        running.initialise(settings, start, tolerance)?;
        Ok(running)
    }

    /// Returns the FMU's log messages since the last call.
    pub fn take_log_messages(&self, say: impl FnMut(&str)) {
        self.log.report_new(say);
    }

    /// The working directory of the FMU.
    pub fn working_directory(&self) -> std::path::PathBuf {
        self._scratch.working_directory()
    }

    fn initialise(&mut self, settings: &Settings, start: f64, tolerance: Option<f64>) -> Result<(), Failure> {
        if !settings.structural.is_empty() {
            let status = self.instance.configure(true);
            self.check_status("entering configuration mode", status)?;
            self.apply(&settings.structural)?;
            let status = self.instance.configure(false);
            self.check_status("leaving configuration mode", status)?;
        }
        self.apply(&settings.start)?;
        let entered = self.instance.enter_initialisation(start, tolerance);
        entered.or_else(|(function, status)| self.check_status(function, status))?;
        self.apply(&settings.inputs)?;
        let status = self.instance.exit_initialisation();
        self.check_status("leaving initialization mode", status)?;
        self.stepping = true;
        Ok(())
    }

    fn apply(&mut self, settings: &[Setting]) -> Result<(), Failure> {
        for setting in settings {
            let status = match &setting.value {
                Content::Numbers(values) => self.instance.set(&mut values.clone()),
                Content::Text(text) => self.instance.set_text(setting.reference, Texts::String(text)),
                Content::Bytes(bytes) => self.instance.set_text(setting.reference, Texts::Binary(bytes)),
            };
            self.check_status(&format!("setting `{}`", setting.name), status)?;
        }
        Ok(())
    }

    /// Returns a failure if `status` is one. After an error the instance accepts no further calls except the final one.
    fn check_status(&mut self, what: &str, status: Status) -> Result<(), Failure> {
        if status.succeeded() {
            return Ok(());
        }
        self.stepping &= status == Status::Discard;
        self.fatal |= status == Status::Fatal;
        let consequence = match status {
            Status::Discard => "; it refuses this call and would go on with another one",
            Status::Fatal => "; no instance of this FMU can be used any more in this process",
            _ => "",
        };
        Err(format!("{what} {}{consequence}{}", status.text(), self.log.take()).into())
    }

    /// Sets the values of the transfers.
    ///
    /// # Errors
    /// The FMU's error.
    pub fn set(&mut self, transfers: &mut [Transfer]) -> Result<(), Failure> {
        for transfer in transfers {
            let status = self.instance.set(&mut transfer.values);
            if !status.succeeded() {
                self.check_status("setting its inputs", status)?;
            }
        }
        Ok(())
    }

    /// Reads values into the transfers.
    ///
    /// # Errors
    /// The FMU's error.
    pub fn get(&mut self, transfers: &mut [Transfer]) -> Result<(), Failure> {
        for transfer in transfers {
            let status = self.instance.get(&mut transfer.values);
            if !status.succeeded() {
                self.check_status("reading its outputs", status)?;
            }
        }
        Ok(())
    }

    /// One communication step.
    ///
    /// # Errors
    /// Distinguishes discard, error and fatal, with the instant reached and the FMU's log.
    pub fn step(&mut self, t: f64, step: f64) -> Result<(), Failure> {
        let stepped = self.instance.step(t, step);
        if stepped.status.succeeded() && !stepped.terminate && !stepped.early {
            let end = t + step;
            let apart = stepped.last.map_or(0.0, |last| (last - end).abs());
            if apart <= end_tolerance(end, step) {
                return Ok(());
            }
            let last = stepped.last.unwrap_or(t);
            return Err(format!(
                "doStep from t = {t} s {} and came to t = {last} s, and not to t = {end} s, which it was asked for; a period that is a \
                 whole multiple of its own step may help{}",
                stepped.status.text(),
                self.log.take()
            )
            .into());
        }
        let reached = match stepped.last {
            Some(last) => format!(" and came to t = {last} s"),
            None => String::new(),
        };
        if stepped.terminate {
            return Err(format!(
                "doStep from t = {t} s{reached}: the FMU asks for the end of the simulation{}",
                self.log.take()
            )
            .into());
        }
        if stepped.status.succeeded() {
            return Err(format!(
                "doStep from t = {t} s returned early{reached}, which it was not allowed to{}",
                self.log.take()
            )
            .into());
        }
        let reached = if stepped.status == Status::Discard {
            reached
        } else {
            String::new()
        };
        self.check_status(&format!("doStep from t = {t} s by {step} s{reached}"), stepped.status)
    }

    /// The serialised state.
    ///
    /// # Errors
    /// The function that failed and its status, with the FMU's own log.
    pub fn serialise(&self) -> Result<Vec<u8>, String> {
        self.instance.serialise().map_err(|error| match error {
            StateError::Status(function, status) => {
                self.unsaved.set(status);
                format!("{function} {}{}", status.text(), self.log.take())
            }
            StateError::Size(reason) => reason,
        })
    }

    /// Restores a state.
    ///
    /// # Errors
    /// The FMU's error.
    pub fn deserialise(&mut self, bytes: &[u8]) -> Result<(), Failure> {
        let put = self.instance.deserialise(bytes);
        put.or_else(|(function, status)| self.check_status(function, status))
    }
}

impl Running {
    /// Terminates the simulation, if it has begun and has not failed.
    ///
    /// # Errors
    /// The FMU's error: nothing depends on the FMU any more.
    pub fn terminate(&mut self) -> Result<(), Failure> {
        let unsaved = self.unsaved.get();
        self.fatal |= unsaved == Status::Fatal;
        if !std::mem::replace(&mut self.stepping, false) || !(unsaved.succeeded() || unsaved == Status::Discard) {
            return Ok(());
        }
        let status = self.instance.terminate();
        self.check_status("Terminate", status)
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.terminate();
        // After Fatal no function may be called; the memory is released when the process ends.
        if !self.fatal {
            self.instance.free();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::abi::{Stepped, Values};

    /// An FMU that reports a fixed instant.
    struct FixedInstant(Option<f64>);

    impl Instance for FixedInstant {
        fn configure(&mut self, _: bool) -> Status {
            Status::Ok
        }
        fn enter_initialisation(&mut self, _: f64, _: Option<f64>) -> Result<(), (&'static str, Status)> {
            Ok(())
        }
        fn exit_initialisation(&mut self) -> Status {
            Status::Ok
        }
        fn get(&mut self, _: &mut Values) -> Status {
            Status::Ok
        }
        fn set(&mut self, _: &mut Values) -> Status {
            Status::Ok
        }
        fn set_text(&mut self, _: u32, _: Texts<'_>) -> Status {
            Status::Ok
        }
        fn step(&mut self, _: f64, _: f64) -> Stepped {
            Stepped {
                status: Status::Ok,
                terminate: false,
                early: false,
                last: self.0,
            }
        }
        fn serialise(&self) -> Result<Vec<u8>, StateError> {
            Ok(Vec::new())
        }
        fn deserialise(&mut self, _: &[u8]) -> Result<(), (&'static str, Status)> {
            Ok(())
        }
        fn terminate(&mut self) -> Status {
            Status::Ok
        }
        fn free(&mut self) {}
    }

    #[test]
    fn step_end_within_rounding_is_accepted() {
        let (mut sum, step) = (0.0, 1e-4);
        for _ in 0..10_000_000 {
            sum += step;
        }
        let apart = f64::abs(sum - 1000.0);
        assert!((1e-9..end_tolerance(1000.0, step)).contains(&apart), "{apart}");
        assert!(end_tolerance(1e9, step) <= 0.5 * step);
    }

    #[test]
    fn step_that_misses_its_end_is_an_error() {
        let step = |last: Option<f64>| {
            let mut running = Running {
                instance: Box::new(FixedInstant(last)),
                log: Log::default(),
                _permit: None,
                _scratch: Scratch::create().unwrap(),
                stepping: true,
                fatal: false,
                unsaved: Cell::new(Status::Ok),
            };
            running.step(0.5, 0.25).map_err(|failure| format!("{failure:?}"))
        };
        // Not reported, exact, and with rounding errors.
        for last in [None, Some(0.75), Some(0.75 + 1e-9)] {
            assert_eq!(step(last), Ok(()), "{last:?}");
        }
        for last in [0.5, 0.7, 0.8, f64::INFINITY, f64::NAN] {
            let error = step(Some(last)).unwrap_err();
            assert!(
                error.contains(&format!("came to t = {last} s")) && error.contains("0.75 s"),
                "{error}"
            );
        }
    }
}
