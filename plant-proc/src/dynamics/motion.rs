//! Integrated state, and the actuator forces held over a step.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::{Bob, COORDINATES, VELOCITIES};
use crate::actuators::THRUSTERS;

/// The integrated state.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(bound(
    serialize = "T: nalgebra::Scalar + Serialize",
    deserialize = "T: nalgebra::Scalar + Deserialize<'de>"
))]
pub struct Motion<T = f64> {
    /// The servicer.
    pub servicer: multibody::State<COORDINATES, VELOCITIES, T>,
    /// The bob of a spherical pendulum; the hinge coordinates in `servicer` are then zero.
    pub bob: Bob<T>,
    /// Angular momentum in the wheels, base axes, N m s.
    pub wheel_momentum: Vector3<T>,
    /// Impulse of the thrusters since the start, world axes, N s.
    pub impulse: Vector3<T>,
    /// Angular impulse of the thrusters about the world's origin since the start, world axes, N m s.
    pub angular_impulse: Vector3<T>,
    /// Work of all actuators on the servicer since the start, J.
    pub work: T,
    /// Energy dissipated by dampers since the start, J.
    pub loss: T,
}

/// Actuator forces and torques over a step.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(bound(
    serialize = "T: nalgebra::Scalar + Serialize",
    deserialize = "T: nalgebra::Scalar + Deserialize<'de>"
))]
pub struct Forces<T = f64> {
    /// Torque of the wheels, base axes, N m: on the base on compensated axes, of the motors on the others.
    pub wheel_torque: Vector3<T>,
    /// Axes on which the wheel control compensates the gyroscopic torque `ω × h` over the step: the torque on the base is `wheel_torque`.
    /// On the others it is `wheel_torque − ω × h`. Momentum is conserved either way.
    pub compensated: [bool; 3],
    /// Force of the thrusters, base axes, N.
    pub thruster_force: Vector3<T>,
    /// Torque of the thrusters, base axes, N m.
    pub thruster_torque: Vector3<T>,
    /// Thrust of each thruster, N.
    pub thrust: [T; THRUSTERS],
    /// Torques of the joint motors, N m.
    pub joint_torque: [T; interfaces::JOINTS],
    /// Braked joints; their motors give no torque.
    pub braked: [bool; interfaces::JOINTS],
}
