//! What the law believes of the servicer.

use control_laws::model::{LinkMismatch, ModelError, Payload, Propellant};
use control_laws::{ControlModel, ModelOptions};
use interfaces::JOINTS;
use interfaces::files::Servicer;
use lockstep::participant::ParameterError;
use lockstep::units::{Each, Inertia};
use serde::Deserialize;

/// The control model against the plant.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Model {
    /// What becomes of the propellant's pendulum.
    pub propellant: PropellantName,
    /// Rotor inertia that the law believes in; that of the servicer's file unless given.
    pub motor_inertia: Option<Each<Inertia, JOINTS>>,
    /// Factor on every mass and inertia.
    pub mass_factor: f64,
    /// Factors on single links, on top of that.
    pub mismatch: Vec<Mismatch>,
}

impl Default for Model {
    /// The plant itself with its propellant frozen.
    fn default() -> Self {
        Self {
            propellant: PropellantName::Frozen,
            motor_inertia: None,
            mass_factor: 1.0,
            mismatch: Vec::new(),
        }
    }
}

/// What becomes of the propellant's pendulum.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PropellantName {
    /// A rigid lump where it hangs.
    Frozen,
    /// Left out.
    Ignored,
}

/// A link that the law believes to be heavier than it is.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mismatch {
    /// The link.
    pub link: String,
    /// Factor on its mass, and with it on its inertia.
    #[serde(default = "unchanged")]
    pub mass_factor: f64,
    /// Further factor on its inertia about the centre of mass.
    #[serde(default = "unchanged")]
    pub inertia_factor: f64,
}

const fn unchanged() -> f64 {
    1.0
}

/// Builds the control model, with a payload at the end effector if there is one.
///
/// # Errors
/// Names the parameter that does not fit the URDF.
pub fn build(
    urdf: &str,
    servicer: &Servicer,
    model: &Model,
    payload: Option<Payload>,
) -> Result<ControlModel, ParameterError> {
    let description = servicer
        .description(urdf)
        .map_err(|error| ParameterError::new("urdf", error))?;
    let options = ModelOptions {
        arm_joints: servicer.arm.joints.clone(),
        end_effector: servicer.arm.end_effector.clone(),
        propellant: match model.propellant {
            PropellantName::Frozen => Propellant::Frozen,
            PropellantName::Ignored => Propellant::Ignored,
        },
        motor_inertia_kg_m2: model.motor_inertia.unwrap_or(servicer.arm.motor_inertia).si(),
        mass_factor: model.mass_factor,
        mismatch: model
            .mismatch
            .iter()
            .map(|mismatch| LinkMismatch {
                link: mismatch.link.clone(),
                mass_factor: mismatch.mass_factor,
                inertia_factor: mismatch.inertia_factor,
            })
            .collect(),
        payload,
    };
    ControlModel::new(&description, &options).map_err(|error| {
        let key = match &error {
            ModelError::EndEffector(_) => "servicer.arm.end_effector",
            ModelError::JointOrder { .. } | ModelError::NoSuchJoint { .. } => "servicer.arm.joints",
            ModelError::Edit(_) | ModelError::Tree(_) | ModelError::MotorInertia { .. } => "model",
        };
        ParameterError::new(key, error)
    })
}
