//! Limits of a figure.

use crate::assessment::Criterion;

/// The limits of a figure, in the unit of the figure.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Limits {
    /// The greatest value that is a success.
    pub at_most: Option<f64>,
    /// The least one.
    pub at_least: Option<f64>,
    /// The unit in which the user states them.
    pub unit: String,
    /// The size of that unit in the unit of the figure.
    pub scale: f64,
}

impl Limits {
    /// True when there are no limits.
    pub fn is_empty(&self) -> bool {
        self.at_most.is_none() && self.at_least.is_none()
    }

    /// The amount by which `value` is beyond a limit; negative where it is inside both.
    pub(super) fn excess(&self, value: f64) -> f64 {
        let above = self.at_most.map(|most| value - most);
        let below = self.at_least.map(|least| least - value);
        above.into_iter().chain(below).fold(f64::NEG_INFINITY, f64::max)
    }

    /// The criterion that these limits define for a figure, or for one that was not measured.
    pub(super) fn criterion(&self, name: &str, found: Result<(f64, Option<f64>), String>) -> Criterion {
        let shown = |value: f64| value / self.scale;
        let (value, t_s, reason) = match found {
            Ok((value, t_s)) => (Some(value), t_s, None),
            Err(reason) => (None, None, Some(reason)),
        };
        Criterion {
            name: name.to_owned(),
            value: value.map(shown),
            limit: self.at_most.map(shown),
            at_least: self.at_least.map(shown),
            unit: self.unit.clone(),
            met: value.is_some_and(|value| self.excess(value) <= 0.0),
            t_s,
            reason,
        }
    }
}
