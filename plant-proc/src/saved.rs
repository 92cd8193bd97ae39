//! The complete state of a plant.

use serde::{Deserialize, Serialize};

use crate::actuators::ActuatorsState;
use crate::dynamics::{Forces, Grasp, Ledger, Motion, Target, Totals};
use crate::sensors::SensorsState;

/// The plant's complete state.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Saved {
    /// The servicer.
    pub motion: Motion,
    /// The target.
    pub target: Target,
    /// Actuator forces over the last step.
    pub forces: Forces,
    /// The actuators.
    pub actuators: ActuatorsState,
    /// The sensors.
    pub sensors: SensorsState,
    /// The conservation ledger: totals at the start, and losses since.
    pub ledger: Ledger,
    /// Momentum and energy of this state with this plant's masses.
    pub totals: Totals,
    /// The grasp, once it has happened.
    pub grasp: Option<Grasp>,
    /// Attitudes of end effector and grasp frame as last written; they determine the sign of the next.
    pub signs: [[f64; 4]; 2],
}
