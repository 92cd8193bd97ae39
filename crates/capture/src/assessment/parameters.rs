//! The table `assessment` of a scenario.

use lockstep::units::{
    Angle, AngularMomentum, AngularRate, Each, Energy, Force, Length, Quantity, Speed, Time, Torque,
};
use serde::Deserialize;

/// `[assessment]`.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
    /// What kind of run it is; there is one kind so far.
    #[allow(dead_code)] // its only value is checked by reading it
    pub kind: Kind,
    /// When the end effector shall be on the grasp frame.
    pub grasp_at: Quantity<Time>,
    /// The stream with the truth, `participant.port`; the one with the message `Truth` unless given.
    pub truth: Option<String>,
    /// The stream with the commands, `participant.port`; the one with the message `Command` unless given.
    pub command: Option<String>,
    /// What the actuators have: commands beyond count as saturated.
    #[serde(default)]
    pub limits: Limits,
    /// What the run must achieve.
    #[serde(default)]
    pub criteria: Criteria,
}

/// What kind of run it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// The capture of a target by an arm.
    Capture,
}

/// What the actuators have; the stock ones' unless given.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Limits {
    /// Of the wheels.
    pub torque: Each<Torque, 3>,
    /// Of the thrusters along each axis.
    pub force: Each<Force, 3>,
    /// Of the joint motors.
    pub joint_torque: Each<Torque, 7>,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            torque: Each::of([0.2; 3]),
            force: Each::of([9.0; 3]),
            joint_torque: Each::of([320.0, 320.0, 176.0, 176.0, 110.0, 40.0, 40.0]),
        }
    }
}

/// Largest value of each figure that is a success. Without the table, the first four.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Criteria {
    /// Distance between end effector and grasp frame at the grasp.
    pub position_error_at_grasp: Option<Quantity<Length>>,
    /// Angle between them.
    pub attitude_error_at_grasp: Option<Quantity<Angle>>,
    /// Speed between them.
    pub relative_speed_at_grasp: Option<Quantity<Speed>>,
    /// Part of the controller's samples with an actuator asked for more than it has.
    pub saturated_fraction: Option<f64>,
    /// Largest distance from the grasp on.
    pub largest_error_after_grasp: Option<Quantity<Length>>,
    /// Largest torque asked of a wheel.
    pub peak_base_torque: Option<Quantity<Torque>>,
    /// Largest force asked along an axis.
    pub peak_base_force: Option<Quantity<Force>>,
    /// Largest torque asked of a joint.
    pub peak_joint_torque: Option<Quantity<Torque>>,
    /// Largest angle of the pendulum.
    pub slosh_max: Option<Quantity<Angle>>,
    /// Largest momentum in a wheel.
    pub wheel_momentum_max: Option<Quantity<AngularMomentum>>,
    /// Largest missing momentum, linear (as a number in kg m/s) or angular (in N m s).
    pub momentum_residual: Option<f64>,
    /// Largest missing energy.
    pub energy_residual: Option<Quantity<Energy>>,
    /// Range of each joint, either way from zero: the part of it that is used must not exceed one.
    pub joint_ranges: Option<Each<Angle, 7>>,
    /// Angular speed of the base at the end.
    pub base_rate_at_end: Option<Quantity<AngularRate>>,
    /// Largest angular speed of a joint at the end.
    pub joint_rate_at_end: Option<Quantity<AngularRate>>,
}

impl Default for Criteria {
    fn default() -> Self {
        Self {
            position_error_at_grasp: Some(Quantity::of(5e-3)),
            attitude_error_at_grasp: Some(Quantity::of(0.5 * std::f64::consts::PI / 180.0)),
            relative_speed_at_grasp: Some(Quantity::of(5e-3)),
            saturated_fraction: Some(0.0),
            largest_error_after_grasp: None,
            peak_base_torque: None,
            peak_base_force: None,
            peak_joint_torque: None,
            slosh_max: None,
            wheel_momentum_max: None,
            momentum_residual: None,
            energy_residual: None,
            joint_ranges: None,
            base_rate_at_end: None,
            joint_rate_at_end: None,
        }
    }
}
