//! Sensor parameters of a scenario.

use lockstep::units::{Angle, AngularRate, Length, Speed};
use serde::Deserialize;

use super::{CameraParameters, SensorErrorParameters};

/// The sensors of a scenario; exact and at the plant's rate by default.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SensorParameters {
    /// Position of the base, world axes.
    pub position: SensorErrorParameters<Length, 3>,
    /// Attitude of the base: small rotations about base axes.
    pub attitude: SensorErrorParameters<Angle, 3>,
    /// Angular velocity of the base, base axes.
    pub rate: SensorErrorParameters<AngularRate, 3>,
    /// Velocity of the base, base axes.
    pub velocity: SensorErrorParameters<Speed, 3>,
    /// Joint angles.
    pub joint_angle: SensorErrorParameters<Angle, 7>,
    /// Joint rates.
    pub joint_rate: SensorErrorParameters<AngularRate, 7>,
    /// The camera.
    pub camera: CameraParameters,
}
