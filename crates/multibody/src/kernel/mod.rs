//! The recursions, generic over the scalar (`f64`, lanes, dual numbers) and over the kind of scratch space (stack or heap).
//!
//! # How they differ from the textbook
//!
//! All vectors are in **base axes**, every body's wrench and acceleration is taken about that body's own joint origin,
//! and accelerations are the *classical* accelerations of material points, not spatial ones. Two things follow.
//!
//! * No 6×6 rotation of an articulated inertia is needed in the inward pass, only a translation of its 21 numbers;
//!   only each body's constant rigid inertia is rotated, once.
//! * By Galilean invariance no linear velocity appears anywhere: a body's bias depends on ω alone,
//!   `n = J α + h×a − ω×(Σ ω)`, `f = m a + α×h + ω×(ω×h)`, with h = m c, J the inertia and Σ = ½ tr(J) 1 − J the
//!   second moment of mass, both about the joint origin. A base that moves at 7.5 km/s, 7,000 km from the origin of the
//!   world, loses no digit: neither number enters.
//!
//! The base row converts the classical acceleration to the rate of the body-axes velocity, `v̇ = a − ω×v`.

pub(crate) mod aba;
pub(crate) mod inertia;
pub(crate) mod jacobian;
pub(crate) mod momentum;
pub(crate) mod newton_euler;
pub(crate) mod poses;

use crate::description::{Inertia, merge_steiner};
use crate::num::{Constant, Mat3, Real, Sym3, V3};

/// Rigid inertia of a body about its own origin, body axes. `K` is a double, or one of each tree in lanes.
#[derive(Clone, Debug)]
pub(crate) struct Rigid<K = f64> {
    pub mass: K,
    /// First moment m c (kg m).
    pub h: [K; 3],
    /// Inertia about the origin: xx, xy, xz, yy, yz, zz (kg m²).
    pub j: [K; 6],
    /// Second moment Σ = ½ tr(J) 1 − J = ∫ x xᵀ dm (kg m²).
    pub sigma: [K; 6],
}

impl Rigid {
    pub(crate) fn new(i: &Inertia) -> Self {
        let j = i.about_com + merge_steiner(i.mass, &i.com);
        let sigma = nalgebra::Matrix3::identity() * (0.5 * j.trace()) - j;
        let upper = |m: &nalgebra::Matrix3<f64>| [m.m11, m.m12, m.m13, m.m22, m.m23, m.m33];
        Self {
            mass: i.mass,
            h: (i.com * i.mass).into(),
            j: upper(&j),
            sigma: upper(&sigma),
        }
    }

    /// Welds `other`, given in the same axes about the same origin, to this body.
    pub(crate) fn weld(&mut self, other: &Rigid) {
        let add = |a: &mut [f64], b: &[f64]| a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
        self.mass += other.mass;
        add(&mut self.h, &other.h);
        add(&mut self.j, &other.j);
        add(&mut self.sigma, &other.sigma);
    }
}

/// The constants of a moving body. Its frame has the joint axis as +z through its origin.
#[derive(Clone, Debug)]
pub(crate) struct Link<K = f64> {
    /// Index of the parent in lists that start with the base: [`BASE`] or the parent's index + 1.
    pub parent: usize,
    /// Index of the joint coordinate.
    pub coordinate: usize,
    pub prismatic: bool,
    /// Rotation to the parent's frame at position zero, by columns.
    pub e: [[K; 3]; 3],
    /// Origin in the parent's frame at position zero (m).
    pub p: [K; 3],
    pub rigid: Rigid<K>,
    pub motor_inertia: K,
    pub damping: K,
    pub stiffness: K,
    pub rest: K,
}

/// The base's index in every list of bodies; body i is at i + 1.
pub(crate) const BASE: usize = 0;

/// Input of a recursion. With static sizes `bodies` has a length known to the compiler and `floating` is a constant,
/// once the recursion is inlined into its caller.
pub(crate) struct Model<'a, K = f64> {
    pub base: &'a Rigid<K>,
    pub bodies: &'a [Link<K>],
    pub floating: bool,
}

impl<K> Copy for Model<'_, K> {}

impl<K> Clone for Model<'_, K> {
    #[inline(always)]
    fn clone(&self) -> Self {
        *self
    }
}

impl<K> Model<'_, K> {
    /// Number of velocity coordinates in front of the joints: 6 or 0.
    #[inline(always)]
    pub(crate) fn offset(&self) -> usize {
        if self.floating { 6 } else { 0 }
    }

    /// Base rates (ω, v) from a generalised velocity or acceleration.
    #[inline(always)]
    pub(crate) fn base_part<T: Real>(&self, x: &[T]) -> (V3<T>, V3<T>) {
        if self.floating {
            (V3::read(x, 0), V3::read(x, 3))
        } else {
            (V3::zero(), V3::zero())
        }
    }
}

/// `R_BL` of a body from its parent's and the sine and cosine of its joint angle.
#[inline(always)]
pub(crate) fn rotate<T: Real, K: Constant<T>>(link: &Link<K>, parent: &Mat3<T>, s: T, c: T) -> Mat3<T> {
    let t = parent.mul_mat(&Mat3::of(link.e));
    if link.prismatic {
        return t;
    }
    let [x, y, z] = t.c;
    Mat3 {
        c: [x.mul_add(c, y * s), y.mul_add(c, -(x * s)), z],
    }
}

/// A symmetric matrix times a vector, `(tr(Σ) 1 − Σ) v`: the inertia from the second moment.
#[inline(always)]
pub(crate) fn inertia_times<T: Real>(sigma: &Sym3<T>, v: V3<T>) -> V3<T> {
    sigma.mul_add(-v, v * sigma.trace())
}
