//! Where every body is, and how its origin moves relative to its parent's.

use super::{BASE, Model, rotate};
use crate::num::{List, Mat3, Real, Size, V3};

/// Pose and rates of a body's frame L, everything in base axes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Placed<T> {
    /// `R_BL`; its third column is the joint axis.
    pub r: Mat3<T>,
    /// Origin of L from the origin of B (m).
    pub p: V3<T>,
    /// Origin of L from the origin of the parent (m).
    pub d: V3<T>,
    /// Inertial angular velocity of L (rad/s).
    pub omega: V3<T>,
    /// Inertial rate of `d` (m/s).
    pub d_rate: V3<T>,
    /// Inertial rate of the joint axis (1/s).
    pub z_rate: V3<T>,
    /// Velocity of L's origin relative to B's (m/s): the sum of the `d_rate` down to L.
    pub p_rate: V3<T>,
}

impl<T: Real> Placed<T> {
    /// The joint axis.
    #[inline(always)]
    pub(crate) fn z(&self) -> V3<T> {
        self.r.c[2]
    }

    /// The base itself, turning at `omega`.
    #[inline(always)]
    pub(crate) fn base(omega: V3<T>) -> Self {
        let o = V3::zero();
        Self {
            r: Mat3::identity(),
            p: o,
            d: o,
            omega,
            d_rate: o,
            z_rate: o,
            p_rate: o,
        }
    }
}

/// Poses at `q` and rates at `nu`.
#[inline(always)]
pub(crate) fn place<Z: Size, T: Real>(model: Model, q: &[T], nu: &[T]) -> Z::List<Placed<T>> {
    let (omega, _) = model.base_part(nu);
    let base = Placed::base(omega);
    let offset = model.offset();
    let trig = sines::<Z, T>(model, q);
    let mut out = Z::List::<Placed<T>>::with_capacity(model.bodies.len());
    for link in model.bodies {
        let on_base = link.parent == BASE;
        let parent = if on_base { base } else { out[link.parent] };
        let (s, c) = trig[link.coordinate];
        let rate = nu[offset + link.coordinate];
        let r = rotate(link, &parent.r, on_base, s, c);
        let z = r.c[2];
        let z_rate = parent.omega.cross(z);
        let d = if on_base {
            V3::of(link.p)
        } else {
            parent.r.mul(V3::of(link.p))
        };
        let (d, d_rate, omega) = if link.prismatic {
            let d = z.mul_add(q[link.coordinate], d);
            (d, parent.omega.cross_add(d, z * rate), parent.omega)
        } else {
            (d, parent.omega.cross(d), z.mul_add(rate, parent.omega))
        };
        out.push(Placed {
            r,
            p: parent.p + d,
            d,
            omega,
            d_rate,
            z_rate,
            p_rate: parent.p_rate + d_rate,
        });
    }
    out
}

/// Sine and cosine of every coordinate, four at a time. A prismatic position goes through too: skipping it would cost
/// more than it saves.
#[inline(always)]
pub(crate) fn sines<Z: Size, T: Real>(model: Model, q: &[T]) -> Z::List<(T, T)> {
    let mut out = Z::List::<(T, T)>::with_capacity(model.bodies.len());
    T::sin_cos_each(&q[..model.bodies.len()], |s, c| out.push((s, c)));
    out
}
