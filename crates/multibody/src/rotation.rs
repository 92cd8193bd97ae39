//! Rotations: unit quaternions (Hamilton, scalar first) and the few constructions of rotation matrices we need.

use crate::num::{Number, sin_cos};
use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

/// `a × b`, as nalgebra's, and inlined: in lanes that the program is not compiled for, an operation that is not inlined is a call.
#[inline(always)]
pub fn cross<T: Number>(a: &Vector3<T>, b: &Vector3<T>) -> Vector3<T> {
    Vector3::new(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x)
}

/// A quaternion `w + x i + y j + z k` (Hamilton). As an attitude, `quat_AB` transforms components in B axes into
/// components in A axes, and a body rate ω (B axes) moves it by `½ q ⊗ [0, ω]`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Quaternion<T = f64> {
    /// Scalar part.
    pub w: T,
    /// Vector part.
    pub x: T,
    /// Vector part.
    pub y: T,
    /// Vector part.
    pub z: T,
}

impl Quaternion {
    /// No rotation.
    pub const IDENTITY: Self = Self {
        w: 1.0,
        x: 0.0,
        y: 0.0,
        z: 0.0,
    };

    /// From `[w, x, y, z]`.
    #[inline]
    pub fn from_wxyz([w, x, y, z]: [f64; 4]) -> Self {
        Self { w, x, y, z }
    }

    /// As `[w, x, y, z]`.
    #[inline]
    pub fn to_wxyz(self) -> [f64; 4] {
        [self.w, self.x, self.y, self.z]
    }

    /// exp(½ [0, θ]): the rotation by the vector `theta` (rad).
    pub fn exp(theta: &Vector3<f64>) -> Self {
        let angle2 = theta.norm_squared();
        // below 1e-4 rad the series is exact to the last bit and has no 0/0
        let (w, k) = if angle2 < 1.0e-8 {
            (1.0 - angle2 / 8.0, 0.5 - angle2 / 48.0)
        } else {
            let angle = angle2.sqrt();
            let (s, c) = sin_cos(0.5 * angle);
            (c, s / angle)
        };
        Self {
            w,
            x: k * theta.x,
            y: k * theta.y,
            z: k * theta.z,
        }
    }

    /// `R_AB`. The length is divided out.
    #[inline]
    pub fn matrix(self) -> Matrix3<f64> {
        Matrix3::from_columns(&[
            self.rotate(&Vector3::x()),
            self.rotate(&Vector3::y()),
            self.rotate(&Vector3::z()),
        ])
    }
}

impl<T: Number> Quaternion<T> {
    /// Product `self ⊗ o`.
    #[inline(always)]
    pub fn times(self, o: Self) -> Self {
        let (a, b) = (self, o);
        Self {
            w: a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z,
            x: a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
            y: a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x,
            z: a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w,
        }
    }

    /// The inverse of a unit quaternion.
    #[inline(always)]
    pub fn conjugate(self) -> Self {
        Self {
            w: self.w,
            x: -self.x,
            y: -self.y,
            z: -self.z,
        }
    }

    /// `½ self ⊗ [0, ω]`, the rate of an attitude turning at `omega` (rad/s, body axes).
    #[inline(always)]
    pub fn rate(self, omega: &Vector3<T>) -> Self {
        self.times(Self {
            w: T::of(0.0),
            x: T::of(0.5) * omega.x,
            y: T::of(0.5) * omega.y,
            z: T::of(0.5) * omega.z,
        })
    }

    /// `self + k · o`, component by component.
    #[inline(always)]
    pub fn plus(self, k: T, o: Self) -> Self {
        Self {
            w: k.mul_add(o.w, self.w),
            x: k.mul_add(o.x, self.x),
            y: k.mul_add(o.y, self.y),
            z: k.mul_add(o.z, self.z),
        }
    }

    /// Squared length.
    #[inline(always)]
    pub fn norm_squared(self) -> T {
        self.w * self.w + self.x * self.x + self.y * self.y + self.z * self.z
    }

    /// Scaled to unit length.
    #[inline(always)]
    pub fn normalized(self) -> Self {
        let k = T::of(1.0) / self.norm_squared().sqrt();
        Self {
            w: k * self.w,
            x: k * self.x,
            y: k * self.y,
            z: k * self.z,
        }
    }

    /// The vector `v` (B axes) in A axes. Exact to first order for a quaternion slightly off unit length, because the
    /// length is divided out.
    #[inline(always)]
    pub fn rotate(self, v: &Vector3<T>) -> Vector3<T> {
        let u = Vector3::new(self.x, self.y, self.z);
        let t = cross(&u, v) * (T::of(2.0) / self.norm_squared());
        v + t * self.w + cross(&u, &t)
    }

    /// The vector `v` (A axes) in B axes.
    #[inline(always)]
    pub fn rotate_back(self, v: &Vector3<T>) -> Vector3<T> {
        self.conjugate().rotate(v)
    }
}

/// R = Rz(yaw) Ry(pitch) Rx(roll), angles in rad.
pub fn roll_pitch_yaw(roll: f64, pitch: f64, yaw: f64) -> Matrix3<f64> {
    let ((sr, cr), (sp, cp), (sy, cy)) = (sin_cos(roll), sin_cos(pitch), sin_cos(yaw));
    Matrix3::new(
        cy * cp,
        cy * sp * sr - sy * cr,
        cy * sp * cr + sy * sr,
        sy * cp,
        sy * sp * sr + cy * cr,
        sy * sp * cr - cy * sr,
        -sp,
        cp * sr,
        cp * cr,
    )
}

/// Rotation by `angle` (rad) about the unit vector `axis` (Rodrigues).
pub fn axis_angle(axis: &Vector3<f64>, angle: f64) -> Matrix3<f64> {
    let (s, c) = sin_cos(angle);
    let k = axis.cross_matrix();
    Matrix3::identity() + k * s + k * k * (1.0 - c)
}
