//! What a scenario says about actuators.

use interfaces::JOINTS;
use lockstep::participant::ParameterError;
use lockstep::units::{AngularMomentum, Each, Force, Kind, Length, Quantity, Time, Torque};
use serde::Deserialize;

/// How many there are.
pub const THRUSTERS: usize = 12;

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

/// Refuses a negative limit. `K` tells how to write a good one.
pub(super) fn not_negative<K: Kind>(key: &str, of: &str, value: f64) -> Result<f64, ParameterError> {
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
