//! The momentum of a whole tree, and the kernels' vectors as those of nalgebra.

use crate::kernel::momentum;
use crate::num::{Number, V3};
use nalgebra::{Matrix3, Vector3};

/// Momentum of the whole tree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Momentum<T = f64> {
    /// Total mass (kg).
    pub mass: T,
    /// Centre of mass C from B's origin, B axes (m).
    pub p_bc: Vector3<T>,
    /// Linear momentum, B axes (kg m/s).
    pub linear_b: Vector3<T>,
    /// Angular momentum about the centre of mass, B axes (kg m²/s).
    pub angular_b: Vector3<T>,
}

impl<T: Number> Momentum<T> {
    /// Converts the sums over a tree with base velocity `v`.
    pub(crate) fn of(s: &momentum::Sums<T>, v: V3<T>) -> Self {
        let p_bc = s.h * (T::of(1.0) / s.mass);
        Self {
            mass: s.mass,
            p_bc: vector(p_bc),
            linear_b: vector(v.mul_add(s.mass, s.p)),
            // v cancels: a common velocity has no angular momentum about C
            angular_b: vector(s.l - p_bc.cross(s.p)),
        }
    }
}

pub(crate) fn vector<T: Number>(v: V3<T>) -> Vector3<T> {
    Vector3::new(v.x, v.y, v.z)
}

pub(crate) fn matrix(m: &crate::num::Mat3<f64>) -> Matrix3<f64> {
    Matrix3::from_columns(&m.c.map(vector))
}
