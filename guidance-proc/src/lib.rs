//! Guidance: hosts a guidance law and, if configured, the navigation filter in front of it.
//!
//! | port | message | |
//! |---|---|---|
//! | in `measured` | [`Measured`](interfaces::Measured) | required |
//! | in `target` | [`TargetState`](interfaces::TargetState) | required without navigation |
//! | in `camera` | [`CameraPose`](interfaces::CameraPose) | required with navigation |
//! | out `setpoint` | [`SetPoint`](interfaces::SetPoint) | of the end effector |
//! | out `base_setpoint` | [`SetPoint`](interfaces::SetPoint) | of the base; zeros unless the comparison guidance is active |
//! | out `telemetry` | [`GuidanceTelemetry`](interfaces::GuidanceTelemetry) | |
//!
//! No set-point is given before the first measurement; before the target is seen it is the start pose.
#![allow(non_snake_case)] // monogram notation: `p_NE`, `R_NE` read like the equations they implement

mod guidance;
mod kinematics;
mod law;
mod navigation;
mod parameters;
mod saved;

use lockstep::participant::{ParameterError, Participant, Setup};

/// Builds a guidance from `setup.parameters`; docs/models/guidance.md lists them.
///
/// # Errors
/// Names the parameter, its value and the remedy.
pub fn factory(setup: &Setup) -> Result<Box<dyn Participant>, ParameterError> {
    let parameters = lockstep::units::read(&setup.parameters)?;
    Ok(Box::new(guidance::Guidance::new(&parameters)?))
}
