//! The plant: a servicer with an arm and sloshing propellant, and a tumbling target.
//!
//! Fifteen degrees of freedom from a URDF, integrated with a fixed step and a zero-order hold on the actuators' forces; a
//! torque-free target; actuators and sensors with limits and errors, each off unless configured. After the grasp, if
//! configured, one mechanism.
//!
//! | port | message | |
//! |---|---|---|
//! | in `command` | [`Command`](interfaces::Command) | required |
//! | in `couples` | [`ThrusterTorque`](interfaces::ThrusterTorque) | torque by thrusters, if the controller allocates any |
//! | out `measured` | [`Measured`](interfaces::Measured) | readings of the servicer's sensors |
//! | out `target` | [`TargetState`](interfaces::TargetState) | an ideal observer's view of the target |
//! | out `camera` | [`CameraPose`](interfaces::CameraPose) | the target's pose as measured by a camera |
//! | out `housekeeping` | [`Housekeeping`](interfaces::Housekeeping) | wheels and gripper |
//! | out `truth` | [`Truth`](interfaces::Truth) | for the recorder and the figures |
//!
//! Delays are modelled by links, not by the plant.
#![allow(non_snake_case)] // monogram notation: `p_NE`, `R_NE` read like the equations they implement

mod actuators;
mod batch;
mod dynamics;
mod parameters;
mod plant;
mod saved;
mod sensors;
mod truth;

pub use actuators::ActuatorParameters;

use lockstep::participant::{ParameterError, Participant, Setup};
use plant::Plant;

/// Builds a plant from `setup.parameters`; docs/models/plant.md lists them.
///
/// # Errors
/// Names the parameter, its value and the remedy.
pub fn factory(setup: &Setup) -> Result<Box<dyn Participant>, ParameterError> {
    let parameters = lockstep::units::read(&setup.parameters)?;
    Ok(Box::new(Plant::new(setup, &parameters)?))
}
