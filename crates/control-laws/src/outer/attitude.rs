//! Attitude error of the end effector: hybrid quaternion law (Eq 16 and 17), rotation-matrix law (Eq 13), plain quaternion law.

use crate::ParameterError;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

/// Definition of the attitude error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum AttitudeLaw {
    /// Eq 16: the vector part of the error quaternion times a sign `h` that jumps with hysteresis. Robustly globally convergent: from every
    /// attitude, without unwinding or chattering.
    Hybrid {
        /// Hysteresis δ, above 0 and below 1. With 0.5 the sign jumps when the error along the current direction exceeds 240 degrees.
        hysteresis: f64,
    },
    /// Eq 13: the skew part of the error's rotation matrix, `½ (R_e − R_eᵀ)`. Continuous, twice the slope of the quaternion at small
    /// errors, and zero also at errors of half a turn, from where it does not converge.
    RotationMatrix,
    /// The vector part of the error quaternion with `h = 1` always: beyond half a turn it takes the longer rotation (unwinding). For
    /// comparison.
    Quaternion,
}

impl Default for AttitudeLaw {
    fn default() -> Self {
        Self::Hybrid { hysteresis: 0.5 }
    }
}

impl AttitudeLaw {
    pub(crate) fn validate(&self) -> Result<(), ParameterError> {
        match *self {
            Self::Hybrid { hysteresis } if !(hysteresis > 0.0 && hysteresis < 1.0) => Err(ParameterError::new(
                "outer.attitude.hysteresis",
                hysteresis,
                "must be above 0 (or noise makes the sign chatter) and below 1 (or it never jumps)",
            )),
            _ => Ok(()),
        }
    }
}

/// The attitude error at an instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AttitudeError {
    /// Error quaternion `η_e`, scalar first; its sign is continuous with the previous instant.
    pub quaternion: [f64; 4],
    /// The sign `h`, 1 or −1.
    pub h: f64,
    /// Whether `h` jumped at this instant.
    pub jumped: bool,
    /// The feedback vector, end-effector axes, dimensionless: half the rotation vector at small errors; with Eq 13 all of it.
    pub vector: Vector3<f64>,
}

impl AttitudeError {
    /// The smallest angle between the two attitudes, rad.
    pub fn angle_rad(&self) -> f64 {
        let [w, x, y, z] = self.quaternion;
        2.0 * libm::atan2((x * x + y * y + z * z).sqrt(), w.abs())
    }
}

/// Complete state of the attitude law, as plain numbers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct AttitudeState {
    /// Whether an error has been processed; before that the other fields are meaningless.
    pub started: bool,
    /// The sign `h`.
    pub h: f64,
    /// Error quaternion at the last instant, scalar first.
    pub quaternion: [f64; 4],
}

impl AttitudeState {
    /// Initial state.
    pub const START: Self = Self {
        started: false,
        h: 1.0,
        quaternion: [1.0, 0.0, 0.0, 0.0],
    };

    /// Result when there is no set-point at this instant.
    pub(crate) fn unchanged(&self) -> AttitudeError {
        AttitudeError {
            quaternion: [1.0, 0.0, 0.0, 0.0],
            h: self.h,
            jumped: false,
            vector: Vector3::zeros(),
        }
    }

    /// Updates the state with the error `q_e` between desired frame and end effector.
    pub fn update(&mut self, law: &AttitudeLaw, q_e: &UnitQuaternion<f64>) -> AttitudeError {
        let mut quaternion = [q_e.w, q_e.i, q_e.j, q_e.k];
        // both signs represent the same attitude; h is meaningful only if the sign is continuous
        let along: f64 = quaternion
            .iter()
            .zip(&self.quaternion)
            .map(|(new, old)| new * old)
            .sum();
        if self.started && along < 0.0 {
            quaternion = quaternion.map(|value| -value);
        }
        let scalar = quaternion[0];
        let mut jumped = false;
        match *law {
            AttitudeLaw::Hybrid { .. } if !self.started => self.h = if scalar < 0.0 { -1.0 } else { 1.0 },
            AttitudeLaw::Hybrid { hysteresis } => {
                jumped = self.h * scalar < -hysteresis; // Eq 16
                if jumped {
                    self.h = -self.h;
                }
            }
            AttitudeLaw::RotationMatrix | AttitudeLaw::Quaternion => self.h = 1.0,
        }
        self.started = true;
        self.quaternion = quaternion;
        let vector = match law {
            AttitudeLaw::Hybrid { .. } | AttitudeLaw::Quaternion => {
                Vector3::new(quaternion[1], quaternion[2], quaternion[3]) * self.h // Eq 17
            }
            AttitudeLaw::RotationMatrix => skew_part(q_e.to_rotation_matrix().matrix()), // Eq 13
        };
        AttitudeError {
            quaternion,
            h: self.h,
            jumped,
            vector,
        }
    }
}

/// The vector of `½ (R − Rᵀ)`: axis times sine of the angle.
fn skew_part(R: &Matrix3<f64>) -> Vector3<f64> {
    Vector3::new(R[(2, 1)] - R[(1, 2)], R[(0, 2)] - R[(2, 0)], R[(1, 0)] - R[(0, 1)]) * 0.5
}

#[cfg(test)]
mod tests {
    use super::*;
    use guidance_laws::so3;
    use std::f64::consts::PI;

    const HYBRID: AttitudeLaw = AttitudeLaw::Hybrid { hysteresis: 0.5 };

    fn about_z(degrees: f64) -> UnitQuaternion<f64> {
        so3::exp(&Vector3::new(0.0, 0.0, degrees * PI / 180.0))
    }

    #[test]
    fn the_sign_starts_on_the_short_way() {
        for (degrees, h) in [(0.0, 1.0), (179.0, 1.0), (181.0, -1.0), (-181.0, -1.0), (350.0, -1.0)] {
            let mut state = AttitudeState::START;
            let error = state.update(&HYBRID, &about_z(degrees));
            assert_eq!(error.h, h, "{degrees}");
            // fed back with a minus sign: the error shrinks by the shorter rotation
            let short = if degrees.abs() > 180.0 {
                degrees - 360.0 * degrees.signum()
            } else {
                degrees
            };
            assert!(error.vector.z * short >= 0.0, "{degrees}");
            assert!((error.angle_rad() - short.abs() * PI / 180.0).abs() < 1e-12);
        }
    }

    #[test]
    fn sign_jumps_at_240_degrees_with_hysteresis() {
        let mut state = AttitudeState::START;
        let mut jumps = Vec::new();
        let mut sweep = |from: i32, to: i32| {
            let step = (to - from).signum();
            let mut degrees = from;
            while degrees != to {
                degrees += step;
                // the raw quaternion may have either sign: the law must be insensitive to it
                let raw = about_z(f64::from(degrees) + 0.5);
                let raw = if degrees % 3 == 0 {
                    UnitQuaternion::new_unchecked(-raw.into_inner())
                } else {
                    raw
                };
                if state.update(&HYBRID, &raw).jumped {
                    jumps.push(degrees);
                }
            }
        };
        sweep(0, 300);
        sweep(300, 0);
        // increasing: at 240.5; decreasing: the error along the new direction is 360 − angle, above 240 for angles below 120
        assert_eq!(jumps, [240, 119]);
    }

    #[test]
    fn sign_does_not_chatter_under_noise_at_half_a_turn() {
        let mut state = AttitudeState::START;
        let mut jumps = 0;
        for tick in 0..10_000 {
            let noise = 20.0 * libm::sin(1.7 * f64::from(tick) * f64::from(tick));
            jumps += u32::from(state.update(&HYBRID, &about_z(180.0 + noise)).jumped);
        }
        assert_eq!(jumps, 0);
    }

    /// Rotates a frame as commanded by the law until it comes to rest: the angle travelled and the remaining angle, rad.
    fn closed_loop(law: &AttitudeLaw, mut state: AttitudeState, mut q: UnitQuaternion<f64>) -> (f64, f64) {
        let mut travelled = 0.0;
        for _ in 0..4000 {
            let rate = -state.update(law, &q).vector;
            travelled += rate.norm() * 0.01;
            q *= so3::exp(&(rate * 0.01));
        }
        (travelled, q.angle_to(&UnitQuaternion::identity()))
    }

    #[test]
    fn hybrid_law_does_not_unwind_but_quaternion_law_does() {
        let far = about_z(300.0);
        // the error grew to 300 degrees along the current direction
        let grown = AttitudeState {
            started: true,
            h: 1.0,
            quaternion: so3::to_wxyz(&far),
        };
        let (travelled, left) = closed_loop(&HYBRID, grown, far);
        assert!((travelled - PI / 3.0).abs() < 0.01 && left < 1e-6, "{travelled} {left}");
        let (travelled, left) = closed_loop(&AttitudeLaw::Quaternion, grown, far);
        assert!(
            (travelled - 5.0 * PI / 3.0).abs() < 0.01 && left < 1e-6,
            "{travelled} {left}"
        );
    }

    #[test]
    fn matrix_law_is_trapped_at_half_a_turn_but_hybrid_is_not() {
        let half = UnitQuaternion::new_unchecked(nalgebra::Quaternion::new(0.0, 0.0, 1.0, 0.0));
        let (_, left) = closed_loop(&AttitudeLaw::RotationMatrix, AttitudeState::START, half);
        assert!(left > PI - 1e-6, "{left}");
        let (_, left) = closed_loop(&HYBRID, AttitudeState::START, half);
        assert!(left < 1e-6, "{left}");
    }

    #[test]
    fn at_small_errors_the_matrix_law_is_twice_the_quaternion() {
        let q = so3::exp(&Vector3::new(1e-4, -2e-4, 3e-4));
        let [quaternion, matrix] =
            [HYBRID, AttitudeLaw::RotationMatrix].map(|law| AttitudeState::START.clone().update(&law, &q).vector);
        assert!((quaternion * 2.0 - matrix).norm() < 1e-10);
    }

    #[test]
    fn hysteresis_out_of_range_is_rejected() {
        for hysteresis in [0.0, 1.0, -0.5, f64::NAN] {
            let error = AttitudeLaw::Hybrid { hysteresis }.validate().unwrap_err();
            assert_eq!(error.field, "outer.attitude.hysteresis");
        }
    }
}
