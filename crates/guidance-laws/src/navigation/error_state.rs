//! The error state of the navigation filter: order, dynamics, process noise and observation model.
//!
//! Errors are truth minus estimate; the attitude error is a rotation vector in target axes, `q = q̂ ⊗ exp(δθ)`.

use super::{Parameters, PositionAttitude};
use crate::so3;
use nalgebra::{Matrix3, Matrix6, SMatrix, SVector, UnitQuaternion, Vector3};

pub(super) const STATES: usize = 18;
pub(super) const POSITION: usize = 0;
pub(super) const VELOCITY: usize = 3;
pub(super) const ATTITUDE: usize = 6;
pub(super) const RATE: usize = 9;
pub(super) const POSITION_DRIFT: usize = 12;
pub(super) const ATTITUDE_DRIFT: usize = 15;

/// Longest propagation step of the covariance, s: the target's angular rate is assumed constant within a step.
pub(super) const LONGEST_STEP_S: f64 = 0.1;

pub(super) type ErrorState = SVector<f64, STATES>;
pub(super) type Covariance = SMatrix<f64, STATES, STATES>;

fn put(matrix: &mut Covariance, row: usize, column: usize, block: &Matrix3<f64>) {
    matrix.fixed_view_mut::<3, 3>(row, column).copy_from(block);
}

fn square(sigma: f64) -> Matrix3<f64> {
    Matrix3::identity() * (sigma * sigma)
}

/// Covariance after the first pose. Its errors are the camera's: they appear in the estimate and, with opposite sign, in the drift.
pub(super) fn initial(parameters: &Parameters) -> Covariance {
    let mut covariance = Covariance::zeros();
    let PositionAttitude { position, attitude } = parameters.drift_sigma;
    let white = parameters.white_sigma;
    put(
        &mut covariance,
        POSITION,
        POSITION,
        &(square(position) + square(white.position)),
    );
    put(
        &mut covariance,
        ATTITUDE,
        ATTITUDE,
        &(square(attitude) + square(white.attitude)),
    );
    for (state, drift, sigma) in [
        (POSITION, POSITION_DRIFT, position),
        (ATTITUDE, ATTITUDE_DRIFT, attitude),
    ] {
        put(&mut covariance, drift, drift, &square(sigma));
        put(&mut covariance, state, drift, &-square(sigma));
        put(&mut covariance, drift, state, &-square(sigma));
    }
    put(
        &mut covariance,
        VELOCITY,
        VELOCITY,
        &square(parameters.initial_rate_sigma.position),
    );
    put(
        &mut covariance,
        RATE,
        RATE,
        &square(parameters.initial_rate_sigma.attitude),
    );
    covariance
}

/// Transition matrix of the error over `step_s` with the target turning at `rate`, and the covariance of the process noise.
pub(super) fn transition(parameters: &Parameters, rate: &Vector3<f64>, step_s: f64) -> (Covariance, Covariance) {
    // attitude and rate: δθ' = −ω × δθ + δω, δω' = A δω; a Taylor series of the exponential, exact to 1e-10 for steps this short
    let mut a = Matrix6::<f64>::zeros();
    a.fixed_view_mut::<3, 3>(0, 0).copy_from(&-so3::hat(rate));
    a.fixed_view_mut::<3, 3>(0, 3).copy_from(&Matrix3::identity());
    a.fixed_view_mut::<3, 3>(3, 3)
        .copy_from(&parameters.target.angular_acceleration_derivative(rate));
    let a = a * step_s;
    let rotation = Matrix6::identity() + a * (Matrix6::identity() + a * (Matrix6::identity() + a / 3.0) / 2.0);

    let mut phi = Covariance::identity();
    put(&mut phi, POSITION, VELOCITY, &(Matrix3::identity() * step_s));
    phi.fixed_view_mut::<6, 6>(ATTITUDE, ATTITUDE).copy_from(&rotation);
    let keep = libm::exp(-step_s / parameters.drift_time_s);
    put(&mut phi, POSITION_DRIFT, POSITION_DRIFT, &(Matrix3::identity() * keep));
    put(&mut phi, ATTITUDE_DRIFT, ATTITUDE_DRIFT, &(Matrix3::identity() * keep));

    let mut noise = Covariance::zeros();
    for (value, rate, density) in [
        (POSITION, VELOCITY, parameters.acceleration_density.position),
        (ATTITUDE, RATE, parameters.acceleration_density.attitude),
    ] {
        let density = square(density);
        put(&mut noise, value, value, &(density * (step_s * step_s * step_s / 3.0)));
        put(&mut noise, value, rate, &(density * (step_s * step_s / 2.0)));
        put(&mut noise, rate, value, &(density * (step_s * step_s / 2.0)));
        put(&mut noise, rate, rate, &(density * step_s));
    }
    let fresh = 1.0 - keep * keep;
    put(
        &mut noise,
        POSITION_DRIFT,
        POSITION_DRIFT,
        &(square(parameters.drift_sigma.position) * fresh),
    );
    put(
        &mut noise,
        ATTITUDE_DRIFT,
        ATTITUDE_DRIFT,
        &(square(parameters.drift_sigma.attitude) * fresh),
    );
    (phi, noise)
}

/// Observation matrix: position and attitude residual. `drift` is the rotation of the vector `attitude_drift`.
pub(super) fn observation(drift: &UnitQuaternion<f64>, attitude_drift: &Vector3<f64>) -> SMatrix<f64, 6, STATES> {
    let mut h = SMatrix::<f64, 6, STATES>::zeros();
    h.fixed_view_mut::<3, 3>(0, POSITION).copy_from(&Matrix3::identity());
    h.fixed_view_mut::<3, 3>(0, POSITION_DRIFT)
        .copy_from(&Matrix3::identity());
    h.fixed_view_mut::<3, 3>(3, ATTITUDE)
        .copy_from(drift.inverse().to_rotation_matrix().matrix());
    h.fixed_view_mut::<3, 3>(3, ATTITUDE_DRIFT)
        .copy_from(&so3::right_jacobian(attitude_drift));
    h
}

/// Covariance of the camera's white errors.
pub(super) fn camera_noise(parameters: &Parameters) -> Matrix6<f64> {
    let PositionAttitude { position, attitude } = parameters.white_sigma;
    let (p, a) = (position * position, attitude * attitude);
    Matrix6::from_diagonal(&SVector::<f64, 6>::new(p, p, p, a, a, a))
}
