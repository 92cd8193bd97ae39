//! Actuator faults, each active in a window of simulated time.

use interfaces::JOINTS;
use lockstep::participant::ParameterError;
use lockstep::units::{Quantity, Time};
use serde::Deserialize;

use super::THRUSTERS;

/// A fault as declared in the scenario: `{ actuator = "wheel.x", effect = "stuck", from = "12 s" }`.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FaultParameters {
    /// `wheel.x`, `thruster.0` to `thruster.11`, or `joint.` and the joint's name. `thruster.+x` are the two that push along
    /// that axis, `thruster.-x` the two against it, `thruster.x` all four.
    pub actuator: String,
    /// Effect of the fault.
    pub effect: EffectName,
    /// For `weak`: the fraction of the command that the actuator still follows.
    pub factor: Option<f64>,
    /// First instant of the fault; the start of the run by default.
    pub from: Option<Quantity<Time>>,
    /// First instant at which the actuator works again; never by default.
    pub until: Option<Quantity<Time>>,
}

/// Fault effects of an actuator.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum EffectName {
    /// The actuator holds its last output.
    Stuck,
    /// No output; a joint turns freely.
    Off,
    /// A thruster fires all the time.
    On,
    /// The joint's brake holds it at its position.
    Locked,
    /// The actuator follows the fraction `factor` of the command.
    Weak,
}

/// An active fault.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Effect {
    /// The actuator holds its last output.
    Stuck,
    /// No output.
    Off,
    /// Full output.
    On,
    /// A brake holds the joint.
    Locked,
    /// The actuator follows this fraction of the command.
    Weak(f64),
}

/// An actuator.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Actuator {
    /// The wheel about this axis.
    Wheel(usize),
    /// This thruster.
    Thruster(usize),
    /// This joint's motor.
    Joint(usize),
}

#[derive(Debug, Clone, Copy)]
struct Fault {
    actuator: Actuator,
    effect: Effect,
    from: f64,
    until: f64,
}

/// The faults of a run.
#[derive(Debug, Clone)]
pub struct Faults(Vec<Fault>);

impl Faults {
    /// Builds the faults from the scenario, for joints with these names.
    ///
    /// # Errors
    /// Names the invalid fault and what is possible.
    pub fn new(parameters: &[FaultParameters], joints: &[String; JOINTS]) -> Result<Self, ParameterError> {
        let mut faults = Vec::new();
        for (at, fault) in parameters.iter().enumerate() {
            let refuse = |key: &str, reason: String| ParameterError::new(format!("faults[{at}].{key}"), reason);
            let actuators = parse_actuators(&fault.actuator, joints).ok_or_else(|| {
                let reason = format!(
                    "there is no actuator `{}`; there are wheel.x to wheel.z, thruster.0 to thruster.{}, thruster.x, thruster.+x, \
                     thruster.-x and so on, and {}",
                    fault.actuator,
                    THRUSTERS - 1,
                    joints.each_ref().map(|joint| format!("joint.{joint}")).join(", ")
                );
                refuse("actuator", reason)
            })?;
            let effect = match (fault.effect, actuators[0], fault.factor) {
                (EffectName::Weak, _, Some(factor)) if (0.0..=1.0).contains(&factor) => Effect::Weak(factor),
                (EffectName::Weak, _, Some(factor)) => {
                    let reason = format!(
                        "{factor} is not a fraction of the command: give a number from 0 to 1, such as factor = 0.5"
                    );
                    return Err(refuse("factor", reason));
                }
                (EffectName::Weak, ..) => {
                    let reason = "effect `weak` needs the part of the command that is followed, such as factor = 0.5";
                    return Err(refuse("factor", reason.to_owned()));
                }
                (_, _, Some(factor)) => {
                    return Err(refuse("factor", format!("{factor} is only for the effect `weak`")));
                }
                (EffectName::Stuck, ..) => Effect::Stuck,
                (EffectName::Off, ..) => Effect::Off,
                (EffectName::On, Actuator::Thruster(_), _) => Effect::On,
                (EffectName::Locked, Actuator::Joint(_), _) => Effect::Locked,
                (EffectName::On, ..) => return Err(refuse("effect", "`on` is only for thrusters".to_owned())),
                (EffectName::Locked, ..) => return Err(refuse("effect", "`locked` is only for joints".to_owned())),
            };
            let (from, until) = (
                fault.from.map_or(0.0, |from| from.si()),
                fault.until.map_or(f64::INFINITY, |until| until.si()),
            );
            if from < 0.0 {
                let reason = format!("{from} s is before the start; leave it out for a fault from the start");
                return Err(refuse("from", reason));
            }
            if until <= from {
                return Err(refuse("until", format!("{until} s is not after `from`, {from} s")));
            }
            faults.extend(actuators.into_iter().map(|actuator| Fault {
                actuator,
                effect,
                from,
                until,
            }));
        }
        Ok(Self(faults))
    }

    /// The fault of `actuator` at `t`, s; the last active one in the list applies.
    pub fn effect(&self, t: f64, actuator: Actuator) -> Option<Effect> {
        self.0
            .iter()
            .rev()
            .find(|fault| fault.actuator == actuator && fault.from <= t && t < fault.until)
            .map(|fault| fault.effect)
    }
}

/// The actuators that a name stands for; never an empty list.
fn parse_actuators(name: &str, joints: &[String; JOINTS]) -> Option<Vec<Actuator>> {
    let (group, which) = name.split_once('.')?;
    let axis = |name: &str| ["x", "y", "z"].iter().position(|axis| *axis == name);
    match group {
        "wheel" => Some(vec![Actuator::Wheel(axis(which)?)]),
        "thruster" => {
            // in fours: two along the axis, then two against it
            let range = if let Some(along) = which.strip_prefix('+') {
                let first = 4 * axis(along)?;
                first..first + 2
            } else if let Some(against) = which.strip_prefix('-') {
                let first = 4 * axis(against)? + 2;
                first..first + 2
            } else if let Some(axis) = axis(which) {
                4 * axis..4 * axis + 4
            } else {
                let number = which.parse().ok().filter(|number| *number < THRUSTERS)?;
                number..number + 1
            };
            Some(range.map(Actuator::Thruster).collect())
        }
        "joint" => Some(vec![Actuator::Joint(joints.iter().position(|joint| joint == which)?)]),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thrusters_are_named_by_number_direction_or_axis() {
        let joints: [String; JOINTS] = std::array::from_fn(|joint| format!("A{}", joint + 1));
        let numbers = |name: &str| {
            let actuators = parse_actuators(name, &joints)?;
            let number = |actuator: &Actuator| match actuator {
                Actuator::Thruster(number) => *number,
                other => panic!("{other:?}"),
            };
            Some(actuators.iter().map(number).collect::<Vec<_>>())
        };
        assert_eq!(numbers("thruster.7"), Some(vec![7]));
        assert_eq!(numbers("thruster.+y"), Some(vec![4, 5]));
        assert_eq!(numbers("thruster.-x"), Some(vec![2, 3]));
        assert_eq!(numbers("thruster.z"), Some(vec![8, 9, 10, 11]));
        for unknown in [
            "thruster.12",
            "thruster.+w",
            "thruster.",
            "wheel.w",
            "joint.A8",
            "wheel",
        ] {
            assert!(parse_actuators(unknown, &joints).is_none(), "{unknown}");
        }
    }
}
