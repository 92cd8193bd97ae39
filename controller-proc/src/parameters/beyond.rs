//! What goes beyond the paper: off unless the scenario asks for it.

use control_laws::allocation::AllocationParameters;
use control_laws::avoidance::{AvoidanceParameters, Elbow};
use control_laws::model::Payload;
use guidance_laws::Pose;
use interfaces::files::{Arm, Target};
use lockstep::participant::ParameterError;
use lockstep::units::{Angle, AngularMomentum, AngularRate, Each, Force, Length, PerTime, Quantity, Torque};
use multibody::{Description, Inertia};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use serde::Deserialize;

/// Avoidance of joint ends and of the straight elbow in the null space. The ends are those of the URDF.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Avoidance {
    /// Distance from an end at which a joint is turned back.
    #[serde(default = "margin")]
    pub margin: Quantity<Angle>,
    /// Rate asked of a joint at the end of its range.
    #[serde(default = "rate")]
    pub rate: Quantity<AngularRate>,
    /// The elbow's joint, if its straight position is to be avoided as well.
    pub elbow: Option<String>,
    /// Angle below which the elbow is asked to bend.
    #[serde(default = "margin")]
    pub elbow_margin: Quantity<Angle>,
    /// Rate asked at the straight position.
    #[serde(default = "rate")]
    pub elbow_rate: Quantity<AngularRate>,
}

const fn margin() -> Quantity<Angle> {
    Quantity::of(std::f64::consts::PI / 9.0) // 20 deg
}

const fn rate() -> Quantity<AngularRate> {
    Quantity::of(std::f64::consts::PI / 90.0) // 2 deg/s
}

impl Avoidance {
    /// For the law, with the ends of the joints of `arm` in the URDF.
    ///
    /// # Errors
    /// When a joint has no ends there, or there is no such elbow.
    pub fn law(&self, urdf: &str, arm: &Arm) -> Result<AvoidanceParameters, ParameterError> {
        let description = Description::from_urdf(urdf).map_err(|error| ParameterError::new("urdf", error))?;
        let (mut lower_rad, mut upper_rad) = ([0.0; 7], [0.0; 7]);
        for (at, name) in arm.joints.iter().enumerate() {
            let limits = description.joints.iter().find(|joint| joint.name == *name);
            let limits = limits.and_then(|joint| joint.limits).ok_or_else(|| {
                let reason = format!("joint `{name}` has no <limit> in the URDF to be kept from");
                ParameterError::new("avoidance", reason)
            })?;
            (lower_rad[at], upper_rad[at]) = (limits.lower, limits.upper);
        }
        let elbow = match &self.elbow {
            None => None,
            Some(name) => {
                let joint = arm.joints.iter().position(|joint| joint == name).ok_or_else(|| {
                    let reason = format!("there is no joint `{name}`; there are {}", arm.joints.join(", "));
                    ParameterError::new("avoidance.elbow", reason)
                })?;
                Some(Elbow {
                    joint,
                    margin_rad: self.elbow_margin.si(),
                    rate_rad_s: self.elbow_rate.si(),
                })
            }
        };
        Ok(AvoidanceParameters {
            lower_rad,
            upper_rad,
            margin_rad: self.margin.si(),
            rate_rad_s: self.rate.si(),
            elbow,
        })
    }
}

/// Sharing of the base's torque between wheels and thruster couples.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Allocation {
    /// Torque limit of the wheels.
    pub wheel_torque: Each<Torque, 3>,
    /// Momentum limit of the wheels.
    pub wheel_momentum: Each<AngularMomentum, 3>,
    /// Force limit of the thrusters along each axis.
    pub thruster_force: Each<Force, 3>,
    /// Lever arm of the couples about each axis.
    pub lever_arm: Each<Length, 3>,
    /// Rate at which momentum above the threshold is shed.
    pub unload_rate: Quantity<PerTime>,
    /// Momentum that is left alone.
    pub unload_above: Quantity<AngularMomentum>,
}

impl Default for Allocation {
    /// The stock actuators, unloading at half of the wheels' momentum.
    fn default() -> Self {
        Self {
            wheel_torque: Each::of([0.2; 3]),
            wheel_momentum: Each::of([12.0; 3]),
            thruster_force: Each::of([9.0; 3]),
            lever_arm: Each::of([0.5; 3]),
            unload_rate: Quantity::of(0.05),
            unload_above: Quantity::of(6.0),
        }
    }
}

impl Allocation {
    /// For the law.
    pub fn law(&self) -> AllocationParameters {
        AllocationParameters {
            wheel_torque_nm: self.wheel_torque.si().into(),
            wheel_momentum_nms: self.wheel_momentum.si().into(),
            thruster_force_n: self.thruster_force.si().into(),
            lever_arm_m: self.lever_arm.si().into(),
            unload_rate_1_s: self.unload_rate.si(),
            unload_above_nms: self.unload_above.si(),
        }
    }
}

/// Stabilisation of the stack after the grasp: every rate is damped by the inner loop alone, within bounds of its own.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Stabilise {
    /// Factor on the gains: the stack is heavier than the servicer.
    pub gain_factor: f64,
    /// Bound of the torque on the base: the wheels'.
    pub torque_bound: Each<Torque, 3>,
    /// Bound of the force on the base.
    pub force_bound: Each<Force, 3>,
    /// Bound of each joint's torque: what gripper and target may be loaded with.
    pub joint_bound: Each<Torque, 7>,
}

impl Default for Stabilise {
    /// Twice the gains; the wheels' torque, half the thrusters' force, 10 N m at every joint.
    fn default() -> Self {
        Self {
            gain_factor: 2.0,
            torque_bound: Each::of([0.2; 3]),
            force_bound: Each::of([4.5; 3]),
            joint_bound: Each::of([10.0; 7]),
        }
    }
}

/// The target in the gripper as planned: its grasp frame on the end effector's.
pub fn payload(target: &Target) -> Payload {
    let [roll, pitch, yaw] = target.grasp.attitude.si();
    let r_tg = multibody::rotation::roll_pitch_yaw(roll, pitch, yaw);
    let r_et: Matrix3<f64> = r_tg.transpose();
    Payload {
        pose: Pose {
            position: -(r_et * Vector3::from(target.grasp.position.si())),
            attitude: UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(r_et)),
        },
        inertia: Inertia {
            mass: target.mass.si(),
            com: Vector3::zeros(),
            about_com: Matrix3::from_diagonal(&Vector3::from(target.inertia.si())),
        },
    }
}
