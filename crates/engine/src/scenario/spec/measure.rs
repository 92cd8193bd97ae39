//! `[measures.NAME]`

use serde::{Deserialize, Serialize};
use toml::Value;

use super::time::Time;

/// What is computed of a signal.
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
    /// The largest value less the least one.
    Range,
    /// The integral over time.
    Integral,
    /// The integral of the magnitude.
    IntegralAbs,
    /// The largest change per time.
    Rate,
    /// How long it is above a threshold.
    TimeAbove,
    /// How long it is below a threshold.
    TimeBelow,
    /// When it first crosses a threshold.
    FirstCrossing,
    /// From when on it stays in a band.
    SettlingTime,
    /// How often it changes.
    Changes,
    /// The value that so many percent do not exceed.
    Percentile,
}

/// What becomes of the elements of a field.
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
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct MeasureSpec {
    /// `PARTICIPANT.OUTPUT.FIELD`
    pub of: String,
    /// One value of an enumeration or a truth value, which is then 1 or 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub is: Option<Value>,
    /// What is subtracted, as `of`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub minus: Option<String>,
    /// What becomes of the elements.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub through: Option<ThroughKind>,
    /// What is computed.
    pub compute: MeasureKind,
    /// From when on.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub from: Option<Time>,
    /// Until when.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub to: Option<Time>,
    /// At which instant.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub at: Option<Time>,
    /// What is crossed, with its unit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub threshold: Option<Value>,
    /// Where it settles, with its unit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub band: Option<Value>,
    /// Which percentile.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub percent: Option<f64>,
    /// The unit of the figure; that of the field unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unit: Option<String>,
    /// The most that is good.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub at_most: Option<Value>,
    /// The least that is good.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub at_least: Option<Value>,
    /// Both.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub within: Option<Value>,
}

impl MeasureSpec {
    /// What is computed of the field `of`, over the whole run and without a limit.
    pub fn new(of: &str, compute: MeasureKind) -> MeasureSpec {
        MeasureSpec {
            of: of.to_owned(),
            compute,
            ..MeasureSpec::default()
        }
    }

    /// What is subtracted, as `PARTICIPANT.OUTPUT.FIELD`.
    #[must_use]
    pub fn minus(mut self, other: &str) -> MeasureSpec {
        self.minus = Some(other.to_owned());
        self
    }

    /// What becomes of the elements.
    #[must_use]
    pub fn through(mut self, through: ThroughKind) -> MeasureSpec {
        self.through = Some(through);
        self
    }

    /// From when on.
    #[must_use]
    pub fn from(mut self, time: impl Into<Time>) -> MeasureSpec {
        self.from = Some(time.into());
        self
    }

    /// Until when.
    #[must_use]
    pub fn to(mut self, time: impl Into<Time>) -> MeasureSpec {
        self.to = Some(time.into());
        self
    }

    /// At which instant.
    #[must_use]
    pub fn at(mut self, time: impl Into<Time>) -> MeasureSpec {
        self.at = Some(time.into());
        self
    }

    /// What is crossed, such as `"5 mm"`.
    #[must_use]
    pub fn threshold(mut self, threshold: impl Into<Value>) -> MeasureSpec {
        self.threshold = Some(threshold.into());
        self
    }

    /// Where it settles, such as `"[-2, 2] mm"`.
    #[must_use]
    pub fn band(mut self, band: impl Into<Value>) -> MeasureSpec {
        self.band = Some(band.into());
        self
    }

    /// The most that is good.
    #[must_use]
    pub fn at_most(mut self, limit: impl Into<Value>) -> MeasureSpec {
        self.at_most = Some(limit.into());
        self
    }

    /// The least that is good.
    #[must_use]
    pub fn at_least(mut self, limit: impl Into<Value>) -> MeasureSpec {
        self.at_least = Some(limit.into());
        self
    }
}
