//! Control model of the servicer, with deliberate mismatch against the plant.

use control_laws::model::{LinkMismatch, ModelError, Payload, Propellant};
use control_laws::{ControlModel, ModelOptions};
use interfaces::JOINTS;
use interfaces::files::Servicer;
use lockstep::participant::ParameterError;
use lockstep::units::{Inertia, PerAxis};
use serde::Deserialize;

/// Differences between the control model and the plant.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Model {
    /// Treatment of the propellant's pendulum.
    pub propellant: PropellantName,
    /// Rotor inertia in the control model; that of the servicer's file by default.
    pub motor_inertia: Option<PerAxis<Inertia, JOINTS>>,
    /// Factor on every mass and inertia.
    pub mass_factor: f64,
    /// Additional factors on single links.
    pub mismatch: Vec<Mismatch>,
}

impl Default for Model {
    /// The plant's own model with the propellant frozen.
    fn default() -> Self {
        Self {
            propellant: PropellantName::Frozen,
            motor_inertia: None,
            mass_factor: 1.0,
            mismatch: Vec::new(),
        }
    }
}

/// Treatment of the propellant's pendulum.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PropellantName {
    /// A rigid mass at the hanging position.
    Frozen,
    /// Left out.
    Ignored,
}

/// A link with a wrong mass or inertia in the control model.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mismatch {
    /// The link.
    pub link: String,
    /// Factor on its mass, which also scales its inertia.
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
pub fn build_control_model(
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
