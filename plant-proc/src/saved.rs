//! The complete state of a plant as plain numbers.

use multibody::{Placement, Quaternion};
use nalgebra::{Matrix3, SVector, Vector3};
use serde::{Deserialize, Serialize};

use crate::actuators::{ActuatorsState, THRUSTERS};
use crate::dynamics::{Bob, Books, COORDINATES, Forces, Grasp, Motion, Servicer, Target, Totals, VELOCITIES};
use crate::sensors::SensorsState;

/// A tree's state.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct SavedState {
    position: [f64; 3],
    attitude: [f64; 4],
    joints: Vec<f64>,
    velocity: Vec<f64>,
}

/// Momentum and energy.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct SavedTotals {
    linear: [f64; 3],
    angular: [f64; 3],
    energy: f64,
}

/// How the gripper holds the target.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct SavedGrasp {
    position: [f64; 3],
    axes: [[f64; 3]; 3],
    loss: f64,
}

/// Everything.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Saved {
    /// The servicer.
    pub servicer: SavedState,
    /// The target.
    pub target: SavedState,
    /// Wheel momentum, impulse, angular impulse, the bob's direction and rate.
    pub vectors: [[f64; 3]; 5],
    /// Work and damper loss.
    pub work: [f64; 2],
    /// What the actuators did last.
    pub forces: [f64; 16 + THRUSTERS],
    /// Joints that were braked.
    pub braked: [bool; 7],
    /// The actuators.
    pub actuators: ActuatorsState,
    /// The sensors.
    pub sensors: SensorsState,
    /// The books' start.
    pub start: SavedTotals,
    /// The books' impacts.
    pub impact_loss: f64,
    /// The grasp, once it has happened.
    pub grasp: Option<SavedGrasp>,
    /// Attitudes of end effector and grasp frame as they were given out last, for the sign of the next.
    pub signs: [[f64; 4]; 2],
}

fn saved<const N: usize, const V: usize>(state: &multibody::State<N, V>) -> SavedState {
    SavedState {
        position: state.p_nb.into(),
        attitude: state.quat_nb.to_wxyz(),
        joints: state.q.as_slice().to_vec(),
        velocity: state.nu.as_slice().to_vec(),
    }
}

/// `None` when the lengths are of another mechanism.
fn restored<const N: usize, const V: usize>(saved: &SavedState) -> Option<multibody::State<N, V>> {
    if saved.joints.len() != N || saved.velocity.len() != V {
        return None;
    }
    Some(multibody::State {
        p_nb: saved.position.into(),
        quat_nb: Quaternion::from_wxyz(saved.attitude),
        q: SVector::from_column_slice(&saved.joints),
        nu: SVector::from_column_slice(&saved.velocity),
    })
}

impl Saved {
    /// From the parts of a plant.
    pub fn of(
        motion: &Motion,
        target: &Target,
        forces: &Forces,
        parts: (ActuatorsState, SensorsState),
        books: &Books,
        grasp: Option<&Grasp>,
        signs: [[f64; 4]; 2],
    ) -> Self {
        let mut made = [0.0; 16 + THRUSTERS];
        let values = forces
            .wheel_torque
            .iter()
            .chain(&forces.thruster_force)
            .chain(&forces.thruster_torque)
            .chain(&forces.joint_torque)
            .chain(&forces.thrust);
        for (slot, value) in made.iter_mut().zip(values) {
            *slot = *value;
        }
        Self {
            servicer: saved(&motion.servicer),
            target: saved(target),
            vectors: [
                motion.wheel_momentum.into(),
                motion.impulse.into(),
                motion.angular_impulse.into(),
                motion.bob.d.into(),
                motion.bob.w.into(),
            ],
            work: [motion.work, motion.loss],
            forces: made,
            braked: forces.braked,
            actuators: parts.0,
            sensors: parts.1,
            start: SavedTotals {
                linear: books.start.linear.into(),
                angular: books.start.angular.into(),
                energy: books.start.energy,
            },
            impact_loss: books.impact_loss,
            grasp: grasp.map(|grasp| SavedGrasp {
                position: grasp.held.p.into(),
                axes: grasp.held.r.into(),
                loss: grasp.loss,
            }),
            signs,
        }
    }

    /// The motion and the target; `None` when this is of another mechanism.
    pub fn motion(&self) -> Option<(Motion, Target)> {
        let [wheel_momentum, impulse, angular_impulse, d, w] = self.vectors.map(Vector3::from);
        let servicer: Servicer = restored::<COORDINATES, VELOCITIES>(&self.servicer)?;
        Some((
            Motion {
                servicer,
                bob: Bob { d, w },
                wheel_momentum,
                impulse,
                angular_impulse,
                work: self.work[0],
                loss: self.work[1],
            },
            restored::<0, 6>(&self.target)?,
        ))
    }

    /// What the actuators did last.
    pub fn forces(&self) -> Forces {
        let vector = |at: usize| Vector3::new(self.forces[at], self.forces[at + 1], self.forces[at + 2]);
        Forces {
            wheel_torque: vector(0),
            // of the step that is over; the next one asks the actuators again
            compensated: [false; 3],
            thruster_force: vector(3),
            thruster_torque: vector(6),
            joint_torque: std::array::from_fn(|joint| self.forces[9 + joint]),
            thrust: std::array::from_fn(|thruster| self.forces[16 + thruster]),
            braked: self.braked,
        }
    }

    /// The books.
    pub fn books(&self) -> Books {
        Books {
            start: Totals {
                linear: self.start.linear.into(),
                angular: self.start.angular.into(),
                energy: self.start.energy,
            },
            impact_loss: self.impact_loss,
        }
    }

    /// The grasp.
    pub fn grasp(&self) -> Option<Grasp> {
        self.grasp.as_ref().map(|grasp| Grasp {
            held: Placement {
                p: grasp.position.into(),
                r: Matrix3::from(grasp.axes),
            },
            loss: grasp.loss,
        })
    }
}
