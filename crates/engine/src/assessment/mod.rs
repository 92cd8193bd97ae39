//! What a run is judged by: figures of merit, computed while the samples pass by.

mod fields;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

pub use fields::{Numbers, stream};

/// A figure with a limit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Criterion {
    /// Which figure.
    pub name: String,
    /// What it is, in `unit`; absent when it was not measured.
    pub value: Option<f64>,
    /// The largest value that is a success.
    pub limit: f64,
    /// The unit of both.
    pub unit: String,
    /// Whether it is one.
    pub met: bool,
}

/// The figures of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Figures {
    /// The figures as they stand in `summary.json`, by name with unit suffix.
    pub values: Map<String, Value>,
    /// The criteria and what became of them.
    pub criteria: Vec<Criterion>,
    /// Why there is no verdict, when the run ended too early.
    pub incomplete: Option<String>,
    /// The figures for people, without a line end behind the last line.
    pub text: String,
}

impl Figures {
    /// Whether there is a verdict and every criterion is met.
    pub fn met(&self) -> bool {
        self.incomplete.is_none() && self.criteria.iter().all(|criterion| criterion.met)
    }

    /// The figure called `name`, if it is a number.
    pub fn number(&self, name: &str) -> Option<f64> {
        self.values.get(name).and_then(Value::as_f64)
    }
}

/// An assessment under way. The order in which samples of different streams arrive does not matter.
pub trait Assessment: Send {
    /// Takes in a sample of stream number `stream` with its stamp, s.
    fn sample(&mut self, stream: usize, stamp_s: f64, payload: &[u8]);

    /// The figures of what has been seen.
    fn finish(&mut self) -> Figures;
}
