//! The table `assessment` of a scenario.

use lockstep::units::{Angle, Each, Force, Quantity, Time, Torque};
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

/// Largest value of each figure that is a success, of what the measures of a scenario cannot say. No criterion unless given.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Criteria {
    /// Part of the controller's samples with an actuator asked for more than it has.
    pub saturated_fraction: Option<f64>,
    /// Range of each joint, either way from zero: the part of it that is used must not exceed one.
    pub joint_ranges: Option<Each<Angle, 7>>,
}
