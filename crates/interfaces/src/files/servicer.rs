//! Servicer data that a URDF cannot express.

use lockstep::units::{Inertia, PerAxis, Quantity, RotationalDamping, RotationalStiffness};
use serde::Deserialize;

use crate::{JOINTS, SLOSH};
use multibody::{Description, UrdfErrors, UrdfOptions};

/// Data of the servicer in addition to its URDF.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Servicer {
    /// The arm.
    #[serde(default)]
    pub arm: Arm,
    /// The pendulum that models the propellant.
    #[serde(default)]
    pub slosh: Slosh,
    /// Whether to accept links in the URDF with physically impossible inertias.
    #[serde(default)]
    pub allow_unphysical: bool,
}

impl Servicer {
    /// The mechanism of a URDF.
    ///
    /// # Errors
    /// All errors found in the text.
    pub fn description(&self, urdf: &str) -> Result<Description, UrdfErrors> {
        let options = UrdfOptions {
            allow_unphysical: self.allow_unphysical,
        };
        Description::read_urdf(urdf, options).map(|reading| reading.description)
    }
}

/// The arm.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Arm {
    /// Names of the joints, in message order.
    pub joints: [String; JOINTS],
    /// Name of the link that is the end effector's frame E.
    pub end_effector: String,
    /// Rotor inertia of each joint, reflected to its output.
    pub motor_inertia: PerAxis<Inertia, JOINTS>,
}

impl Default for Arm {
    /// Joints `A1` to `A7`, frame `end_effector`, 0.1 kg m² on every joint.
    fn default() -> Self {
        Self {
            joints: ["A1", "A2", "A3", "A4", "A5", "A6", "A7"].map(str::to_owned),
            end_effector: "end_effector".to_owned(),
            motor_inertia: PerAxis::of([0.1; JOINTS]),
        }
    }
}

/// The pendulum.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Slosh {
    /// Names of its two hinges, in message order.
    pub joints: [String; SLOSH],
    /// Viscous damping of each hinge; the URDF's value by default.
    pub damping: Option<Quantity<RotationalDamping>>,
    /// Stiffness towards the hanging position, for example from surface tension.
    pub stiffness: Quantity<RotationalStiffness>,
}

impl Default for Slosh {
    /// Hinges `slosh_y` and `slosh_x`, damping from the URDF, no stiffness.
    fn default() -> Self {
        Self {
            joints: ["slosh_y", "slosh_x"].map(str::to_owned),
            damping: None,
            stiffness: Quantity::of(0.0),
        }
    }
}
