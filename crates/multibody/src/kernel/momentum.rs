//! Momentum, centre of mass and kinetic energy, by summing over the bodies.

use super::poses::{BodyPose, Rates};
use super::{Model, Rigid};
use crate::num::{Constant, Real, Sym3, V3};

/// Sums over all bodies, base axes, about the base origin.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sums<T> {
    pub mass: T,
    /// First moment (kg m).
    pub h: V3<T>,
    /// Momentum relative to the velocity of the base origin (kg m/s).
    pub p: V3<T>,
    /// Angular momentum about the base origin of the motion relative to the velocity of that origin (kg m²/s).
    pub l: V3<T>,
    /// Kinetic energy of that relative motion, motors included (J).
    pub energy: T,
}

/// The sums at `poses`, joint rates from `nu`. The velocity of the base origin is excluded, to avoid cancellation when
/// it is large.
#[inline(always)]
pub(crate) fn sums<T: Real, K: Constant<T>>(
    model: Model<K>,
    poses: &[BodyPose<T>],
    rates: &[Rates<T>],
    nu: &[T],
) -> Sums<T> {
    let half = T::of(0.5);
    let mut out = Sums::nothing();
    out.add(model.base, &poses[0], &rates[0], false);
    for (link, (at, rate)) in model.bodies.iter().zip(poses[1..].iter().zip(&rates[1..])) {
        out.add(&link.rigid, at, rate, true);
        let rate = nu[model.offset() + link.coordinate];
        out.energy = (link.motor_inertia.lift() * half).mul_add(rate * rate, out.energy);
    }
    out
}

/// The same of each body alone, base first.
pub(crate) fn each<'a>(
    model: Model<'a>,
    poses: &'a [BodyPose<f64>],
    rates: &'a [Rates<f64>],
) -> impl Iterator<Item = Sums<f64>> + 'a {
    let rigid = core::iter::once(model.base).chain(model.bodies.iter().map(|link| &link.rigid));
    let all = rigid.zip(poses.iter().zip(rates)).enumerate();
    all.map(|(body, (rigid, (at, rate)))| {
        let mut out = Sums::nothing();
        out.add(rigid, at, rate, body > 0);
        out
    })
}

impl<T: Real> Sums<T> {
    #[inline(always)]
    fn nothing() -> Self {
        let zero = V3::zero();
        Self {
            mass: T::of(0.0),
            h: zero,
            p: zero,
            l: zero,
            energy: T::of(0.0),
        }
    }

    /// Kinetic energy with the base origin moving at `v` (J).
    #[inline(always)]
    pub(crate) fn energy_at(&self, v: V3<T>) -> T {
        v.dot_add(self.p, (self.mass * T::of(0.5)).mul_add(v.dot(v), self.energy))
    }

    #[inline(always)]
    fn add<K: Constant<T>>(&mut self, rigid: &Rigid<K>, at: &BodyPose<T>, rate: &Rates<T>, rotated_frame: bool) {
        let mass: T = rigid.mass.lift();
        let sigma = Sym3::of(rigid.j);
        let (h, spin) = if rotated_frame {
            (at.r.mul(V3::of(rigid.h)), at.r.mul(sigma.mul(at.r.tmul(rate.omega))))
        } else {
            (V3::of(rigid.h), sigma.mul(rate.omega))
        };
        let own = rate.omega.cross(h); // momentum relative to the joint origin
        let p = rate.p_rate.mul_add(mass, own);
        let l = spin + h.cross(rate.p_rate); // about the joint origin
        self.mass = self.mass + mass;
        self.h = self.h + rate.p.mul_add(mass, h);
        self.p = self.p + p;
        self.l = self.l + rate.p.cross_add(p, l);
        let twice = rate.omega.dot_add(spin, rate.p_rate.dot(p + own));
        self.energy = twice.mul_add(T::of(0.5), self.energy);
    }
}
