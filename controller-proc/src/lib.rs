//! The controller: hosts a control law.
//!
//! | port | message | |
//! |---|---|---|
//! | in `measured` | [`Measured`](interfaces::Measured) | required |
//! | in `setpoint` | [`SetPoint`](interfaces::SetPoint) | of the end effector; required |
//! | in `base_setpoint` | [`SetPoint`](interfaces::SetPoint) | of the base, for the comparison law |
//! | in `housekeeping` | [`Housekeeping`](interfaces::Housekeeping) | wheels for the allocation, gripper for stabilisation |
//! | out `command` | [`Command`](interfaces::Command) | |
//! | out `couples` | [`ThrusterTorque`](interfaces::ThrusterTorque) | torque by thrusters; zero without an allocation |
//! | out `telemetry` | [`ControlTelemetry`](interfaces::ControlTelemetry) | |
//!
//! The controller commands nothing before the first measurement and holds the end effector at its pose before the first set-point.
#![allow(non_snake_case)] // monogram notation: `p_NE`, `R_NE` read like the equations they implement

mod controller;
mod law;
mod parameters;
mod saved;
mod velocity_loop;

pub use velocity_loop::VelocityLoop;

use lockstep::participant::{ParameterError, Participant, Setup};

/// Builds a controller from `setup.parameters`; docs/models/controller.md lists them.
///
/// # Errors
/// Names the parameter, its value and the remedy.
pub fn factory(setup: &Setup) -> Result<Box<dyn Participant>, ParameterError> {
    let parameters = lockstep::units::read(&setup.parameters)?;
    Ok(Box::new(controller::Controller::new(setup, &parameters)?))
}
