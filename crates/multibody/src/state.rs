//! State of a tree: configuration and velocity.

use crate::description::Placement;
use crate::num::Number;
use crate::rotation::Quaternion;
use nalgebra::{SVector, Vector3};
use serde::{Deserialize, Serialize};

/// State of a [`Tree<N, V>`](crate::Tree).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(bound(
    serialize = "T: nalgebra::Scalar + Serialize",
    deserialize = "T: nalgebra::Scalar + Deserialize<'de>"
))]
pub struct State<const N: usize, const V: usize, T = f64> {
    /// Base origin in the world, `p_NB` (N axes, m).
    pub p_nb: Vector3<T>,
    /// Attitude of the base, `quat_NB`.
    pub quat_nb: Quaternion<T>,
    /// Joint positions (rad or m).
    pub q: SVector<T, N>,
    /// Generalised velocity `[ω_NB; v_NB; joint rates]` (B axes); joint rates alone on a fixed base.
    pub nu: SVector<T, V>,
}

impl<const N: usize, const V: usize> State<N, V> {
    /// At rest at the origin, axes aligned with the world, joints at zero.
    pub fn rest() -> Self {
        Self {
            p_nb: Vector3::zeros(),
            quat_nb: Quaternion::IDENTITY,
            q: SVector::zeros(),
            nu: SVector::zeros(),
        }
    }

    /// Pose of the base: (`p_NB`, `R_NB`).
    pub fn base(&self) -> Placement {
        Placement {
            p: self.p_nb,
            r: self.quat_nb.matrix(),
        }
    }
}

impl<const N: usize, const V: usize, T: Number> State<N, V, T> {
    /// ω_NB in B axes (rad/s); zero on a fixed base.
    pub fn omega(&self) -> Vector3<T> {
        if V == N {
            Vector3::zeros()
        } else {
            Vector3::new(self.nu[0], self.nu[1], self.nu[2])
        }
    }

    /// v_NB in B axes (m/s); zero on a fixed base.
    pub fn velocity(&self) -> Vector3<T> {
        if V == N {
            Vector3::zeros()
        } else {
            Vector3::new(self.nu[3], self.nu[4], self.nu[5])
        }
    }

    /// The state with a quaternion of unit length.
    #[inline(always)]
    pub fn projected(mut self) -> Self {
        self.quat_nb = self.quat_nb.normalized();
        self
    }
}
