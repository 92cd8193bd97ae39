//! The camera: a periodic measurement of the target's pose.

use interfaces::CameraPose;
use lockstep::participant::ParameterError;
use lockstep::units::{Angle, Length, Quantity, Time};
use multibody::Quaternion;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::errors::period_ratio;
use super::{RandomSource, SensorErrorParameters, SensorErrorState, SensorErrors};
use crate::dynamics::Target;

/// The camera of a scenario.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct CameraParameters {
    /// Time between two measurements, a multiple of the plant's period. Image-processing latency is modelled as a delay of
    /// the link.
    pub period: Quantity<Time>,
    /// Errors of the position, world axes; `period` in it is not used.
    pub position: SensorErrorParameters<Length, 3>,
    /// Errors of the attitude: small rotations about target axes; `period` in it is not used.
    pub attitude: SensorErrorParameters<Angle, 3>,
}

impl Default for CameraParameters {
    /// Exact, ten measurements per second.
    fn default() -> Self {
        Self {
            period: Quantity::of(0.1),
            position: SensorErrorParameters::default(),
            attitude: SensorErrorParameters::default(),
        }
    }
}

/// Complete state of the camera: its errors, and the last measurement.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct CameraState {
    errors: [SensorErrorState; 2],
    held: [f64; 8],
}

/// The camera.
#[derive(Debug, Clone)]
pub struct Camera {
    position: SensorErrors<3>,
    attitude: SensorErrors<3>,
    held: CameraPose,
}

impl Camera {
    /// A camera before its first measurement.
    ///
    /// # Errors
    /// Names the parameter that is out of range.
    pub fn new(parameters: &CameraParameters, source: RandomSource) -> Result<Self, ParameterError> {
        period_ratio(Some(parameters.period), source.period)
            .map_err(|reason| ParameterError::new("sensors.camera.period", reason))?;
        let mut parameters = parameters.clone();
        for (key, given) in [
            ("position", &parameters.position.period),
            ("attitude", &parameters.attitude.period),
        ] {
            if given.is_some() {
                let reason = "position and attitude come from one picture; set sensors.camera.period";
                return Err(ParameterError::new(format!("sensors.camera.{key}.period"), reason));
            }
        }
        parameters.position.period = Some(parameters.period);
        parameters.attitude.period = Some(parameters.period);
        Ok(Self {
            position: SensorErrors::new("sensors.camera.position", &parameters.position, source)?,
            attitude: SensorErrors::new("sensors.camera.attitude", &parameters.attitude, source)?,
            held: CameraPose::default(),
        })
    }

    pub fn state(&self) -> CameraState {
        let CameraPose {
            stamp,
            p_NT_N: [x, y, z],
            quat_NT: [a, b, c, d],
        } = self.held;
        CameraState {
            errors: [self.position.state(), self.attitude.state()],
            held: [stamp, x, y, z, a, b, c, d],
        }
    }

    pub fn restore(&mut self, state: &CameraState) {
        self.position.restore(&state.errors[0]);
        self.attitude.restore(&state.errors[1]);
        let [stamp, x, y, z, a, b, c, d] = state.held;
        self.held = CameraPose {
            stamp,
            p_NT_N: [x, y, z],
            quat_NT: [a, b, c, d],
        };
    }

    /// The latest measurement at the plant's output number `k` at `t`, s.
    pub fn read(&mut self, k: u64, t: f64, target: &Target) -> &CameraPose {
        if let Some(n) = self.position.due(k) {
            let error = self.attitude.read(n, [0.0; 3]);
            let attitude = if error == [0.0; 3] {
                target.quat_nb
            } else {
                target
                    .quat_nb
                    .times(Quaternion::exp(&Vector3::from(error)))
                    .normalized()
            };
            self.held = CameraPose {
                stamp: t,
                p_NT_N: self.position.read(n, target.p_nb.into()),
                quat_NT: attitude.to_wxyz(),
            };
        }
        &self.held
    }
}
