//! Sensor models: sample and hold, bias, random walk, drift, white noise and quantisation of the true values.
//!
//! Every sensor has its own random streams, addressed by sample number: no random number depends on the order in which
//! sensors are read, and a restored run has the same noise.

mod camera;
mod errors;
mod parameters;
mod servicer;
mod source;

use lockstep::participant::ParameterError;
use serde::{Deserialize, Serialize};

pub use camera::{Camera, CameraParameters, CameraState};
pub use errors::{SensorErrorParameters, SensorErrorState, SensorErrors};
pub use parameters::SensorParameters;
pub use servicer::{ServicerSensors, ServicerSensorsState};
pub use source::RandomSource;

/// Complete state of the sensors.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct SensorsState {
    /// Sensors of the servicer's own state.
    pub servicer: ServicerSensorsState,
    /// Sensor of the target's pose.
    pub camera: CameraState,
}

/// The sensors.
#[derive(Debug, Clone)]
pub struct Sensors {
    /// Sensors of the servicer's own state.
    pub servicer: ServicerSensors,
    /// Sensor of the target's pose.
    pub camera: Camera,
}

impl Sensors {
    /// The sensors of a plant.
    ///
    /// # Errors
    /// Names the parameter that is out of range.
    pub fn new(parameters: &SensorParameters, source: RandomSource) -> Result<Self, ParameterError> {
        Ok(Self {
            servicer: ServicerSensors::new(parameters, source)?,
            camera: Camera::new(&parameters.camera, source)?,
        })
    }

    /// Their complete state.
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
