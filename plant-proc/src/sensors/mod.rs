//! From the truth to what is measured: sample and hold, bias, walk, drift, white noise, quantisation.
//!
//! Every sensor draws from streams of its own, addressed by the number of its sample: no draw depends on who drew before,
//! and a restored run sees the same noise.

mod camera;
mod errors;
mod parameters;
mod servicer;
mod source;

use lockstep::participant::ParameterError;
use serde::{Deserialize, Serialize};

pub use camera::{Camera, CameraParameters, CameraState};
pub use errors::{ErrorParameters, ErrorState, Errors};
pub use parameters::SensorParameters;
pub use servicer::{ServicerSensors, ServicerSensorsState};
pub use source::Source;

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
