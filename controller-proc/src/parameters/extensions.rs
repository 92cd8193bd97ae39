//! Parameters of extensions beyond the paper: each off unless the scenario configures it.

use control_laws::allocation::AllocationParameters;
use control_laws::avoidance::{AvoidanceParameters, Elbow};
use control_laws::model::Payload;
use control_laws::stabilise;
use guidance_laws::Pose;
use interfaces::JOINTS;
use interfaces::files::{Arm, Target};
use lockstep::participant::ParameterError;
use lockstep::units::{Angle, AngularMomentum, AngularRate, Force, Length, PerAxis, PerTime, Quantity, Speed, Torque};
use multibody::{Description, Inertia, UrdfOptions};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use serde::Deserialize;

use super::channels;

/// Null-space avoidance of joint limits and of the straight elbow. The limits are those of the URDF.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Avoidance {
    /// Distance from a limit at which avoidance starts.
    #[serde(default = "margin")]
    pub margin: Quantity<Angle>,
    /// Rate commanded to a joint at its limit.
    #[serde(default = "rate")]
    pub rate: Quantity<AngularRate>,
    /// Name of the elbow joint, if its straight position is also to be avoided.
    pub elbow: Option<String>,
    /// Angle below which the elbow is commanded to bend.
    #[serde(default = "margin")]
    pub elbow_margin: Quantity<Angle>,
    /// Rate commanded at the straight position.
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
    /// Parameters of the law, with the limits of the joints of `arm` from the URDF.
    ///
    /// # Errors
    /// When a joint has no limits there, or there is no such elbow joint.
    pub fn law_parameters(&self, urdf: &str, arm: &Arm) -> Result<AvoidanceParameters, ParameterError> {
        let description = Description::read_urdf(urdf, UrdfOptions { allow_unphysical: true })
            .map_err(|error| ParameterError::new("urdf", error))?
            .description;
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

/// Allocation of the base's torque to wheels and thruster couples.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Allocation {
    /// Torque limit of the wheels.
    pub wheel_torque: PerAxis<Torque, 3>,
    /// Momentum limit of the wheels.
    pub wheel_momentum: PerAxis<AngularMomentum, 3>,
    /// Force limit of the thrusters along each axis.
    pub thruster_force: PerAxis<Force, 3>,
    /// Lever arm of the couples about each axis.
    pub lever_arm: PerAxis<Length, 3>,
    /// Rate at which momentum above the threshold is unloaded.
    pub unload_rate: Quantity<PerTime>,
    /// Threshold of momentum below which nothing is unloaded.
    pub unload_above: Quantity<AngularMomentum>,
}

impl Default for Allocation {
    /// The stock actuators, unloading above half of the wheels' momentum limit.
    fn default() -> Self {
        Self {
            wheel_torque: PerAxis::of([0.2; 3]),
            wheel_momentum: PerAxis::of([12.0; 3]),
            thruster_force: PerAxis::of([9.0; 3]),
            lever_arm: PerAxis::of([0.5; 3]),
            unload_rate: Quantity::of(0.05),
            unload_above: Quantity::of(6.0),
        }
    }
}

impl Allocation {
    /// Parameters of the law.
    pub fn law_parameters(&self) -> AllocationParameters {
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

/// Stabilisation of the stack after the grasp: everything is brought to rest within the limits of wheels, thrusters, joints
/// and gripper.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Stabilise {
    /// Decay rate of the base's rotation while no limit is active.
    pub rotation: Quantity<PerTime>,
    /// Decay rate of the base's translation; zero leaves the translation uncontrolled.
    pub translation: Quantity<PerTime>,
    /// Decay rate of the joint rates.
    pub joints: Quantity<PerTime>,
    /// Limit of the torque on the base.
    pub torque: PerAxis<Torque, 3>,
    /// Limit of the force on the base.
    pub force: PerAxis<Force, 3>,
    /// Limit of each joint's torque.
    pub joint_torque: PerAxis<Torque, JOINTS>,
    /// Limit of the force in the gripper.
    pub gripper_force: Quantity<Force>,
    /// Limit of the torque in the gripper.
    pub gripper_torque: Quantity<Torque>,
    /// Momentum that the wheels can store.
    pub wheel_momentum: PerAxis<AngularMomentum, 3>,
    /// Threshold below which an angular rate counts as rest.
    pub rest_rate: Quantity<AngularRate>,
    /// Threshold below which a velocity counts as rest.
    pub rest_speed: Quantity<Speed>,
}

impl Default for Stabilise {
    /// Decay rates of 0.1 1/s, the limits of the stock actuators, 50 N and 20 N m in the gripper; at rest below 0.01 deg/s and
    /// 1 mm/s.
    fn default() -> Self {
        Self {
            rotation: Quantity::of(0.1),
            translation: Quantity::of(0.1),
            joints: Quantity::of(0.1),
            torque: PerAxis::of([0.2; 3]),
            force: PerAxis::of([9.0; 3]),
            joint_torque: PerAxis::of([320.0, 320.0, 176.0, 176.0, 110.0, 40.0, 40.0]),
            gripper_force: Quantity::of(50.0),
            gripper_torque: Quantity::of(20.0),
            wheel_momentum: PerAxis::of([12.0; 3]),
            rest_rate: Quantity::of(std::f64::consts::PI / 18_000.0),
            rest_speed: Quantity::of(1e-3),
        }
    }
}

impl Stabilise {
    /// Parameters of the law.
    pub fn law_parameters(&self, allocation: Option<&Allocation>) -> stabilise::Parameters {
        stabilise::Parameters {
            rotation_1_s: self.rotation.si(),
            translation_1_s: self.translation.si(),
            joints_1_s: self.joints.si(),
            limits: channels(self.torque.si(), self.force.si(), self.joint_torque.si()),
            gripper_force_n: self.gripper_force.si(),
            gripper_torque_nm: self.gripper_torque.si(),
            wheel_momentum_nms: self.wheel_momentum.si().into(),
            rest_rate_rad_s: self.rest_rate.si(),
            rest_speed_m_s: self.rest_speed.si(),
            allocation: allocation.map(Allocation::law_parameters),
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
