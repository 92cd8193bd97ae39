//! Rotations: exponential, logarithm, and the Jacobian between the rate of a rotation vector and an angular velocity.
//!
//! A rotation vector is axis times angle, in rad; the rotation it stands for has the same vector in both of the frames it relates.

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

/// Below this angle, in rad, the closed forms lose digits and series are used. Their first neglected terms are below 1e-18.
const SMALL_ANGLE_RAD: f64 = 1e-3;

/// The matrix of the cross product: `hat(a) b = a × b`.
pub fn hat(a: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::new(0.0, -a.z, a.y, a.z, 0.0, -a.x, -a.y, a.x, 0.0)
}

/// The rotation with rotation vector `phi`, rad.
pub fn exp(phi: &Vector3<f64>) -> UnitQuaternion<f64> {
    let angle = phi.norm();
    let (scalar, per_angle) = if angle < SMALL_ANGLE_RAD {
        let square = angle * angle;
        // cos(a/2) and sin(a/2)/a
        (
            1.0 - square / 8.0 * (1.0 - square / 48.0),
            0.5 - square / 48.0 * (1.0 - square / 80.0),
        )
    } else {
        (libm::cos(0.5 * angle), libm::sin(0.5 * angle) / angle)
    };
    normalised(Quaternion::from_parts(scalar, phi * per_angle))
}

/// The rotation vector of `q`, rad, with an angle of at most π. Both signs of a quaternion give the same vector.
pub fn log(q: &UnitQuaternion<f64>) -> Vector3<f64> {
    let sign = if q.w < 0.0 { -1.0 } else { 1.0 };
    let vector = q.imag() * sign;
    let sine = vector.norm();
    let cosine = q.w * sign;
    let angle_per_sine = if sine < SMALL_ANGLE_RAD {
        // 2 asin(s)/s; the branch is near the identity because the scalar part is not negative here
        2.0 + sine * sine * (1.0 / 3.0 + 3.0 / 20.0 * sine * sine)
    } else {
        2.0 * libm::atan2(sine, cosine) / sine
    };
    vector * angle_per_sine
}

/// The rotation vector of `q` nearest to `previous`, rad: the logarithm continued beyond half a turn, where [`log`] jumps.
pub fn log_near(q: &UnitQuaternion<f64>, previous: &Vector3<f64>) -> Vector3<f64> {
    let principal = log(q);
    let angle = principal.norm();
    if angle < SMALL_ANGLE_RAD {
        return principal; // every other branch is a whole turn away, about an axis that is not defined here
    }
    let other = principal * (1.0 - std::f64::consts::TAU / angle);
    if (other - previous).norm_squared() < (principal - previous).norm_squared() {
        other
    } else {
        principal
    }
}

/// Right Jacobian: the angular velocity, in the axes of the rotated frame, is `right_jacobian(phi) · d(phi)/dt`.
pub fn right_jacobian(phi: &Vector3<f64>) -> Matrix3<f64> {
    let square = phi.norm_squared();
    let angle = square.sqrt();
    let (first, second) = if angle < SMALL_ANGLE_RAD {
        (
            0.5 - square / 24.0 * (1.0 - square / 30.0),
            1.0 / 6.0 - square / 120.0 * (1.0 - square / 42.0),
        )
    } else {
        let half_sine = libm::sin(0.5 * angle);
        // (1 − cos a)/a² written with the half angle, to avoid cancellation
        (
            2.0 * half_sine * half_sine / square,
            (angle - libm::sin(angle)) / (square * angle),
        )
    };
    let cross = hat(phi);
    Matrix3::identity() - cross * first + cross * cross * second
}

/// Inverse of [`right_jacobian`]. Exists for angles below a whole turn.
pub fn right_jacobian_inverse(phi: &Vector3<f64>) -> Matrix3<f64> {
    let square = phi.norm_squared();
    let angle = square.sqrt();
    let second = if angle < SMALL_ANGLE_RAD {
        1.0 / 12.0 + square / 720.0 * (1.0 + square / 42.0)
    } else {
        let half = 0.5 * angle;
        (1.0 - half * libm::cos(half) / libm::sin(half)) / square
    };
    let cross = hat(phi);
    Matrix3::identity() + cross * 0.5 + cross * cross * second
}

/// A unit quaternion from four numbers, scalar first. `None` for zeros (nothing received yet), or numbers that are not finite.
pub fn from_wxyz(wxyz: [f64; 4]) -> Option<UnitQuaternion<f64>> {
    let [w, x, y, z] = wxyz;
    let norm = (w * w + x * x + y * y + z * z).sqrt();
    if norm.is_finite() && norm > 0.5 {
        Some(normalised(Quaternion::new(w, x, y, z)))
    } else {
        None
    }
}

/// The four numbers of a quaternion, scalar first.
pub fn to_wxyz(q: &UnitQuaternion<f64>) -> [f64; 4] {
    [q.w, q.i, q.j, q.k]
}

/// The quaternion with unit length.
pub fn normalised(q: Quaternion<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::new_unchecked(q / q.norm_squared().sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f64::consts::PI;

    /// Directions and lengths, with many near zero and near `longest`.
    fn vector(longest: f64) -> impl Strategy<Value = Vector3<f64>> {
        let length = prop_oneof![0.0..longest, 0.0..2e-3, Just(0.0), (longest * 0.999)..longest];
        (-1.0..1.0, -1.0..1.0, -1.0..1.0, length).prop_map(|(x, y, z, length): (f64, f64, f64, f64)| {
            let direction = Vector3::new(x, y, z + 1e-3);
            direction * (length / direction.norm())
        })
    }

    proptest! {
        #[test]
        fn log_inverts_exp(phi in vector(PI - 1e-6)) {
            prop_assert!((log(&exp(&phi)) - phi).norm() < 1e-13);
        }

        #[test]
        fn exp_agrees_with_rodrigues(phi in vector(6.0)) {
            let angle = phi.norm().max(1e-300);
            let cross = hat(&(phi / angle));
            let rodrigues = Matrix3::identity() + cross * libm::sin(angle) + cross * cross * (1.0 - libm::cos(angle));
            let matrix = exp(&phi).to_rotation_matrix().into_inner();
            prop_assert!((matrix - rodrigues).abs().max() < 1e-14);
        }

        #[test]
        fn right_jacobian_is_the_derivative_of_exp(phi in vector(6.0), delta in vector(1.0)) {
            let step = 1e-5;
            let rate = log(&(exp(&(phi - delta * step)).inverse() * exp(&(phi + delta * step)))) / (2.0 * step);
            prop_assert!((right_jacobian(&phi) * delta - rate).norm() < 1e-9);
        }

        #[test]
        fn right_jacobian_inverse_inverts(phi in vector(6.0)) {
            let product = right_jacobian(&phi) * right_jacobian_inverse(&phi);
            prop_assert!((product - Matrix3::identity()).abs().max() < 1e-12);
        }

        #[test]
        fn log_near_follows_past_half_a_turn(axis in vector(1.0), turns in 0.0..0.99f64) {
            prop_assume!(axis.norm() > 0.1);
            let phi = axis.normalize() * (turns * 2.0 * PI);
            let previous = phi * 0.98;
            prop_assert!((log_near(&exp(&phi), &previous) - phi).norm() < 1e-9);
        }

        #[test]
        fn wxyz_round_trip(phi in vector(PI)) {
            let q = exp(&phi);
            let back = from_wxyz(to_wxyz(&q)).unwrap();
            prop_assert!((back.coords - q.coords).norm() < 1e-15);
        }
    }

    #[test]
    fn zero_quaternion_is_no_rotation() {
        assert!(from_wxyz([0.0; 4]).is_none());
        assert!(from_wxyz([f64::NAN, 0.0, 0.0, 1.0]).is_none());
        assert!(from_wxyz([f64::INFINITY, 0.0, 0.0, 1.0]).is_none());
    }
}
