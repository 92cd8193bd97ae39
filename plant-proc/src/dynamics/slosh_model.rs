//! Which pendulum the propellant is.

use serde::Deserialize;

/// The propellant's pendulum.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SloshModel {
    /// Two perpendicular hinges, singular where the bob lies along the first.
    #[default]
    Hinges,
    /// A direction and its rate, singular nowhere.
    Spherical,
}
