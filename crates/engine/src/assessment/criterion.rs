//! Criteria: figures with a limit, and their text.

use serde::{Deserialize, Serialize};

use crate::text::three_digits;

/// A figure with a limit.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Criterion {
    /// The figure.
    pub name: String,
    /// Its value, in `unit`; absent when it was not measured.
    pub value: Option<f64>,
    /// The largest value that is a success; no upper limit unless given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub limit: Option<f64>,
    /// The least value that is a success.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at_least: Option<f64>,
    /// The unit of all.
    pub unit: String,
    /// Whether the criterion is met.
    pub met: bool,
    /// The instant at which the figure was reached, s, where it is the value of an instant.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub t_s: Option<f64>,
    /// Why it was not measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
}

impl Criterion {
    /// `at most 5.00 mm`, `at least 2`, `from 1.00 to 2.00 N`
    pub fn limits(&self) -> String {
        let unit = unit_suffix(&self.unit);
        match (self.at_least, self.limit) {
            (Some(least), Some(most)) => format!("from {} to {}{unit}", three_digits(least), three_digits(most)),
            (Some(least), None) => format!("at least {}{unit}", three_digits(least)),
            (None, Some(most)) => format!("at most {}{unit}", three_digits(most)),
            (None, None) => String::new(),
        }
    }

    /// The amount by which it is missed, and when: `2.00 mm too much at t = 3.2 s`. `None` where it is met or was not
    /// measured.
    pub fn miss(&self) -> Option<String> {
        let value = self.value.filter(|_| !self.met)?;
        let (by, word) = match (self.limit, self.at_least) {
            (Some(most), _) if value > most => (value - most, "much"),
            (_, Some(least)) if value < least => (least - value, "little"),
            _ => return None,
        };
        let when = self.t_s.map_or(String::new(), |t_s| format!(" at t = {t_s} s"));
        Some(format!(
            "{}{} too {word}{when}",
            three_digits(by),
            unit_suffix(&self.unit)
        ))
    }

    /// A line of text: the figure, the limit, and by how much and when it is missed.
    pub fn line(&self) -> String {
        let mark = if self.met { "ok  " } else { "FAIL" };
        let value = match (self.value, &self.reason) {
            (Some(value), _) => format!("{}{}", three_digits(value), unit_suffix(&self.unit)),
            (None, Some(reason)) => format!("not measured: {reason}"),
            (None, None) => "not measured".to_owned(),
        };
        let miss = self.miss().map_or(String::new(), |miss| format!(": {miss}"));
        let name = self.name.replace('_', " ");
        format!("  {mark} {name:<28} {value} ({}){miss}", self.limits())
    }
}

/// A unit after a number: empty for a pure number.
pub fn unit_suffix(unit: &str) -> String {
    if unit == "1" || unit.is_empty() {
        String::new()
    } else {
        format!(" {unit}")
    }
}
