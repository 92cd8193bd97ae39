//! Sensor parameters of a scenario.

use lockstep::units::{Angle, AngularRate, Length, Speed};
use serde::Deserialize;

use super::{CameraParameters, ErrorParameters};

/// The sensors of a scenario; exact and at the plant's rate by default.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SensorParameters {
    /// Position of the base, world axes.
    pub position: ErrorParameters<Length, 3>,
    /// Attitude of the base: small rotations about base axes.
    pub attitude: ErrorParameters<Angle, 3>,
    /// Angular velocity of the base, base axes.
    pub rate: ErrorParameters<AngularRate, 3>,
    /// Velocity of the base, base axes.
    pub velocity: ErrorParameters<Speed, 3>,
    /// Joint angles.
    pub joint_angle: ErrorParameters<Angle, 7>,
    /// Joint rates.
    pub joint_rate: ErrorParameters<AngularRate, 7>,
    /// The camera.
    pub camera: CameraParameters,
}
