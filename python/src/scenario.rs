//! Scenarios whose programs may be Python classes.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, PoisonError};

use engine::Catalogue;
use engine::run::{self, CheckedScenario, Options};
use engine::scenario::{self, Changes, FaultSpec, Program};
use lockstep::participant::{Factory, Interface, Kind};
use lockstep::port::Descriptor;
use lockstep::time::Rational;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::participant::{PyParticipant, Raised};
use crate::{errors, values};

/// A scenario that was read and checked.
#[pyclass(frozen, module = "escapement._native")]
pub(crate) struct Scenario {
    catalogue: Arc<Catalogue>,
    pub(crate) scenario: scenario::Scenario,
    pub(crate) raised: Raised,
}

/// The module and class of a Python host among a program's arguments.
fn class_of(program: &Program) -> Option<(&Path, &str)> {
    let Program::External { args, folder, .. } = program else {
        return None;
    };
    match &args[..] {
        [option, host, class] if option == "-m" && host == "escapement.host" => Some((folder, class)),
        _ => None,
    }
}

/// The factory that creates in this process what a host would create: from `classes`, by the host's argument, or by importing the class.
fn in_process_factory(program: &Program, classes: &HashMap<String, Py<PyAny>>, raised: &Raised) -> Option<Factory> {
    let (folder, name) = class_of(program)?;
    let class = Python::attach(|py| match classes.get(name) {
        Some(class) => Ok(class.clone_ref(py)),
        None => {
            let host = py.import("escapement.host")?;
            let folder = folder.display().to_string();
            host.call_method1("find", (name, folder)).map(Bound::unbind)
        }
    });
    let raised = raised.clone();
    Some(match class {
        Ok(class) => Arc::new(move |setup| PyParticipant::make(&class, setup, &raised)),
        Err(error) => {
            let reason = error.to_string();
            *raised.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
            Arc::new(move |_| {
                Err(lockstep::participant::ParameterError::new(
                    plugin::NO_PARTICIPANT,
                    &reason,
                ))
            })
        }
    })
}

#[pymethods]
impl Scenario {
    /// Reads `file`, or `text` as if it were its content, with `set` in the syntax of `--set` and `faults` in that of `--fault`.
    #[new]
    fn read(
        py: Python<'_>,
        file: PathBuf,
        text: Option<&str>,
        set: Vec<String>,
        faults: Vec<String>,
        classes: HashMap<String, Py<PyAny>>,
    ) -> PyResult<Scenario> {
        let raised = Raised::default();
        let first_exception = raised.clone();
        let catalogue = orchestrator::stock::catalogue()
            .within(move |program| in_process_factory(program, &classes, &first_exception));
        let catalogue = Arc::new(catalogue);
        let faults = faults.iter().map(|fault| {
            let read = fault.parse::<FaultSpec>();
            read.map_err(|reason| errors::key(py, &file, "faults", &format!("{reason} (in `{fault}`)")))
        });
        let changes = Changes {
            set,
            faults: faults.collect::<PyResult<_>>()?,
            ..Changes::default()
        };
        let scenario = match text {
            None => scenario::Scenario::changed(&catalogue, &file, &changes),
            Some(text) => scenario::Scenario::changed_text(&catalogue, &file, text, &changes),
        };
        let scenario = scenario.map_err(|error| errors::scenario(py, &error))?;
        Ok(Scenario {
            catalogue,
            scenario,
            raised,
        })
    }

    #[getter]
    fn name(&self) -> &str {
        &self.scenario.name
    }

    #[getter]
    fn title(&self) -> &str {
        &self.scenario.title
    }

    /// s.
    #[getter]
    fn duration(&self) -> f64 {
        self.scenario.duration.seconds()
    }

    #[getter]
    fn seed(&self) -> u64 {
        self.scenario.seed
    }

    #[getter]
    fn participants(&self) -> Vec<&str> {
        (self.scenario.participants.iter())
            .map(|entry| entry.setup.name.as_str())
            .collect()
    }

    /// Period and offset of a participant as fractions of a second, numerators first.
    fn timing(&self, name: &str) -> Option<((i64, i64), (i64, i64))> {
        let entry = self
            .scenario
            .participants
            .iter()
            .find(|entry| entry.setup.name == name)?;
        let exact = |time: Rational| (time.numerator(), time.denominator());
        Some((exact(entry.period), exact(entry.offset)))
    }

    /// The scenario with files and changes filled in, as tables.
    fn table<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        values::of_toml(py, &toml::Value::Table(self.scenario.written().to_table()))
    }

    /// Whether all participants can run in this process.
    fn runs_here(&self) -> bool {
        let foreign = |program: &Program| program.is_external() && class_of(program).is_none();
        !self.scenario.programs().any(foreign)
    }

    /// Whether a run in separate processes starts the program `escapement` as a host.
    fn needs_program(&self) -> bool {
        self.scenario.programs().any(|program| !program.is_external())
    }

    /// Warnings: what is valid, but probably not intended.
    fn warnings(&self) -> Vec<String> {
        self.catalogue.warnings(&self.scenario)
    }

    /// The ports and links, without a run. With `here`, every participant is created in this process; otherwise each separate program is
    /// started and queried.
    fn check<'py>(&self, py: Python<'py>, here: bool) -> PyResult<Bound<'py, PyDict>> {
        let known = py.detach(|| {
            if here {
                run::check_here(&self.scenario).map_err(run::RunFailure::from)
            } else {
                run::check_with_programs(&self.scenario, &Options::default())
            }
        });
        let known = known.map_err(|failure| errors::run(py, &failure))?;
        let all = PyDict::new(py);
        all.set_item("participants", participants(py, self, &known)?)?;
        let links = PyList::empty(py);
        for (from, to, timing) in self.scenario.links() {
            links.append((from, to, timing.delay.seconds()))?;
        }
        all.set_item("links", links)?;
        let figures = engine::campaign::figures_of(&self.scenario, &known.plan);
        all.set_item(
            "figures",
            figures.numbers().map(|number| number.name).collect::<Vec<_>>(),
        )?;
        Ok(all)
    }
}

fn participants<'py>(py: Python<'py>, own: &Scenario, known: &CheckedScenario) -> PyResult<Bound<'py, PyDict>> {
    let all = PyDict::new(py);
    for (entry, interface) in own.scenario.participants.iter().zip(&known.interfaces) {
        let one = PyDict::new(py);
        one.set_item("period", entry.period.seconds())?;
        one.set_item("offset", entry.offset.seconds())?;
        if let Some(interface) = interface {
            ports(&one, interface)?;
        }
        all.set_item(&entry.setup.name, one)?;
    }
    Ok(all)
}

fn ports(one: &Bound<'_, PyDict>, interface: &Interface) -> PyResult<()> {
    let py = one.py();
    let kind = match interface.kind {
        Kind::Sampled => "sampled",
        Kind::Continuous => "continuous",
    };
    one.set_item("kind", kind)?;
    let inputs = interface.inputs.iter().map(|port| (&port.name, &port.descriptor));
    let outputs = interface.outputs.iter().map(|port| (&port.name, &port.descriptor));
    one.set_item("inputs", described(py, inputs)?)?;
    one.set_item("outputs", described(py, outputs)?)?;
    Ok(())
}

fn described<'a, 'py>(
    py: Python<'py>,
    ports: impl Iterator<Item = (&'a String, &'a Descriptor)>,
) -> PyResult<Bound<'py, PyDict>> {
    let all = PyDict::new(py);
    for (name, descriptor) in ports {
        let descriptor = serde_json::to_value(descriptor).expect("a descriptor is texts and numbers");
        all.set_item(name, values::of_json(py, &descriptor)?)?;
    }
    Ok(all)
}
