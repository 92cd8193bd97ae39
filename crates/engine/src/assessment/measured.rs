//! Values of the figures that a scenario declares.

use serde_json::{Map, Value, json};

use super::criterion::{Criterion, unit_suffix};
use crate::text::three_digits;

/// A declared figure.
#[derive(Debug, Clone, PartialEq)]
pub struct Measured {
    /// Its name.
    pub name: String,
    /// The unit of the figure.
    pub unit: String,
    /// A number, or a list of numbers; null where it was not measured.
    pub value: Value,
    /// The instants at which these values were reached, s, where they are values of an instant; else null.
    pub t_s: Value,
    /// Why it, or an element of it, was not measured.
    pub reason: Option<String>,
    /// Its criterion, where there is a limit.
    pub criterion: Option<Criterion>,
}

impl Measured {
    /// As written to `summary.json`.
    pub fn json(&self) -> Value {
        let mut entry = Map::new();
        entry.insert("value".into(), self.value.clone());
        entry.insert("unit".into(), json!(self.unit));
        if !self.t_s.is_null() {
            entry.insert("t_s".into(), self.t_s.clone());
        }
        if let Some(reason) = &self.reason {
            entry.insert("reason".into(), json!(reason));
        }
        Value::Object(entry)
    }

    /// A line of text: that of the criterion, or the figure.
    pub fn line(&self) -> String {
        if let Some(criterion) = &self.criterion {
            return criterion.line();
        }
        let one = |value: &Value| value.as_f64().map_or("not measured".to_owned(), three_digits);
        let values = match &self.value {
            Value::Array(all) => format!("[{}]", all.iter().map(one).collect::<Vec<_>>().join(", ")),
            value => one(value),
        };
        let unit = if self.value.is_null() {
            String::new()
        } else {
            unit_suffix(&self.unit)
        };
        let when = self
            .t_s
            .as_f64()
            .map_or(String::new(), |t_s| format!(" at t = {t_s} s"));
        let reason = self
            .reason
            .as_ref()
            .map_or(String::new(), |reason| format!(": {reason}"));
        let name = self.name.replace('_', " ");
        format!("       {name:<28} {values}{unit}{when}{reason}")
    }
}
