//! A participant that is a Python object.

use std::cell::RefCell;
use std::sync::{Arc, Mutex, PoisonError};

use lockstep::participant::{
    Failure, Inputs, Interface, Log, Outputs, ParameterError, Participant, Setup, Step, Termination,
};
use plugin::Parameters;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use crate::memory::Memory;
use crate::values::of_toml;

/// The first exception of a run in this process, used as the cause of the exception that is raised.
pub(crate) type Raised = Arc<Mutex<Option<PyErr>>>;

/// A Python object with a method `step`.
pub(crate) struct PyParticipant {
    interface: Interface,
    inputs: Vec<Memory>,
    outputs: Vec<Memory>,
    /// Flags in one byte for each output: whether this sample is seen, whether any sample is.
    seen: Memory,
    /// Its bound methods.
    initialise: Py<PyAny>,
    step: Py<PyAny>,
    save: Py<PyAny>,
    restore: Py<PyAny>,
    terminate: Py<PyAny>,
    /// The destination of its log lines.
    log: Py<Lines>,
    has_log: bool,
    /// Why the last `save` failed.
    save_failure: RefCell<Option<String>>,
    raised: Raised,
}

/// The log of an object.
#[pyclass(module = "escapement._native")]
pub(crate) struct Lines {
    log: Log,
    /// The simulated time, s.
    t: Option<f64>,
}

#[pymethods]
impl Lines {
    /// Writes a line with the simulated time.
    fn write(&self, text: &str) {
        match self.t {
            Some(t) => self.log.clone().at(t).write(text),
            None => self.log.write(text),
        }
    }
}

/// A parameter as its class declares it.
#[derive(FromPyObject)]
struct DeclaredParameter {
    key: String,
    /// None for a value that is passed as the scenario states it.
    unit: Option<String>,
    required: bool,
    /// 0 for a scalar.
    count: usize,
}

impl PyParticipant {
    /// Creates an object of `class`.
    ///
    /// # Errors
    /// A parameter that is rejected, or a class that is not a participant.
    pub(crate) fn make(
        class: &Py<PyAny>,
        setup: &Setup,
        raised: &Raised,
    ) -> Result<Box<dyn Participant>, ParameterError> {
        Python::attach(|py| {
            let parameters = Parameters::new(setup.parameters.clone());
            let made = PyParticipant::create(class.bind(py), setup, &parameters, raised);
            made.map(|object| Box::new(object) as Box<dyn Participant>)
                .map_err(|wrong| match wrong {
                    CreationError::Parameter(error) => error,
                    CreationError::Raised(error) => refusal(py, error, raised),
                })
        })
    }

    fn create(
        class: &Bound<'_, PyAny>,
        setup: &Setup,
        parameters: &Parameters,
        raised: &Raised,
    ) -> Result<PyParticipant, CreationError> {
        let py = class.py();
        let maker = py.import("escapement.participant")?;
        let declared: Vec<DeclaredParameter> = maker.call_method1("_declared", (class,))?.extract()?;
        let values = PyDict::new(py);
        for one in &declared {
            if let Some(value) = read(py, parameters, one)? {
                values.set_item(&one.key, value)?;
            }
        }
        if let Some(unknown) = parameters.unknown() {
            return Err(CreationError::Parameter(unknown));
        }
        let about = (setup.name.as_str(), setup.seed, setup.period, setup.offset);
        let object = maker.call_method1("_make", (class, about, values))?;
        let described: String = maker.call_method1("_interface", (&object,))?.extract()?;
        let unusable = |reason: String| CreationError::Parameter(ParameterError::new(plugin::NO_PARTICIPANT, reason));
        let interface: Interface =
            serde_json::from_str(&described).map_err(|error| unusable(format!("its ports cannot be read: {error}")))?;
        interface
            .validate()
            .map_err(|error| unusable(format!("it describes invalid ports: {error}")))?;
        let (of_inputs, of_outputs): (Vec<Bound<'_, PyAny>>, Vec<Bound<'_, PyAny>>) =
            maker.call_method1("_memory", (&object,))?.extract()?;
        let sizes = interface.inputs.iter().map(|port| port.descriptor.size as usize);
        let inputs = of_inputs.iter().zip(sizes).map(|(array, size)| Memory::of(array, size));
        let inputs = inputs.collect::<PyResult<_>>()?;
        let sizes = interface.outputs.iter().map(|port| port.descriptor.size as usize);
        let outputs = of_outputs
            .iter()
            .zip(sizes)
            .map(|(array, size)| Memory::of(array, size));
        let outputs = outputs.collect::<PyResult<_>>()?;
        let seen = Memory::of(&object.getattr("_esc_seen")?, interface.outputs.len())?;
        let log = Log::new(&setup.name, None);
        let lines = Lines { log, t: None };
        object.setattr("_esc_lines", Py::new(py, lines)?)?;
        let function = |name: &str| object.getattr(name).map(Bound::unbind);
        Ok(PyParticipant {
            interface,
            inputs,
            outputs,
            seen,
            initialise: function("initialise")?,
            step: function("step")?,
            save: function("_esc_save")?,
            restore: function("_esc_restore")?,
            terminate: function("_esc_terminate")?,
            log: object
                .getattr("_esc_lines")?
                .cast_into::<Lines>()
                .map_err(PyErr::from)?
                .unbind(),
            has_log: false,
            save_failure: RefCell::new(None),
            raised: raised.clone(),
        })
    }

    /// The failure for an exception: a short text with its location. The traceback is logged.
    fn failure(&self, py: Python<'_>, error: PyErr) -> Failure {
        let text = one_line(py, &error);
        record_exception(py, error, &self.raised);
        text.into()
    }

    /// Prepares a call at `t`, s.
    fn show_outputs(&mut self, py: Python<'_>, t: f64, outputs: &mut Outputs) {
        let mut lines = self.log.borrow_mut(py);
        lines.t = Some(t);
        if !std::mem::replace(&mut self.has_log, true) {
            lines.log = outputs.log_of().clone();
        }
        drop(lines);
        // An output that a step does not write keeps its last value, which another participant may have written.
        let mut seen = [0; 256];
        for (port, memory) in self.outputs.iter().enumerate() {
            memory.put(py, outputs.bytes_mut(port));
            seen[port] = u8::from(outputs.is_seen(port)) + 2 * u8::from(outputs.is_ever_seen(port));
        }
        self.seen.put(py, &seen);
    }

    fn take_outputs(&self, py: Python<'_>, outputs: &mut Outputs) {
        for (port, memory) in self.outputs.iter().enumerate() {
            memory.take(py, outputs.bytes_mut(port));
        }
    }
}

/// The reason why no object could be created.
enum CreationError {
    Parameter(ParameterError),
    Raised(PyErr),
}

impl From<PyErr> for CreationError {
    fn from(error: PyErr) -> CreationError {
        CreationError::Raised(error)
    }
}

/// The value of a parameter, if the scenario has one.
fn read<'py>(
    py: Python<'py>,
    parameters: &Parameters,
    one: &DeclaredParameter,
) -> Result<Option<Bound<'py, PyAny>>, CreationError> {
    let refused = CreationError::Parameter;
    let Some(unit) = &one.unit else {
        let found = parameters.get(&one.key, one.required).map_err(refused)?;
        return Ok(found.map(|value| of_toml(py, value)).transpose()?);
    };
    let found = parameters.numbers(&one.key, unit, one.required, one.count);
    Ok(match found.map_err(refused)? {
        None => None,
        Some(numbers) if one.count == 0 => {
            let number = numbers.first().copied().unwrap_or_default();
            Some(number.into_pyobject(py).map_err(PyErr::from)?.into_any())
        }
        Some(numbers) => Some(numbers.into_pyobject(py)?),
    })
}

/// The meaning of an exception while a participant is created: the parameter is rejected, or the class.
fn refusal(py: Python<'_>, error: PyErr, raised: &Raised) -> ParameterError {
    let value = error.value(py);
    let text = |name: &str| value.getattr(name).and_then(|part| part.extract::<String>());
    let own = py
        .import("escapement.errors")
        .and_then(|errors| errors.getattr("ParameterError"))
        .and_then(|class| value.is_instance(&class));
    if let (Ok(true), Ok(key), Ok(reason)) = (own, text("key"), text("reason")) {
        return ParameterError::new(key, reason);
    }
    let reason = one_line(py, &error);
    record_exception(py, error, raised);
    ParameterError::new(plugin::NO_PARTICIPANT, reason)
}

/// The exception with its traceback: before Python 3.12 the interpreter stores the two separately.
fn with_traceback<'py>(py: Python<'py>, error: &PyErr) -> Bound<'py, PyAny> {
    let value = error.value(py).clone().into_any();
    if let Some(traceback) = error.traceback(py) {
        // This cannot fail: an exception accepts its own traceback.
        let _ = value.setattr("__traceback__", traceback);
    }
    value
}

/// An exception in one line: its type, its message, and where in the user's code it was raised.
fn one_line(py: Python<'_>, error: &PyErr) -> String {
    let text = py
        .import("escapement.participant")
        .and_then(|module| module.call_method1("_short", (with_traceback(py, error),)))
        .and_then(|text| text.extract::<String>());
    text.unwrap_or_else(|_| error.to_string())
}

/// Logs the traceback and keeps the first exception.
fn record_exception(py: Python<'_>, error: PyErr, raised: &Raised) {
    let mut first = raised.lock().unwrap_or_else(PoisonError::into_inner);
    let log_traceback = || {
        let module = py.import("escapement.participant")?;
        module.call_method1("_log_traceback", (with_traceback(py, &error),))
    };
    // The exception is kept even if it cannot be logged.
    let _ = log_traceback();
    first.get_or_insert(error);
}

impl Participant for PyParticipant {
    fn interface(&self) -> Interface {
        self.interface.clone()
    }

    fn initialise(&mut self, t: f64, outputs: &mut Outputs) -> Result<(), Failure> {
        Python::attach(|py| {
            self.show_outputs(py, t, outputs);
            self.initialise
                .call1(py, (t,))
                .map_err(|error| self.failure(py, error))?;
            self.take_outputs(py, outputs);
            Ok(())
        })
    }

    fn step(&mut self, step: &Step, inputs: &Inputs, outputs: &mut Outputs) -> Result<(), Failure> {
        Python::attach(|py| {
            for (port, memory) in self.inputs.iter().enumerate() {
                memory.put(py, inputs.bytes(port));
            }
            self.show_outputs(py, step.t, outputs);
            let done = self.step.call1(py, (step.t, step.period));
            done.map_err(|error| self.failure(py, error))?;
            self.take_outputs(py, outputs);
            Ok(())
        })
    }

    fn terminate(&mut self, why: Termination, log: &Log) {
        // The interpreter may be shutting down: the run is over, or continues without this participant.
        let _ = Python::try_attach(|py| {
            let lines = Lines {
                log: log.clone(),
                t: log.time(),
            };
            *self.log.borrow_mut(py) = lines;
            if let Err(error) = self.terminate.call1(py, (why.name(),)) {
                log.write(format_args!("its `terminate` failed: {}", one_line(py, &error)));
                record_exception(py, error, &self.raised);
            }
        });
    }

    fn save(&self) -> Option<Vec<u8>> {
        Python::attach(|py| {
            let saved = self.save.call0(py).and_then(|state| {
                let state = state.into_bound(py);
                Ok(state.cast_into::<PyBytes>().map_err(PyErr::from)?.as_bytes().to_vec())
            });
            let failure = saved.as_ref().err().map(|error| one_line(py, error));
            self.save_failure.replace(failure);
            saved.map_err(|error| record_exception(py, error, &self.raised)).ok()
        })
    }

    fn save_failure(&self) -> Option<String> {
        self.save_failure.borrow().clone()
    }

    fn restore(&mut self, state: &[u8]) -> Result<(), Failure> {
        Python::attach(|py| {
            let restored = self.restore.call1(py, (PyBytes::new(py, state),));
            restored.map(|_| ()).map_err(|error| self.failure(py, error))
        })
    }
}
