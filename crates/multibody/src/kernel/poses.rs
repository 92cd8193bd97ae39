//! Kinematics: pose of every body, and rates of its origin relative to its parent's.

use super::{Model, rotate};
use crate::num::{Constant, List, Mat3, Real, Size, V3};

/// Pose of a body's frame L, in base axes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BodyPose<T> {
    /// `R_BL`; its third column is the joint axis.
    pub r: Mat3<T>,
    /// Origin of L from the origin of the parent (m).
    pub d: V3<T>,
}

/// Position from the base and rates of a body's frame, in base axes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rates<T> {
    /// Origin of L from the origin of B (m).
    pub p: V3<T>,
    /// Inertial angular velocity of L (rad/s).
    pub omega: V3<T>,
    /// Inertial rate of [`BodyPose::d`] (m/s).
    pub d: V3<T>,
    /// Inertial rate of the joint axis (1/s).
    pub z: V3<T>,
    /// Velocity of L's origin relative to B's (m/s): the rate of `p`.
    pub p_rate: V3<T>,
}

impl<T: Real> BodyPose<T> {
    /// The joint axis.
    #[inline(always)]
    pub(crate) fn z(&self) -> V3<T> {
        self.r.c[2]
    }

    /// The base itself.
    #[inline(always)]
    pub(crate) fn base() -> Self {
        Self {
            r: Mat3::identity(),
            d: V3::zero(),
        }
    }
}

impl<T: Real> Rates<T> {
    /// The base itself, turning at `omega`.
    #[inline(always)]
    pub(crate) fn base(omega: V3<T>) -> Self {
        Self {
            p: V3::zero(),
            omega,
            d: V3::zero(),
            z: V3::zero(),
            p_rate: V3::zero(),
        }
    }
}

/// Poses at `q`, base first.
#[inline(always)]
pub(crate) fn body_poses<Z: Size, T: Real, K: Constant<T>>(model: Model<K>, q: &[T]) -> Z::List<BodyPose<T>> {
    let mut out = Z::List::<BodyPose<T>>::with_capacity(model.bodies.len() + 1);
    push_body_poses::<Z, T, K>(model, q, &mut out);
    out
}

/// [`body_poses`] into an empty list.
#[inline(always)]
pub(crate) fn push_body_poses<Z: Size, T: Real, K: Constant<T>>(
    model: Model<K>,
    q: &[T],
    out: &mut Z::List<BodyPose<T>>,
) {
    let trig = joint_sin_cos::<Z, T>(model.bodies.len(), q);
    out.push(BodyPose::base());
    for link in model.bodies {
        let parent = &out[link.parent];
        let (s, c) = trig[link.coordinate];
        let r = rotate(link, &parent.r, s, c);
        let mut d = parent.r.mul(V3::of(link.p));
        if link.prismatic {
            d = r.c[2].mul_add(q[link.coordinate], d);
        }
        out.push(BodyPose { r, d });
    }
}

/// Rates at `nu` of the bodies placed at `poses`, base first.
#[inline(always)]
pub(crate) fn rates<Z: Size, T: Real, K>(model: Model<K>, poses: &[BodyPose<T>], nu: &[T]) -> Z::List<Rates<T>> {
    let mut out = Z::List::<Rates<T>>::with_capacity(model.bodies.len() + 1);
    push_rates::<Z, T, K>(model, poses, nu, &mut out);
    out
}

/// [`rates`] into an empty list.
#[inline(always)]
pub(crate) fn push_rates<Z: Size, T: Real, K>(
    model: Model<K>,
    poses: &[BodyPose<T>],
    nu: &[T],
    out: &mut Z::List<Rates<T>>,
) {
    let offset = model.offset();
    out.push(Rates::base(model.base_part(nu).0));
    for (link, at) in model.bodies.iter().zip(&poses[1..]) {
        let parent = &out[link.parent];
        let along = at.z() * nu[offset + link.coordinate];
        let z = parent.omega.cross(at.z());
        let (d, omega) = if link.prismatic {
            (parent.omega.cross_add(at.d, along), parent.omega)
        } else {
            (parent.omega.cross(at.d), parent.omega + along)
        };
        let (p, p_rate) = (parent.p + at.d, parent.p_rate + d);
        out.push(Rates { p, omega, d, z, p_rate });
    }
}

/// Sine and cosine of every coordinate, four at a time. Prismatic positions are included: skipping them would cost more
/// than it saves.
#[inline(always)]
pub(crate) fn joint_sin_cos<Z: Size, T: Real>(joints: usize, q: &[T]) -> Z::List<(T, T)> {
    let mut out = Z::List::<(T, T)>::with_capacity(joints);
    T::sin_cos_each(&q[..joints], |s, c| out.push((s, c)));
    out
}
