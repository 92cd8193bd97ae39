//! Set-points: poses and twists that a guidance law commands to a controller.

use crate::so3;
use nalgebra::{UnitQuaternion, Vector3};

/// Position and attitude of a frame `F` in the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// `p_NF`, world axes, m.
    pub position: Vector3<f64>,
    /// `q_NF`: turns `F` axes into world axes.
    pub attitude: UnitQuaternion<f64>,
}

impl Pose {
    /// A pose from plain numbers (m; quaternion scalar first). `None` if the quaternion is not valid or a number is not finite;
    /// a message of zeros, which means that nothing has been received yet, has such a quaternion.
    pub fn from_raw(position: [f64; 3], attitude_wxyz: [f64; 4]) -> Option<Self> {
        let attitude = so3::from_wxyz(attitude_wxyz)?;
        position.iter().all(|value| value.is_finite()).then(|| Self {
            position: position.into(),
            attitude,
        })
    }

    /// The pose in world axes of a frame that has pose `self_F` in this frame's axes.
    pub fn compose(&self, inner: &Pose) -> Pose {
        Pose {
            position: self.position + self.attitude * inner.position,
            attitude: self.attitude * inner.attitude,
        }
    }
}

/// Pose and twist to follow.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SetPoint {
    /// Desired pose `p_Nd`, `q_Nd`.
    pub pose: Pose,
    /// Desired velocity `v_Nd`, world axes, m/s.
    pub velocity: Vector3<f64>,
    /// Desired angular velocity `w_Nd_d`, axes of the desired frame, rad/s.
    pub rate: Vector3<f64>,
}

impl SetPoint {
    /// A set-point at rest.
    pub fn at_rest(pose: Pose) -> Self {
        Self {
            pose,
            velocity: Vector3::zeros(),
            rate: Vector3::zeros(),
        }
    }

    /// A set-point from plain numbers (m; quaternion scalar first; m/s in world axes; rad/s in desired axes). `None` for a message of
    /// zeros, which means that nothing has been received yet: a quaternion of zeros is no attitude.
    pub fn from_raw(position: [f64; 3], attitude_wxyz: [f64; 4], velocity: [f64; 3], rate: [f64; 3]) -> Option<Self> {
        let pose = Pose::from_raw(position, attitude_wxyz)?;
        velocity
            .iter()
            .chain(&rate)
            .all(|value| value.is_finite())
            .then(|| Self {
                pose,
                velocity: velocity.into(),
                rate: rate.into(),
            })
    }

    /// The set-point extrapolated to `age_s` seconds after it was computed, with its velocities constant.
    pub fn propagated(&self, age_s: f64) -> Self {
        Self {
            pose: Pose {
                position: self.pose.position + self.velocity * age_s,
                attitude: self.pose.attitude * so3::exp(&(self.rate * age_s)),
            },
            ..*self
        }
    }
}

/// Set-point handling in a controller between two samples of the guidance.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum InterSample {
    /// The last set-point, extrapolated with its own velocities. A guidance slower than the controller needs this: the steps of a
    /// held pose disturb the inner loop.
    #[default]
    Propagate,
    /// Zero-order hold of the last pose.
    Hold,
}

impl InterSample {
    /// The set-point to follow `age_s` seconds after `set_point` was computed.
    pub fn apply(self, set_point: &SetPoint, age_s: f64) -> SetPoint {
        match self {
            Self::Propagate => set_point.propagated(age_s),
            Self::Hold => *set_point,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moving() -> SetPoint {
        SetPoint::from_raw(
            [1.0, -2.0, 0.5],
            [0.8, 0.0, 0.6, 0.0],
            [0.01, 0.02, -0.03],
            [0.1, -0.05, 0.2],
        )
        .unwrap()
    }

    #[test]
    fn message_of_zeros_or_nan_is_no_set_point() {
        assert!(SetPoint::from_raw([0.0; 3], [0.0; 4], [0.0; 3], [0.0; 3]).is_none());
        assert!(SetPoint::from_raw([0.0; 3], [1.0, 0.0, 0.0, 0.0], [f64::NAN; 3], [0.0; 3]).is_none());
        assert!(SetPoint::from_raw([f64::NAN; 3], [1.0, 0.0, 0.0, 0.0], [0.0; 3], [0.0; 3]).is_none());
    }

    #[test]
    fn propagation_follows_the_velocities_of_the_set_point() {
        let step_s = 1e-6;
        let (now, later) = (moving(), moving().propagated(step_s));
        let velocity = (later.pose.position - now.pose.position) / step_s;
        let rate = so3::log(&(now.pose.attitude.inverse() * later.pose.attitude)) / step_s;
        assert!((velocity - now.velocity).norm() < 1e-9);
        assert!((rate - now.rate).norm() < 1e-9);
    }

    #[test]
    fn propagation_in_two_steps_equals_one_step() {
        let once = moving().propagated(0.3);
        let twice = moving().propagated(0.1).propagated(0.2);
        assert!((once.pose.position - twice.pose.position).norm() < 1e-15);
        assert!(once.pose.attitude.angle_to(&twice.pose.attitude) < 1e-14);
        assert_eq!(InterSample::Hold.apply(&moving(), 0.3), moving());
        assert_eq!(InterSample::Propagate.apply(&moving(), 0.3), once);
    }
}
