//! `[measures.NAME]` as a value: a signal, what is computed of it, and its limits.

use serde::{Deserialize, Serialize};
use toml::Value;

use super::time::Time;

/// The computation on a signal.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum MeasureKind {
    /// The least value.
    Min,
    /// The largest value.
    Max,
    /// The largest magnitude.
    #[default]
    MaxAbs,
    /// The mean.
    Mean,
    /// The root of the mean square.
    Rms,
    /// The last value.
    Final,
    /// The value at one instant.
    At,
    /// The largest value minus the least one.
    Range,
    /// The integral over time.
    Integral,
    /// The integral of the magnitude.
    IntegralAbs,
    /// The largest rate of change.
    Rate,
    /// How long it is above a threshold.
    TimeAbove,
    /// How long it is below a threshold.
    TimeBelow,
    /// When it first crosses a threshold.
    FirstCrossing,
    /// The time from which on it stays in a band.
    SettlingTime,
    /// How often it changes.
    Changes,
    /// The value that a given percentage does not exceed.
    Percentile,
}

/// How the elements of a field are reduced to one signal.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum ThroughKind {
    /// Their Euclidean norm.
    Norm,
    /// The angle of an attitude.
    Angle,
}

/// A figure that the scenario declares, and its limits.
#[derive(Debug, Clone, Default, PartialEq, Deserialize, Serialize)]
#[serde(
    deny_unknown_fields,
    rename_all = "kebab-case",
    expecting = "a table with the keys of a measure, such as { of = \"PARTICIPANT.OUTPUT.FIELD\", compute = \"max\" }"
)]
pub struct MeasureSpec {
    /// `PARTICIPANT.OUTPUT.FIELD`
    pub of: String,
    /// A value of an enumeration: the signal is 1 while the field has this value, and 0 otherwise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub is: Option<Value>,
    /// A signal that is subtracted, as in `of`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub minus: Option<String>,
    /// How the elements are reduced to one signal.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub through: Option<ThroughKind>,
    /// The computation.
    pub compute: MeasureKind,
    /// The start of the window.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub from: Option<Time>,
    /// The end of the window.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub to: Option<Time>,
    /// The instant.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub at: Option<Time>,
    /// The threshold, with its unit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub threshold: Option<Value>,
    /// The band in which it settles, with its unit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub band: Option<Value>,
    /// The percentage.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub percent: Option<f64>,
    /// The unit of the figure; that of the field unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unit: Option<String>,
    /// The largest acceptable value.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub at_most: Option<Value>,
    /// The least acceptable value.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub at_least: Option<Value>,
    /// Both limits.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub within: Option<Value>,
}

impl MeasureSpec {
    /// A measure of the field `of`, over the whole run and without a limit.
    pub fn new(of: &str, compute: MeasureKind) -> MeasureSpec {
        MeasureSpec {
            of: of.to_owned(),
            compute,
            ..MeasureSpec::default()
        }
    }

    /// Subtracts another signal, `PARTICIPANT.OUTPUT.FIELD`.
    #[must_use]
    pub fn minus(mut self, other: &str) -> MeasureSpec {
        self.minus = Some(other.to_owned());
        self
    }

    /// Sets how the elements are reduced to one signal.
    #[must_use]
    pub fn through(mut self, through: ThroughKind) -> MeasureSpec {
        self.through = Some(through);
        self
    }

    /// Sets the start of the window.
    #[must_use]
    pub fn from(mut self, time: impl Into<Time>) -> MeasureSpec {
        self.from = Some(time.into());
        self
    }

    /// Sets the end of the window.
    #[must_use]
    pub fn to(mut self, time: impl Into<Time>) -> MeasureSpec {
        self.to = Some(time.into());
        self
    }

    /// Sets the instant.
    #[must_use]
    pub fn at(mut self, time: impl Into<Time>) -> MeasureSpec {
        self.at = Some(time.into());
        self
    }

    /// Sets the threshold, such as `"5 mm"`.
    #[must_use]
    pub fn threshold(mut self, threshold: impl Into<Value>) -> MeasureSpec {
        self.threshold = Some(threshold.into());
        self
    }

    /// Sets the band in which it settles, such as `"[-2, 2] mm"`.
    #[must_use]
    pub fn band(mut self, band: impl Into<Value>) -> MeasureSpec {
        self.band = Some(band.into());
        self
    }

    /// Sets the largest acceptable value.
    #[must_use]
    pub fn at_most(mut self, limit: impl Into<Value>) -> MeasureSpec {
        self.at_most = Some(limit.into());
        self
    }

    /// Sets the least acceptable value.
    #[must_use]
    pub fn at_least(mut self, limit: impl Into<Value>) -> MeasureSpec {
        self.at_least = Some(limit.into());
        self
    }
}
