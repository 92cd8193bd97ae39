//! Errors of the engine as exceptions of the package.

use std::path::Path;

use engine::run::RunFailure;
use engine::scenario::ScenarioError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Raises the exception `name` of `escapement.errors`, with its arguments.
fn raise(py: Python<'_>, name: &str, message: &str, carries: &[(&str, &Bound<'_, PyAny>)]) -> PyErr {
    let made = || -> PyResult<PyErr> {
        let class = py.import("escapement.errors")?.getattr(name)?;
        let keywords = PyDict::new(py);
        for (key, value) in carries {
            keywords.set_item(key, value)?;
        }
        Ok(PyErr::from_value(class.call((message,), Some(&keywords))?))
    };
    made().unwrap_or_else(|error| error)
}

/// A rejected scenario: file, line, key and reason of each mistake.
pub(crate) fn scenario(py: Python<'_>, error: &ScenarioError) -> PyErr {
    let mistakes = (error.mistakes.iter()).map(|mistake| (mistake.line, mistake.key.as_str(), mistake.reason.as_str()));
    refused(py, &error.file, &error.to_string(), mistakes.collect())
}

/// An invalid change of the scenario in `file`.
pub(crate) fn key(py: Python<'_>, file: &Path, key: &str, reason: &str) -> PyErr {
    let message = format!("{}: {key}: {reason}", file.display());
    refused(py, file, &message, vec![(None, key, reason)])
}

fn refused(py: Python<'_>, file: &Path, message: &str, mistakes: Vec<(Option<usize>, &str, &str)>) -> PyErr {
    let file = file.display().to_string();
    let carried = file
        .into_pyobject(py)
        .map_err(PyErr::from)
        .and_then(|file| Ok((file, mistakes.into_pyobject(py)?)));
    match carried {
        Ok((file, mistakes)) => {
            let carries = [("file", file.as_any()), ("mistakes", mistakes.as_any())];
            raise(py, "ScenarioError", message, &carries)
        }
        Err(error) => error,
    }
}

/// A run that cannot start, or cannot continue.
pub(crate) fn run(py: Python<'_>, failure: &RunFailure) -> PyErr {
    match failure {
        RunFailure::Scenario(error) => scenario(py, error),
        RunFailure::Participant { participant, .. } | RunFailure::Substitute { participant, .. } => {
            match participant.as_str().into_pyobject(py) {
                Ok(participant) => raise(
                    py,
                    "RunError",
                    &failure.to_string(),
                    &[("participant", participant.as_any())],
                ),
                Err(error) => error.into(),
            }
        }
        RunFailure::Option { .. } => raise(py, "OptionError", &failure.to_string(), &[]),
        RunFailure::Port { .. } => raise(py, "PortError", &failure.to_string(), &[]),
        other => raise(py, "RunError", &other.to_string(), &[]),
    }
}

/// An option with a value that it cannot have.
pub(crate) fn option(py: Python<'_>, message: &str) -> PyErr {
    raise(py, "OptionError", message, &[])
}

/// A tape that cannot be read.
pub(crate) fn tape(py: Python<'_>, message: &str) -> PyErr {
    raise(py, "TapeError", message, &[])
}
