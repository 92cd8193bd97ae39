//! The table `assessment` of a scenario.

use lockstep::participant::ParameterError;
use lockstep::units::{Angle, Force, PerAxis, Quantity, QuantityKind, Time, Torque};
use plant_proc::ActuatorParameters;
use serde::Deserialize;
use toml::Table;

/// `[assessment]`.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
    /// The kind of run; there is one kind so far.
    #[allow(dead_code)] // its only value is checked by reading it
    pub kind: AssessmentKind,
    /// The time at which the end effector is to reach the grasp frame.
    pub grasp_at: Quantity<Time>,
    /// The stream with the truth, `participant.port`; unless given, the one with the message `Truth`.
    pub truth: Option<String>,
    /// The stream with the commands, `participant.port`; unless given, the one with the message `Command`.
    pub command: Option<String>,
    /// The limits of the actuators: commands beyond them count as saturated.
    #[serde(default)]
    pub limits: GivenLimits,
    /// The criteria of the run.
    #[serde(default)]
    pub criteria: Criteria,
}

/// The kind of run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum AssessmentKind {
    /// The capture of a target by an arm.
    Capture,
}

/// The limits of the actuators; unless given, those of the plant.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct GivenLimits {
    /// Of the wheels.
    torque: Option<PerAxis<Torque, 3>>,
    /// Of the thrusters along each axis.
    force: Option<PerAxis<Force, 3>>,
    /// Of the joint motors.
    joint_torque: Option<PerAxis<Torque, 7>>,
}

impl GivenLimits {
    /// The limits of the wheels, the thrusters and the joint motors, in this order, N m or N: these, and the rest from the table
    /// `actuators` of the plant with these parameters. A plant that is not the stock one may have another table; what it does not have as
    /// the stock plant does is that of the stock plant by default.
    ///
    /// # Errors
    /// Names the limit that is not above zero.
    pub fn or_of(&self, plant: Option<&Table>) -> Result<[f64; 13], ParameterError> {
        let stock = ActuatorParameters::default();
        let torque = given_or_own("torque", &self.torque, plant, ["wheels", "torque"], stock.wheels.torque)?;
        let force = given_or_own(
            "force",
            &self.force,
            plant,
            ["thrusters", "force"],
            stock.thrusters.force,
        )?;
        let joints = given_or_own(
            "joint_torque",
            &self.joint_torque,
            plant,
            ["joints", "torque"],
            stock.joints.torque,
        )?;
        let mut limits = [0.0; 13];
        let all = torque.si().into_iter().chain(force.si()).chain(joints.si());
        limits.iter_mut().zip(all).for_each(|(slot, limit)| *slot = limit);
        Ok(limits)
    }
}

fn given_or_own<K: QuantityKind, const N: usize>(
    name: &str,
    given: &Option<PerAxis<K, N>>,
    plant: Option<&Table>,
    [group, key]: [&str; 2],
    stock: PerAxis<K, N>,
) -> Result<PerAxis<K, N>, ParameterError> {
    if let Some(given) = given {
        above_zero(&format!("limits.{name}"), given)?;
        return Ok(*given);
    }
    // an actuator of the plant may be switched off by a limit of zero
    let own = || plant?.get("actuators")?.get(group)?.get(key)?.clone().try_into().ok();
    Ok(own().unwrap_or(stock))
}

/// Upper limits of figures that a scenario's measures cannot express. No criterion unless given.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Criteria {
    /// Fraction of the controller's samples with an actuator command beyond its limit.
    pub saturated_fraction: Option<f64>,
    /// Range of each joint, symmetric about zero: the fraction of it that is used must not exceed one.
    pub joint_ranges: Option<PerAxis<Angle, 7>>,
}

impl Criteria {
    /// Rejects a criterion that every run or none would meet.
    ///
    /// # Errors
    /// Names the criterion, its value and what is possible.
    pub fn validate(&self) -> Result<(), ParameterError> {
        if let Some(fraction) = self.saturated_fraction.filter(|part| !(0.0..=1.0).contains(part)) {
            let reason =
                format!("{fraction} is not a fraction of the samples: give a number from 0 to 1, such as 0.05");
            return Err(ParameterError::new("criteria.saturated_fraction", reason));
        }
        self.joint_ranges
            .as_ref()
            .map_or(Ok(()), |ranges| above_zero("criteria.joint_ranges", ranges))
    }
}

/// Rejects a range or a limit that is not above zero.
fn above_zero<K: QuantityKind, const N: usize>(key: &str, values: &PerAxis<K, N>) -> Result<(), ParameterError> {
    let mut all = values.si().into_iter().enumerate();
    let Some((at, value)) = all.find(|(_, value)| !(*value > 0.0 && value.is_finite())) else {
        return Ok(());
    };
    let reason = format!(
        "{} (number {} of {N}) is not above zero; write for example \"{}\"",
        K::text(value),
        at + 1,
        K::EXAMPLE
    );
    Err(ParameterError::new(key, reason))
}
