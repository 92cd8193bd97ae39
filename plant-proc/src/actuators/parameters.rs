//! Actuator parameters of a scenario.

use interfaces::JOINTS;
use lockstep::participant::ParameterError;
use lockstep::units::{AngularMomentum, Force, Length, PerAxis, Quantity, QuantityKind, Time, Torque};
use serde::Deserialize;

/// Number of thrusters.
pub const THRUSTERS: usize = 12;

/// The actuators of a scenario.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ActuatorParameters {
    /// Reaction wheels, one per body axis.
    pub wheels: WheelParameters,
    /// Thrusters, four per body axis.
    pub thrusters: ThrusterParameters,
    /// Joint motors.
    pub joints: JointParameters,
}

/// The wheels.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct WheelParameters {
    /// Largest torque.
    pub torque: PerAxis<Torque, 3>,
    /// Largest momentum: a saturated wheel gives no torque that would increase its momentum.
    pub momentum: PerAxis<AngularMomentum, 3>,
    /// Momentum at the start.
    pub start_momentum: PerAxis<AngularMomentum, 3>,
    /// Whether the gyroscopic torque of the spinning wheels acts on the base; if not, the wheel control compensates it as far as the wheels
    /// can store the momentum that this takes.
    pub gyroscopic: bool,
    /// Largest torque of a motor, compensation included; `torque` then limits the command alone. No limit by default.
    pub motor_torque: Option<PerAxis<Torque, 3>>,
    /// Time constant of the lag; no lag by default.
    pub lag: Option<Quantity<Time>>,
    /// Commands smaller than this do nothing.
    pub dead_zone: Quantity<Torque>,
    /// Quantisation step of the torque; continuous when zero.
    pub quantum: Quantity<Torque>,
}

impl Default for WheelParameters {
    /// 0.2 N m and 12 N m s, at rest, without further imperfections.
    fn default() -> Self {
        Self {
            torque: PerAxis::of([0.2; 3]),
            momentum: PerAxis::of([12.0; 3]),
            start_momentum: PerAxis::of([0.0; 3]),
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
    pub force: PerAxis<Force, 3>,
    /// Lever arm of the two about body x, y and z; thrusters along y turn about x, along z about y, along x about z.
    pub lever_arm: PerAxis<Length, 3>,
    /// Minimum on-time. If given, thrusters fire only at full thrust, in pulses that add up to the commanded impulse.
    pub minimum_on: Option<Quantity<Time>>,
    /// Time constant of the lag; no lag by default.
    pub lag: Option<Quantity<Time>>,
    /// Thrusts smaller than this do nothing.
    pub dead_zone: Quantity<Force>,
    /// Quantisation step of the thrust; continuous when zero.
    pub quantum: Quantity<Force>,
}

impl Default for ThrusterParameters {
    /// 9 N per axis on lever arms of half a metre, without further imperfections.
    fn default() -> Self {
        Self {
            force: PerAxis::of([9.0; 3]),
            lever_arm: PerAxis::of([0.5; 3]),
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
    pub torque: PerAxis<Torque, JOINTS>,
    /// Time constant of the lag; no lag by default.
    pub lag: Option<Quantity<Time>>,
    /// Commands smaller than this do nothing.
    pub dead_zone: Quantity<Torque>,
    /// Quantisation step of the torque; continuous when zero.
    pub quantum: Quantity<Torque>,
}

impl Default for JointParameters {
    /// The limits of the stock arm, without further imperfections.
    fn default() -> Self {
        Self {
            torque: PerAxis::of([320.0, 320.0, 176.0, 176.0, 110.0, 40.0, 40.0]),
            lag: None,
            dead_zone: Quantity::of(0.0),
            quantum: Quantity::of(0.0),
        }
    }
}

/// Rejects a negative limit. `K` gives the unit for the error message.
pub(super) fn not_negative<K: QuantityKind>(key: &str, of: &str, value: f64) -> Result<f64, ParameterError> {
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
