//! Runs: executed to their end at once, or advanced from pause to pause.

use std::ffi::CString;
use std::path::PathBuf;
use std::sync::PoisonError;

use engine::Progress;
use engine::campaign::Figures;
use engine::run::{self as engine_run, Checkpoint, Ending, Options, Outcome, Record, RunFailure};
use lockstep::time::Rational;
use pyo3::exceptions::{PyRuntimeError, PyUserWarning};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use crate::observer::EventForwarder;
use crate::participant::Raised;
use crate::scenario::Scenario;
use crate::{errors, values};

/// A request to end in an orderly way, which a signal handler can make.
#[pyclass(frozen, module = "escapement._native")]
#[derive(Default)]
pub(crate) struct Interrupt(engine::Interrupt);

#[pymethods]
impl Interrupt {
    #[new]
    fn new() -> Interrupt {
        Interrupt::default()
    }

    /// Requests the end.
    fn request(&self) {
        self.0.request();
    }

    /// Whether the end was requested.
    fn is_requested(&self) -> bool {
        self.0.is_requested()
    }
}

/// The options of a run, apart from the scenario.
#[derive(FromPyObject)]
pub(crate) struct RunArguments {
    in_process: bool,
    record: String,
    out: Option<PathBuf>,
    force: bool,
    pace: Option<f64>,
    checkpoint_every: Option<String>,
    checkpoint_at: Vec<String>,
    patience: f64,
    resume: Option<PathBuf>,
    resume_from: Option<String>,
}

/// Parses `text`, the value of `option`, as a time.
fn time(py: Python<'_>, option: &str, text: &str) -> PyResult<Rational> {
    text.parse()
        .map_err(|error| errors::option(py, &format!("{option}: {error}, or a number of seconds")))
}

impl RunArguments {
    fn options(&self, py: Python<'_>, callback: Option<Py<PyAny>>, interrupt: &Interrupt) -> PyResult<Options> {
        let record = match self.record.as_str() {
            "folder" => Record::Folder,
            "memory" => Record::Memory,
            "digest" => Record::Digest,
            "nothing" => Record::Nothing,
            other => {
                let reason = format!("record={other:?}: write \"folder\", \"memory\", \"digest\" or \"nothing\"");
                return Err(errors::option(py, &reason));
            }
        };
        let origin = match &self.resume {
            None => None,
            Some(run) => {
                let folder = tape::folder::RunFolder::open(run);
                // The content of the tape is copied and sealed again.
                tape::Reader::open(&folder.tape())
                    .and_then(|tape| tape.verify())
                    .map_err(|error| errors::tape(py, &format!("the run cannot be resumed: {error}")))?;
                let from = self.resume_from.as_deref();
                let from = from.map(|text| time(py, "at", text)).transpose()?;
                let (checkpoint, left_out) = engine_run::checkpoint::Checkpoint::find(&folder.checkpoints(), from)
                    .map_err(|error| errors::run(py, &RunFailure::from(error)))?;
                for error in left_out {
                    let message = CString::new(format!("{error}; the file is left out"))?;
                    PyErr::warn(py, &py.get_type::<PyUserWarning>(), &message, 1)?;
                }
                Some(engine_run::Origin {
                    run: run.clone(),
                    checkpoint,
                })
            }
        };
        let every = self.checkpoint_every.as_deref();
        Ok(Options {
            in_process: self.in_process,
            record,
            out: self.out.clone(),
            force: self.force,
            progress: Progress::new(EventForwarder::new(callback, interrupt.0.clone())),
            interrupt: interrupt.0.clone(),
            pace: self.pace,
            checkpoint_every: every.map(|text| time(py, "checkpoint_every", text)).transpose()?,
            checkpoint_at: self
                .checkpoint_at
                .iter()
                .map(|text| time(py, "checkpoint_at", text))
                .collect::<PyResult<_>>()?,
            origin,
            patience_s: self.patience,
            // Several runs of one process would be pinned to the same cores.
            no_placement: self.in_process,
            ..Options::default()
        })
    }
}

/// Attaches the exception that made a run fail.
fn with_cause(py: Python<'_>, failure: PyErr, raised: &Raised) -> PyErr {
    let cause = raised.lock().unwrap_or_else(PoisonError::into_inner).take();
    if cause.is_some() {
        failure.set_cause(py, cause);
    }
    failure
}

fn outcome_dict<'py>(py: Python<'py>, outcome: &Outcome, raised: &Raised) -> PyResult<Bound<'py, PyDict>> {
    let all = PyDict::new(py);
    all.set_item("summary", values::of_json(py, &outcome.summary())?)?;
    all.set_item("folder", &outcome.folder)?;
    all.set_item("text", outcome.figures.as_ref().map(|figures| figures.text()))?;
    let status = match outcome.ending {
        Ending::Complete => "complete",
        Ending::Stopped { .. } => "stopped",
        Ending::Failed { .. } => "failed",
    };
    all.set_item("status", status)?;
    all.set_item("logs", &outcome.logs)?;
    all.set_item("reason", outcome.ending.reason())?;
    if let Ending::Failed { participant, .. } = &outcome.ending {
        all.set_item("participant", participant)?;
    }
    all.set_item("cause", raised.lock().unwrap_or_else(PoisonError::into_inner).take())?;
    Ok(all)
}

/// Runs `scenario` to its end. Returns the outcome; its summary is written if the run has a folder.
#[pyfunction]
#[pyo3(signature = (scenario, arguments, progress, interrupt))]
pub(crate) fn run<'py>(
    py: Python<'py>,
    scenario: &Bound<'py, Scenario>,
    arguments: RunArguments,
    progress: Option<Py<PyAny>>,
    interrupt: &Bound<'py, Interrupt>,
) -> PyResult<Bound<'py, PyDict>> {
    let own = scenario.get();
    let options = arguments.options(py, progress, interrupt.get())?;
    let outcome = py.detach(|| {
        let outcome = engine_run::run(&own.scenario, &options)?;
        if let Some(folder) = &outcome.folder {
            let folder = tape::folder::RunFolder::open(folder);
            folder.write_json(&folder.summary(), &outcome.summary())?;
        }
        Ok::<Outcome, RunFailure>(outcome)
    });
    let outcome = outcome.map_err(|failure| with_cause(py, errors::run(py, &failure), &own.raised))?;
    outcome_dict(py, &outcome, &own.raised)
}

/// The state of a run at an instant, in memory.
#[pyclass(frozen, module = "escapement._native")]
pub(crate) struct Saved(Checkpoint);

#[pymethods]
impl Saved {
    /// The instant, s.
    #[getter]
    fn time(&self) -> f64 {
        self.0.time().seconds()
    }
}

/// A run that advances on request. It belongs to the thread that starts it.
#[pyclass(unsendable, module = "escapement._native")]
pub(crate) struct Run {
    run: Option<engine_run::Run>,
    raised: Raised,
}

/// A run passed to code that runs with the interpreter released, on the same thread.
struct SendRun<'a>(&'a mut engine_run::Run);

// SAFETY: the code runs on the thread that released the interpreter; the run never leaves that thread.
unsafe impl Send for SendRun<'_> {}

impl Run {
    pub(crate) fn active(&mut self) -> PyResult<&mut engine_run::Run> {
        let ended = || PyRuntimeError::new_err("the run has ended: start another one");
        self.run.as_mut().ok_or_else(ended)
    }

    /// Calls `work` with the interpreter released.
    pub(crate) fn detached<T: Send>(
        &mut self,
        py: Python<'_>,
        work: impl FnOnce(&mut engine_run::Run) -> Result<T, RunFailure> + Send,
    ) -> PyResult<T> {
        let here = SendRun(self.active()?);
        let done = py.detach(move || {
            // Moves the whole of `here`, not only the reference in it.
            let here = here;
            work(here.0)
        });
        done.map_err(|failure| with_cause(py, errors::run(py, &failure), &self.raised))
    }
}

#[pymethods]
impl Run {
    /// Starts `scenario`: all participants are started, and the run is paused at its start.
    #[new]
    fn start(
        py: Python<'_>,
        scenario: &Bound<'_, Scenario>,
        arguments: RunArguments,
        progress: Option<Py<PyAny>>,
        interrupt: &Bound<'_, Interrupt>,
    ) -> PyResult<Run> {
        let own = scenario.get();
        let options = arguments.options(py, progress, interrupt.get())?;
        struct Made(Result<engine_run::Run, RunFailure>);
        // SAFETY: as of `SendRun`.
        unsafe impl Send for Made {}
        let made = py.detach(|| Made(engine_run::Run::start(&own.scenario, &options)));
        match made.0 {
            Ok(run) => Ok(Run {
                run: Some(run),
                raised: own.raised.clone(),
            }),
            Err(failure) => Err(with_cause(py, errors::run(py, &failure), &own.raised)),
        }
    }

    /// The present time, s: all participants have executed exactly their activations before this instant.
    #[getter]
    fn now(&mut self) -> PyResult<f64> {
        Ok(self.active()?.now_s())
    }

    /// Whether the run is over: no activation follows.
    #[getter]
    fn is_over(&mut self) -> PyResult<bool> {
        Ok(self.active()?.is_over())
    }

    /// Advances the run to the instant `to`.
    fn run_to(&mut self, py: Python<'_>, to: &str) -> PyResult<()> {
        let to = time(py, "run_to", to)?;
        self.detached(py, |run| run.run_to(to))
    }

    /// Advances the run to the next communication point.
    fn step(&mut self, py: Python<'_>) -> PyResult<()> {
        self.detached(py, engine_run::Run::step)
    }

    /// The newest sample of an output: index, stamp and payload.
    fn newest<'py>(&mut self, py: Python<'py>, port: &str) -> PyResult<(u64, f64, Bound<'py, PyBytes>)> {
        let sample = self
            .active()?
            .newest(port)
            .map_err(|failure| errors::run(py, &failure))?;
        Ok((sample.index(), sample.stamp_s(), PyBytes::new(py, sample.bytes())))
    }

    /// Advances the run until a participant is about to step; returns whether it has a further activation.
    fn run_to_step(&mut self, py: Python<'_>, participant: &str) -> PyResult<bool> {
        self.detached(py, |run| run.run_to_step(participant))
    }

    /// The sample that an input has in the activation before whose step its participant is paused: index, instant and payload.
    fn read_input<'py>(&mut self, py: Python<'py>, port: &str) -> PyResult<(u64, f64, Bound<'py, PyBytes>)> {
        let sample = self
            .active()?
            .read_input(port)
            .map_err(|failure| errors::run(py, &failure))?;
        Ok((sample.index(), sample.stamp_s(), PyBytes::new(py, sample.bytes())))
    }

    /// Supplies an output for that activation.
    fn set_output(&mut self, py: Python<'_>, port: &str, payload: &[u8]) -> PyResult<()> {
        self.active()?
            .set_output_bytes(port, payload)
            .map_err(|failure| errors::run(py, &failure))
    }

    /// The descriptor of a port's payload; None if there is no such port.
    fn descriptor<'py>(&mut self, py: Python<'py>, port: &str) -> PyResult<Option<Bound<'py, PyAny>>> {
        let (participant, name) = port.split_once('.').unwrap_or((port, ""));
        let interface = self.active()?.interface(participant);
        let interface = interface.map_err(|failure| errors::run(py, &failure))?;
        let inputs = interface.inputs.iter().map(|port| (&port.name, &port.descriptor));
        let mut all = inputs.chain(interface.outputs.iter().map(|port| (&port.name, &port.descriptor)));
        let found = all.find(|(own, _)| *own == name);
        found
            .map(|(_, descriptor)| {
                values::of_json(
                    py,
                    &serde_json::to_value(descriptor).expect("a descriptor is texts and numbers"),
                )
            })
            .transpose()
    }

    /// Sets an unconnected input.
    fn set(&mut self, py: Python<'_>, port: &str, payload: &[u8]) -> PyResult<()> {
        self.active()?
            .set_bytes(port, payload)
            .map_err(|failure| errors::run(py, &failure))
    }

    /// The log of a participant.
    fn log(&mut self, py: Python<'_>, participant: &str) -> PyResult<String> {
        let log = self.active()?.log(participant);
        log.map_err(|failure| errors::run(py, &failure))
    }

    /// The values so far of the figures `names`; None for one that has no value yet.
    fn figures(&mut self, names: Vec<String>) -> PyResult<Vec<Option<f64>>> {
        let figures = self.active()?.figures().map(|figures| Figures::of(&figures));
        let numbers: Vec<_> = figures.iter().flat_map(Figures::numbers).collect();
        let value = |name: &String| {
            let found = numbers
                .iter()
                .find(|number| number.key == *name || number.name == *name);
            found.and_then(|number| number.value)
        };
        Ok(names.iter().map(value).collect())
    }

    /// The state of all participants.
    fn save(&mut self, py: Python<'_>) -> PyResult<Saved> {
        self.detached(py, engine_run::Run::save).map(Saved)
    }

    /// Restores `saved`.
    fn restore(&mut self, py: Python<'_>, saved: &Bound<'_, Saved>) -> PyResult<()> {
        let checkpoint = &saved.get().0;
        self.detached(py, |run| run.restore(checkpoint))
    }

    /// Abandons the run if it has not ended: its processes end, and its tape is not sealed.
    fn close(&mut self) {
        self.run = None;
    }

    /// Ends the run and returns its outcome.
    fn end<'py>(&mut self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        struct Ended(engine_run::Run);
        // SAFETY: as of `SendRun`.
        unsafe impl Send for Ended {}
        self.active()?;
        let Some(run) = self.run.take().map(Ended) else {
            return Err(PyRuntimeError::new_err("the run has ended"));
        };
        let outcome = py.detach(move || {
            let run = run;
            run.0.end()
        });
        let outcome = outcome.map_err(|failure| errors::run(py, &failure))?;
        outcome_dict(py, &outcome, &self.raised)
    }
}
