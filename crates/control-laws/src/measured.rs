//! Measured state of the servicer at an instant.

use crate::{DOF, Dof, JOINTS};
use guidance_laws::Pose;

/// Measured state of the servicer, without its propellant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measured {
    /// Pose of the base `B` in the world.
    pub base: Pose,
    /// Joint angles, rad.
    pub joints: [f64; JOINTS],
    /// Generalised velocity: `w_NB` and `v_NB` in base axes, joint rates; rad/s, m/s, rad/s.
    pub velocity: Dof,
}

impl Measured {
    /// A state from plain numbers (m; quaternion scalar first; rad; generalised velocity). `None` for a message of zeros, which means that
    /// nothing has been received yet: a quaternion of zeros is no attitude.
    pub fn from_raw(
        position: [f64; 3],
        attitude_wxyz: [f64; 4],
        joints: [f64; JOINTS],
        velocity: [f64; DOF],
    ) -> Option<Self> {
        let base = Pose::from_raw(position, attitude_wxyz)?;
        joints
            .iter()
            .chain(&velocity)
            .all(|value| value.is_finite())
            .then(|| Self {
                base,
                joints,
                velocity: velocity.into(),
            })
    }
}
