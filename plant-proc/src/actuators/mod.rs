//! From the command to what the actuators do over a step.
//!
//! Every actuator is a [`Channel`]: fault, dead zone, quantisation, saturation, first-order lag, in this order. Wheels also
//! store momentum and thrusters may have a shortest firing.

mod channel;
mod faults;
mod thrusters;
mod wheels;

use interfaces::{Command, Couples, JOINTS};
use lockstep::participant::ParameterError;
use lockstep::units::{AngularMomentum, Each, Force, Kind, Length, Quantity, Time, Torque};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

pub use channel::{Channel, ChannelState, Shape};
pub use faults::{Effect, FaultParameters, Faults, Unit};
pub use thrusters::{THRUSTERS, Thrusters, ThrustersState};
pub use wheels::{Wheels, WheelsState};

use crate::dynamics::Forces;

/// The actuators of a scenario.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ActuatorParameters {
    /// Reaction wheels, one a body axis.
    pub wheels: WheelParameters,
    /// Thrusters, four a body axis.
    pub thrusters: ThrusterParameters,
    /// Joint motors.
    pub joints: JointParameters,
}

/// The wheels.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct WheelParameters {
    /// Largest torque.
    pub torque: Each<Torque, 3>,
    /// Largest momentum: a full wheel gives no torque that would fill it further.
    pub momentum: Each<AngularMomentum, 3>,
    /// Momentum at the start.
    pub start_momentum: Each<AngularMomentum, 3>,
    /// Whether the spinning wheels' gyroscopic torque reaches the base; if not, their own control compensates it as far as the wheels can
    /// take what that stores in them.
    pub gyroscopic: bool,
    /// Largest torque of a motor with what it compensates; `torque` is then that of the command alone. None unless given.
    pub motor_torque: Option<Each<Torque, 3>>,
    /// Time constant; none unless given.
    pub lag: Option<Quantity<Time>>,
    /// Commands smaller than this do nothing.
    pub dead_zone: Quantity<Torque>,
    /// Steps in which the torque comes; continuous when zero.
    pub quantum: Quantity<Torque>,
}

impl Default for WheelParameters {
    /// 0.2 N m and 12 N m s, at rest, without further faults.
    fn default() -> Self {
        Self {
            torque: Each::of([0.2; 3]),
            momentum: Each::of([12.0; 3]),
            start_momentum: Each::of([0.0; 3]),
            gyroscopic: false,
            motor_torque: None,
            lag: None,
            dead_zone: Quantity::of(0.0),
            quantum: Quantity::of(0.0),
        }
    }
}

/// The thrusters: for each body axis two that push along it and two that push against it.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ThrusterParameters {
    /// Largest force along each axis: two thrusters at full thrust.
    pub force: Each<Force, 3>,
    /// Lever arm of the two about body x, y and z; thrusters along y turn about x, along z about y, along x about z.
    pub lever_arm: Each<Length, 3>,
    /// Shortest firing. If given, thrusters only fire at full thrust, in pulses that make the commanded impulse.
    pub minimum_on: Option<Quantity<Time>>,
    /// Time constant; none unless given.
    pub lag: Option<Quantity<Time>>,
    /// Thrusts smaller than this do nothing.
    pub dead_zone: Quantity<Force>,
    /// Steps in which a thrust comes; continuous when zero.
    pub quantum: Quantity<Force>,
}

impl Default for ThrusterParameters {
    /// 9 N an axis on lever arms of half a metre, without further faults.
    fn default() -> Self {
        Self {
            force: Each::of([9.0; 3]),
            lever_arm: Each::of([0.5; 3]),
            minimum_on: None,
            lag: None,
            dead_zone: Quantity::of(0.0),
            quantum: Quantity::of(0.0),
        }
    }
}

/// The joint motors.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct JointParameters {
    /// Largest torque of each.
    pub torque: Each<Torque, JOINTS>,
    /// Time constant; none unless given.
    pub lag: Option<Quantity<Time>>,
    /// Commands smaller than this do nothing.
    pub dead_zone: Quantity<Torque>,
    /// Steps in which the torque comes; continuous when zero.
    pub quantum: Quantity<Torque>,
}

impl Default for JointParameters {
    /// The limits of the stock arm, without further faults.
    fn default() -> Self {
        Self {
            torque: Each::of([320.0, 320.0, 176.0, 176.0, 110.0, 40.0, 40.0]),
            lag: None,
            dead_zone: Quantity::of(0.0),
            quantum: Quantity::of(0.0),
        }
    }
}

/// All that the actuators remember.
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
        let shape = Shape::new(
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
            joints: motor.torque.si().map(|limit| Channel::new(shape, limit)),
            faults: Faults::new(faults, joints)?,
        })
    }

    /// All that they remember.
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

    /// What the actuators do over the step that starts at `t`, s, with `momentum` in the wheels, N m s, on a base that turns at `omega`,
    /// rad/s, both in base axes.
    pub fn apply(
        &mut self,
        t: f64,
        command: &Command,
        couples: &Couples,
        momentum: &Vector3<f64>,
        omega: &Vector3<f64>,
    ) -> Forces {
        let faults = &self.faults;
        let turned = omega.cross(momentum);
        let wheels = self.wheels.apply(&command.torque_B, momentum, &turned, |axis| {
            faults.effect(t, Unit::Wheel(axis))
        });
        let (thruster_force, thruster_torque, thrust) =
            self.thrusters.apply(&command.force_B, &couples.torque_B, |n| {
                faults.effect(t, Unit::Thruster(n))
            });
        let effects: [Option<Effect>; JOINTS] = std::array::from_fn(|joint| faults.effect(t, Unit::Joint(joint)));
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

/// Refuses a negative limit. `K` tells how to write a good one.
fn not_negative<K: Kind>(key: &str, of: &str, value: f64) -> Result<f64, ParameterError> {
    if value >= 0.0 {
        return Ok(value);
    }
    Err(ParameterError::new(
        key,
        format!(
            "{value} {}{of} is negative; write for example \"{}\"",
            K::DIMENSION,
            K::EXAMPLE
        ),
    ))
}
