//! Pendulum model of the propellant.

use serde::Deserialize;

/// The pendulum that models the propellant.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SloshModel {
    /// Two perpendicular hinges, singular where the bob lies along the first.
    #[default]
    Hinges,
    /// A direction and its rate, without singularity.
    Spherical,
}
