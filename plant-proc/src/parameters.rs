//! Plant parameters of a scenario. Every default is that of the ideal set: exact sensors, and actuators with limits as
//! their only imperfection.

use interfaces::files::{Servicer, Target};
use lockstep::participant::ParameterError;
use lockstep::units::{Angle, AngularRate, Length, PerAxis, Quantity, QuantityKind, Speed, Time, Vector};
use serde::Deserialize;

use crate::actuators::ActuatorParameters;
use crate::actuators::FaultParameters;
pub use crate::dynamics::SloshModel;
use crate::sensors::SensorParameters;

/// `participants.NAME.parameters` of a plant.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
    /// The mechanism, as URDF text.
    pub urdf: String,
    /// Servicer data that a URDF cannot express.
    pub servicer: Servicer,
    /// The target.
    pub target: Target,
    /// The servicer at the first instant.
    pub start: Start,
    /// The target at the first instant.
    pub target_start: TargetStart,
    /// The propellant's pendulum: on two `hinges`, as in the paper, or `spherical`.
    #[serde(default)]
    pub slosh: SloshModel,
    /// The integrator.
    #[serde(default)]
    pub integrator: Integrator,
    /// The actuators.
    #[serde(default)]
    pub actuators: ActuatorParameters,
    /// The sensors.
    #[serde(default)]
    pub sensors: SensorParameters,
    /// Gripper behaviour: when it closes on the target; never by default.
    pub after_grasp: Option<AfterGrasp>,
    /// Actuator faults.
    #[serde(default)]
    pub faults: Vec<FaultParameters>,
}

/// The servicer at the first instant.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Start {
    /// Position of the base, world axes.
    pub position: Vector<Length, 3>,
    /// Roll, pitch and yaw of the base.
    #[serde(default = "zero")]
    pub attitude: Vector<Angle, 3>,
    /// Velocity of the base's origin, base axes.
    #[serde(default = "at_rest")]
    pub velocity: Vector<Speed, 3>,
    /// Angular velocity of the base, base axes.
    #[serde(default = "not_turning")]
    pub rate: Vector<AngularRate, 3>,
    /// Joint angles.
    pub joints: PerAxis<Angle, 7>,
    /// Joint rates.
    #[serde(default = "joints_at_rest")]
    pub joint_rates: PerAxis<AngularRate, 7>,
    /// Angles of the pendulum.
    #[serde(default = "hanging")]
    pub slosh: PerAxis<Angle, 2>,
    /// Rates of the pendulum.
    #[serde(default = "hanging_still")]
    pub slosh_rates: PerAxis<AngularRate, 2>,
}

/// The target at the first instant.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TargetStart {
    /// Position of its centre of mass, world axes.
    #[serde(default = "at_origin")]
    pub position: Vector<Length, 3>,
    /// Roll, pitch and yaw.
    #[serde(default = "zero")]
    pub attitude: Vector<Angle, 3>,
    /// Velocity of its centre of mass, world axes.
    #[serde(default = "at_rest")]
    pub velocity: Vector<Speed, 3>,
    /// Angular velocity, target axes.
    pub rate: Vector<AngularRate, 3>,
}

/// How the motion is integrated.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Integrator {
    /// `rk4` or `dop853`, both with a fixed step.
    pub method: String,
    /// Equal steps within a period.
    pub substeps: u32,
}

impl Default for Integrator {
    fn default() -> Self {
        Self {
            method: "rk4".to_owned(),
            substeps: 1,
        }
    }
}

/// The gripper.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AfterGrasp {
    /// Time at which it closes if the end effector is near enough by then; otherwise it closes as soon as that is so.
    pub at: Quantity<Time>,
    /// Distance between end effector and grasp frame within which it can close.
    #[serde(default = "reach")]
    pub within: Quantity<Length>,
    /// Angle between the two within which it can close.
    #[serde(default = "reach_angle")]
    pub within_angle: Quantity<Angle>,
}

impl AfterGrasp {
    /// Rejects a gripper that could never close, or that would have closed before the start.
    ///
    /// # Errors
    /// Names the parameter, its value and the remedy.
    pub fn validate(&self) -> Result<(), ParameterError> {
        let at = self.at.si();
        if at < 0.0 {
            let reason = format!("{at} s is before the start; write for example \"30 s\"");
            return Err(ParameterError::new("after_grasp.at", reason));
        }
        above_zero("after_grasp.within", self.within)?;
        above_zero("after_grasp.within_angle", self.within_angle)
    }
}

/// Rejects a distance or an angle that is not above zero.
fn above_zero<K: QuantityKind>(key: &str, value: Quantity<K>) -> Result<(), ParameterError> {
    if value.si() > 0.0 {
        return Ok(());
    }
    let reason = format!(
        "{} is not above zero; write for example \"{}\"",
        K::text(value.si()),
        K::EXAMPLE
    );
    Err(ParameterError::new(key, reason))
}

const fn zero() -> Vector<Angle, 3> {
    Vector::of([0.0; 3])
}
const fn at_rest() -> Vector<Speed, 3> {
    Vector::of([0.0; 3])
}
const fn not_turning() -> Vector<AngularRate, 3> {
    Vector::of([0.0; 3])
}
const fn joints_at_rest() -> PerAxis<AngularRate, 7> {
    PerAxis::of([0.0; 7])
}
const fn hanging() -> PerAxis<Angle, 2> {
    PerAxis::of([0.0; 2])
}
const fn hanging_still() -> PerAxis<AngularRate, 2> {
    PerAxis::of([0.0; 2])
}
const fn at_origin() -> Vector<Length, 3> {
    Vector::of([0.0; 3])
}
const fn reach() -> Quantity<Length> {
    Quantity::of(0.01)
}
const fn reach_angle() -> Quantity<Angle> {
    Quantity::of(std::f64::consts::PI / 180.0)
}
