//! A process that hosts one participant.

use pyo3::prelude::*;

use crate::participant::{PyParticipant, Raised};

/// Joins the run named by the environment with an object of `class`, and runs it to its end. Returns the exit code.
#[pyfunction]
pub(crate) fn host(py: Python<'_>, class: Py<PyAny>, program: String) -> u8 {
    let raised = Raised::default();
    let ended =
        py.detach(move || lockstep::host::run(move |setup| PyParticipant::make(&class, setup, &raised), &program));
    u8::from(ended != std::process::ExitCode::SUCCESS)
}
