//! `[guards.NAME]` as a value: a condition on an output.

use serde::{Deserialize, Serialize};
use toml::Value;

use super::time::Time;

/// Conditions that an output must never violate.
#[derive(Debug, Clone, Default, PartialEq, Deserialize, Serialize)]
#[serde(
    deny_unknown_fields,
    rename_all = "kebab-case",
    expecting = "a table with the keys of a guard, such as { output = \"PARTICIPANT.OUTPUT\", frozen-for = \"1 s\" }"
)]
pub struct GuardSpec {
    /// `PARTICIPANT.OUTPUT`
    pub output: String,
    /// The field or element; all of the output unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub field: Option<String>,
    /// The bounds of a field, with its unit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range: Option<Value>,
    /// Values of an enumeration or a boolean that must not occur.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub never: Option<Value>,
    /// The time for which the output must not stay unchanged.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frozen_for: Option<Time>,
}

impl GuardSpec {
    /// A guard of an output, without any condition yet.
    pub fn new(output: &str) -> GuardSpec {
        GuardSpec {
            output: output.to_owned(),
            ..GuardSpec::default()
        }
    }

    /// Sets the field or element that it checks.
    #[must_use]
    pub fn field(mut self, field: &str) -> GuardSpec {
        self.field = Some(field.to_owned());
        self
    }

    /// Sets the bounds of the field, such as `"[-10, 10] N m"`.
    #[must_use]
    pub fn range(mut self, range: impl Into<Value>) -> GuardSpec {
        self.range = Some(range.into());
        self
    }

    /// Sets the values that must not occur.
    #[must_use]
    pub fn never(mut self, never: impl Into<Value>) -> GuardSpec {
        self.never = Some(never.into());
        self
    }

    /// Sets the time for which the output must not stay unchanged.
    #[must_use]
    pub fn frozen_for(mut self, time: impl Into<Time>) -> GuardSpec {
        self.frozen_for = Some(time.into());
        self
    }
}
