//! `escapement._native`: the Rust part of the Python package. Built only with the feature `module`.
#![cfg(feature = "module")]

mod agent;
mod errors;
mod host;
mod memory;
mod observer;
mod participant;
mod run;
mod scenario;
mod values;

use std::path::PathBuf;

use lockstep::random::Stream;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use report::page::{Report, Request};

/// The functions and classes behind the package `escapement`.
#[pymodule]
mod _native {
    #[pymodule_export]
    use super::agent::Agent;
    #[pymodule_export]
    use super::host::host;
    #[pymodule_export]
    use super::run::{Interrupt, Run, Saved, run};
    #[pymodule_export]
    use super::scenario::Scenario;
    #[pymodule_export]
    use super::{convert, normal, program, report_html, uniform, version};
}

/// The version with the commit that it was built from.
#[pyfunction]
fn version() -> String {
    orchestrator::stock::catalogue().version().to_owned()
}

/// Sets the path of the program `escapement`, which hosts participants in separate processes.
#[pyfunction]
fn program(path: PathBuf) {
    engine::run::set_own_program(path);
}

/// A number in [0, 1), determined by the run's seed, the stream's name and the index.
#[pyfunction]
fn uniform(seed: u64, stream: &str, index: u64) -> f64 {
    Stream::new(seed, stream).uniform(index)
}

/// A standard normal number, determined by the run's seed, the stream's name and the index.
#[pyfunction]
fn normal(seed: u64, stream: &str, index: u64) -> f64 {
    Stream::new(seed, stream).normal(index)
}

/// The numbers of `text`, such as `"[-1, 1] cm"`, in `unit`.
#[pyfunction]
fn convert(text: &str, unit: &str) -> PyResult<Vec<f64>> {
    let converted = lockstep::units::convert(text, unit);
    converted
        .map(|(numbers, _)| numbers)
        .map_err(|error| PyValueError::new_err(error.to_string()))
}

/// The report page about the runs in these folders.
#[pyfunction]
fn report_html(py: Python<'_>, folders: Vec<PathBuf>, labels: Vec<String>) -> PyResult<String> {
    let catalogue = orchestrator::stock::catalogue();
    let request = Request {
        folders: &folders,
        labels: &labels,
        models: &[],
        views: catalogue.views(),
    };
    let page = py.detach(|| Report::read(&request).map(|report| report.html()));
    page.map_err(|error| errors::tape(py, &error.to_string()))
}
