//! From the truth to what is measured: sample and hold, bias, walk, drift, white noise, quantisation.
//!
//! Every sensor draws from streams of its own, addressed by the number of its sample: no draw depends on who drew before,
//! and a restored run sees the same noise.

mod camera;
mod errors;
mod servicer;

use lockstep::participant::ParameterError;
use lockstep::units::{Angle, AngularRate, Length, Speed};
use serde::{Deserialize, Serialize};

pub use camera::{Camera, CameraParameters, CameraState};
pub use errors::{ErrorParameters, ErrorState, Errors};
pub use servicer::{ServicerSensors, ServicerSensorsState};

/// The sensors of a scenario; exact, at the plant's own rate, unless something is given.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SensorParameters {
    /// Position of the base, world axes.
    pub position: ErrorParameters<Length, 3>,
    /// Attitude of the base: small turns about base axes.
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

/// All that the sensors remember.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct SensorsState {
    /// Of the servicer's own state.
    pub servicer: ServicerSensorsState,
    /// Of the target's pose.
    pub camera: CameraState,
}

/// The sensors.
#[derive(Debug, Clone)]
pub struct Sensors {
    /// Of the servicer's own state.
    pub servicer: ServicerSensors,
    /// Of the target's pose.
    pub camera: Camera,
}

/// Where a sensor's draws come from.
#[derive(Debug, Clone, Copy)]
pub struct Source<'a> {
    /// The seed of the run.
    pub seed: u64,
    /// The participant's name.
    pub participant: &'a str,
    /// The period of the plant, s.
    pub period: f64,
}

impl Sensors {
    /// The sensors of a plant.
    ///
    /// # Errors
    /// Names the parameter that is out of range.
    pub fn new(parameters: &SensorParameters, source: Source) -> Result<Self, ParameterError> {
        Ok(Self {
            servicer: ServicerSensors::new(parameters, source)?,
            camera: Camera::new(&parameters.camera, source)?,
        })
    }

    /// All that they remember.
    pub fn state(&self) -> SensorsState {
        SensorsState {
            servicer: self.servicer.state(),
            camera: self.camera.state(),
        }
    }

    /// Continues from `state`.
    pub fn restore(&mut self, state: &SensorsState) {
        self.servicer.restore(&state.servicer);
        self.camera.restore(&state.camera);
    }
}
