//! The complete state of a plant.

use serde::{Deserialize, Serialize};

use crate::actuators::ActuatorsState;
use crate::dynamics::{Books, Forces, Grasp, Motion, Target};
use crate::sensors::SensorsState;

/// Everything that the plant remembers.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Saved {
    /// The servicer.
    pub motion: Motion,
    /// The target.
    pub target: Target,
    /// What the actuators did last.
    pub forces: Forces,
    /// The actuators.
    pub actuators: ActuatorsState,
    /// The sensors.
    pub sensors: SensorsState,
    /// What was there at the start, and what has gone since.
    pub books: Books,
    /// The grasp, once it has happened.
    pub grasp: Option<Grasp>,
    /// Attitudes of end effector and grasp frame as they were given out last, for the sign of the next.
    pub signs: [[f64; 4]; 2],
}
