//! Actuator models: from the command to the forces and torques over a step.
//!
//! Every actuator is a [`Channel`]: fault, dead zone, quantisation, saturation, first-order lag, in this order. Wheels also
//! store momentum, and thrusters may have a minimum on-time.

mod channel;
mod faults;
mod parameters;
mod thrusters;
mod wheels;

use interfaces::{Command, JOINTS, ThrusterTorque};
use lockstep::participant::ParameterError;
use lockstep::units::Torque;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use parameters::not_negative;

pub use channel::{Channel, ChannelParameters, ChannelState};
pub use faults::{Actuator, Effect, FaultParameters, Faults};
pub use parameters::{ActuatorParameters, THRUSTERS, ThrusterParameters, WheelParameters};
pub use thrusters::{Thrusters, ThrustersState};
pub use wheels::{Wheels, WheelsState};

use crate::dynamics::Forces;

/// Complete state of the actuators.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ActuatorsState {
    /// The wheels.
    pub wheels: WheelsState,
    /// The thrusters.
    pub thrusters: ThrustersState,
    /// The joint motors.
    pub joints: [ChannelState; JOINTS],
}

/// The actuators.
#[derive(Debug, Clone)]
pub struct Actuators {
    wheels: Wheels,
    thrusters: Thrusters,
    joints: [Channel; JOINTS],
    faults: Faults,
}

impl Actuators {
    /// The actuators of a plant with this period, s, whose joints have these names.
    ///
    /// # Errors
    /// Names the parameter that is out of range.
    pub fn new(
        parameters: &ActuatorParameters,
        faults: &[FaultParameters],
        joints: &[String; JOINTS],
        period: f64,
    ) -> Result<Self, ParameterError> {
        let motor = &parameters.joints;
        let channel_parameters = ChannelParameters::new(
            "actuators.joints",
            motor.lag,
            motor.dead_zone.si(),
            motor.quantum.si(),
            period,
        )?;
        for (joint, limit) in joints.iter().zip(motor.torque.si()) {
            not_negative::<Torque>("actuators.joints.torque", &format!(" of {joint}"), limit)?;
        }
        Ok(Self {
            wheels: Wheels::new(&parameters.wheels, period)?,
            thrusters: Thrusters::new(&parameters.thrusters, period)?,
            joints: motor.torque.si().map(|limit| Channel::new(channel_parameters, limit)),
            faults: Faults::new(faults, joints)?,
        })
    }

    /// Their complete state.
    pub fn state(&self) -> ActuatorsState {
        ActuatorsState {
            wheels: self.wheels.state(),
            thrusters: self.thrusters.state(),
            joints: self.joints.each_ref().map(Channel::state),
        }
    }

    /// Continues from `state`.
    pub fn restore(&mut self, state: &ActuatorsState) {
        self.wheels.restore(&state.wheels);
        self.thrusters.restore(&state.thrusters);
        for (joint, state) in self.joints.iter_mut().zip(&state.joints) {
            joint.restore(state);
        }
    }

    /// Forces and torques of the actuators over the step that starts at `t`, s, with the wheels' `momentum`, N m s, on a base with angular
    /// velocity `omega`, rad/s, both in base axes.
    pub fn apply(
        &mut self,
        t: f64,
        command: &Command,
        couples: &ThrusterTorque,
        momentum: &Vector3<f64>,
        omega: &Vector3<f64>,
    ) -> Forces {
        let faults = &self.faults;
        let gyroscopic_torque = omega.cross(momentum);
        let wheels = self
            .wheels
            .apply(&command.torque_B, momentum, &gyroscopic_torque, |axis| {
                faults.effect(t, Actuator::Wheel(axis))
            });
        let (thruster_force, thruster_torque, thrust) =
            self.thrusters.apply(&command.force_B, &couples.torque_B, |n| {
                faults.effect(t, Actuator::Thruster(n))
            });
        let effects: [Option<Effect>; JOINTS] = std::array::from_fn(|joint| faults.effect(t, Actuator::Joint(joint)));
        Forces {
            wheel_torque: wheels.torque,
            compensated: wheels.compensated,
            thruster_force,
            thruster_torque,
            thrust,
            joint_torque: std::array::from_fn(|joint| self.joints[joint].apply(command.tau[joint], effects[joint])),
            braked: effects.map(|effect| effect == Some(Effect::Locked)),
        }
    }
}
