//! Motion of the target, a torque-free rigid body, and of a frame fixed in it.

use crate::{ParameterError, Pose, SetPoint, so3};
use nalgebra::{Matrix3, Quaternion, Vector3};

/// Motion of the target body frame `T`, origin at the target's centre of mass.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TargetState {
    /// Pose of `T` in the world.
    pub pose: Pose,
    /// Velocity `v_NT`, world axes, m/s.
    pub velocity: Vector3<f64>,
    /// Angular velocity `w_NT_T`, target axes, rad/s.
    pub rate: Vector3<f64>,
}

impl TargetState {
    /// A state from plain numbers (m; quaternion scalar first; m/s in world axes; rad/s in target axes). `None` for a message of
    /// zeros, which means that nothing has been received yet.
    pub fn from_raw(position: [f64; 3], attitude_wxyz: [f64; 4], velocity: [f64; 3], rate: [f64; 3]) -> Option<Self> {
        let SetPoint { pose, velocity, rate } = SetPoint::from_raw(position, attitude_wxyz, velocity, rate)?;
        Some(Self { pose, velocity, rate })
    }

    /// Motion of the frame `G` that has the constant pose `grasp` in `T`: velocity in world axes, rate in `G` axes.
    pub fn frame(&self, grasp: &Pose) -> SetPoint {
        SetPoint {
            pose: self.pose.compose(grasp),
            velocity: self.velocity + self.pose.attitude * self.rate.cross(&grasp.position),
            rate: grasp.attitude.inverse() * self.rate,
        }
    }
}

/// A torque-free rigid body with a known inertia: predicts the present state of a target from an earlier one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TargetModel {
    inertia: Matrix3<f64>,
    inverse: Matrix3<f64>,
    longest_step_s: f64,
}

impl TargetModel {
    /// A body with `inertia` about its centre of mass, target axes, kg m², integrated in steps of at most `longest_step_s`.
    ///
    /// # Errors
    ///
    /// If the inertia is not symmetric and positive definite, or the step not above zero. Only the ratios of the moments matter.
    pub fn new(inertia: Matrix3<f64>, longest_step_s: f64) -> Result<Self, ParameterError> {
        ParameterError::positive("longest_step_s", longest_step_s)?;
        let refused = || {
            ParameterError::new(
                "inertia",
                inertia,
                "must be a symmetric positive definite matrix, kg m², about the centre of mass",
            )
        };
        if (inertia - inertia.transpose()).abs().max() > 1e-9 * inertia.abs().max() {
            return Err(refused());
        }
        let inverse = inertia.cholesky().ok_or_else(refused)?.inverse();
        Ok(Self {
            inertia,
            inverse,
            longest_step_s,
        })
    }

    /// The inertia about the centre of mass, target axes, kg m².
    pub fn inertia(&self) -> &Matrix3<f64> {
        &self.inertia
    }

    /// Angular acceleration at angular velocity `rate`, both in target axes: Euler's equation without torque.
    pub fn angular_acceleration(&self, rate: &Vector3<f64>) -> Vector3<f64> {
        -self.inverse * rate.cross(&(self.inertia * rate))
    }

    /// Derivative of [`Self::angular_acceleration`] with respect to the rate, 1/s.
    pub fn angular_acceleration_derivative(&self, rate: &Vector3<f64>) -> Matrix3<f64> {
        self.inverse * (so3::hat(&(self.inertia * rate)) - so3::hat(rate) * self.inertia)
    }

    /// The state `duration_s` seconds later (negative: earlier), by classical Runge-Kutta in equal steps.
    pub fn predicted(&self, from: &TargetState, duration_s: f64) -> TargetState {
        let steps = (duration_s.abs() / self.longest_step_s).ceil().max(1.0);
        let step_s = duration_s / steps;
        let mut state = *from;
        for _ in 0..steps as u64 {
            state = self.stepped(&state, step_s);
        }
        state.pose.position = from.pose.position + from.velocity * duration_s;
        state
    }

    fn stepped(&self, from: &TargetState, step_s: f64) -> TargetState {
        let attitude_rate = |q: Quaternion<f64>, rate: &Vector3<f64>| q * Quaternion::from_imag(*rate) * 0.5;
        let (q0, w0) = (from.pose.attitude.into_inner(), from.rate);
        let (dq1, dw1) = (attitude_rate(q0, &w0), self.angular_acceleration(&w0));
        let w1 = w0 + dw1 * (0.5 * step_s);
        let (dq2, dw2) = (
            attitude_rate(q0 + dq1 * (0.5 * step_s), &w1),
            self.angular_acceleration(&w1),
        );
        let w2 = w0 + dw2 * (0.5 * step_s);
        let (dq3, dw3) = (
            attitude_rate(q0 + dq2 * (0.5 * step_s), &w2),
            self.angular_acceleration(&w2),
        );
        let w3 = w0 + dw3 * step_s;
        let (dq4, dw4) = (attitude_rate(q0 + dq3 * step_s, &w3), self.angular_acceleration(&w3));
        let attitude = q0 + (dq1 + (dq2 + dq3) * 2.0 + dq4) * (step_s / 6.0);
        TargetState {
            pose: Pose {
                position: from.pose.position, // uniform motion needs no steps
                attitude: so3::normalised(attitude),
            },
            velocity: from.velocity,
            rate: w0 + (dw1 + (dw2 + dw3) * 2.0 + dw4) * (step_s / 6.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::UnitQuaternion;

    fn tumbling(rate: Vector3<f64>) -> TargetState {
        TargetState {
            pose: Pose {
                position: Vector3::new(0.1, 0.2, 0.3),
                attitude: so3::exp(&Vector3::new(0.3, -0.2, 0.9)),
            },
            velocity: Vector3::new(0.01, -0.02, 0.005),
            rate,
        }
    }

    #[test]
    fn an_axisymmetric_body_precesses_as_in_closed_form() {
        // with I = diag(a, a, c): the rate precesses about z at (c/a − 1) w_z, and the momentum is constant in the world
        let model = TargetModel::new(Matrix3::from_diagonal(&Vector3::new(33.6, 33.6, 25.0)), 0.01).unwrap();
        let start = tumbling(Vector3::new(0.05, 0.02, 0.11));
        let time_s = 60.0;
        let end = model.predicted(&start, time_s);
        let turn = (25.0 / 33.6 - 1.0) * start.rate.z * time_s;
        let expected = so3::exp(&Vector3::new(0.0, 0.0, turn)) * start.rate;
        assert!((end.rate - expected).norm() < 1e-11, "{} {}", end.rate, expected);
        // attitude in closed form: a turn about the momentum in the world, then about the axis of symmetry in the body
        let momentum = start.pose.attitude * (model.inertia() * start.rate);
        let about_momentum = so3::exp(&(momentum / 33.6 * time_s));
        let about_axis = so3::exp(&Vector3::new(0.0, 0.0, -turn));
        let attitude: UnitQuaternion<f64> = about_momentum * start.pose.attitude * about_axis;
        assert!(end.pose.attitude.angle_to(&attitude) < 1e-9);
        assert!((end.pose.position - start.pose.position - start.velocity * time_s).norm() < 1e-13);
    }

    #[test]
    fn a_triaxial_body_keeps_energy_and_momentum() {
        let inertia = Matrix3::new(40.0, 1.0, -2.0, 1.0, 30.0, 0.5, -2.0, 0.5, 20.0);
        let model = TargetModel::new(inertia, 0.01).unwrap();
        let start = tumbling(Vector3::new(0.01, 0.3, -0.02));
        let end = model.predicted(&start, 100.0);
        let energy = |state: &TargetState| state.rate.dot(&(inertia * state.rate));
        let momentum = |state: &TargetState| state.pose.attitude * (inertia * state.rate);
        assert!((energy(&start) - energy(&end)).abs() < 1e-9 * energy(&start));
        assert!((momentum(&start) - momentum(&end)).norm() < 1e-9 * momentum(&start).norm());
        let back = model.predicted(&end, -100.0);
        assert!((back.rate - start.rate).norm() < 1e-9);
    }

    #[test]
    fn euler_derivative_agrees_with_finite_differences() {
        let inertia = Matrix3::new(40.0, 1.0, -2.0, 1.0, 30.0, 0.5, -2.0, 0.5, 20.0);
        let model = TargetModel::new(inertia, 0.01).unwrap();
        let rate = Vector3::new(0.1, -0.3, 0.2);
        let derivative = model.angular_acceleration_derivative(&rate);
        for axis in 0..3 {
            let step = Vector3::ith(axis, 1e-6);
            let slope =
                (model.angular_acceleration(&(rate + step)) - model.angular_acceleration(&(rate - step))) / 2e-6;
            assert!((slope - derivative.column(axis)).norm() < 1e-9);
        }
    }

    #[test]
    fn grasp_frame_velocity_is_the_derivative_of_its_pose() {
        let model = TargetModel::new(Matrix3::from_diagonal(&Vector3::new(33.6, 33.6, 25.0)), 0.01).unwrap();
        let grasp = Pose {
            position: Vector3::new(0.1, 0.0, -0.65),
            attitude: so3::exp(&Vector3::new(0.4, 0.1, -0.2)),
        };
        let state = tumbling(Vector3::new(0.05, 0.02, 0.11));
        let step_s = 1e-4;
        let [before, now, after] = [-step_s, 0.0, step_s].map(|offset| model.predicted(&state, offset).frame(&grasp));
        let velocity = (after.pose.position - before.pose.position) / (2.0 * step_s);
        let rate = so3::log(&(before.pose.attitude.inverse() * after.pose.attitude)) / (2.0 * step_s);
        assert!((velocity - now.velocity).norm() < 1e-9);
        assert!((rate - now.rate).norm() < 1e-9);
    }

    #[test]
    fn an_impossible_inertia_is_refused_with_its_field() {
        let error = TargetModel::new(Matrix3::zeros(), 0.01).unwrap_err();
        assert_eq!(error.field, "inertia");
        assert!(error.to_string().contains("positive definite"));
        assert_eq!(
            TargetModel::new(Matrix3::identity(), 0.0).unwrap_err().field,
            "longest_step_s"
        );
    }
}
