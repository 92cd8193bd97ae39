//! Inverse dynamics with a second velocity: `M a + C(ν) ν_r` in one Newton-Euler pass, C the Christoffel-consistent
//! factorisation of Echeandia and Wensing (2021).
//!
//! Per body, in their spatial form, f = I a_r + ½ [v ×* (I v_r) + v_r ×* (I v) − I (v × v_r)]. Put into classical
//! accelerations about the joint origin, every term with a linear velocity cancels by the Jacobi identity, and
//! `½ [ω×(J ω_r) + ω_r×(J ω) − J (ω×ω_r)] = −ω×(Σ ω_r)` with Σ = ½ tr(J) 1 − J, which leaves
//!
//! `n = J α_r + h×a_r − ω×(Σ ω_r)`, `f = m a_r + α_r×h + ω_r×(ω×h)`.
//!
//! With ν_r = ν this is the recursive Newton-Euler algorithm. No gravity, dampers or springs: those are added by the
//! caller. Unlike the other recursions this one works in each body's own axes: only vectors are transformed, the inertias
//! stay constant, and a joint axis is e_z.

use super::poses::joint_sin_cos;
use super::{BASE, Link, Model, Rigid};
use crate::num::{List, Mat3, Real, Size, Sym3, V3};

/// Rates of a body in its own axes.
#[derive(Clone, Copy)]
struct BodyMotion<T> {
    omega: V3<T>,
    omega_r: V3<T>,
    alpha: V3<T>,
    acc: V3<T>,
}

/// Wrench about the body's origin, its own axes.
#[derive(Clone, Copy)]
struct Wrench<T> {
    n: V3<T>,
    f: V3<T>,
}

/// Change of axes across a joint: `R_PL = E Rz(q)`.
struct JointRotation<T> {
    e: Mat3<T>,
    s: T,
    c: T,
}

impl<T: Real> JointRotation<T> {
    #[inline(always)]
    fn new(link: &Link, (s, c): (T, T)) -> Self {
        let (s, c) = if link.prismatic {
            (T::of(0.0), T::of(1.0))
        } else {
            (s, c)
        };
        Self {
            e: Mat3::of(link.e),
            s,
            c,
        }
    }

    #[inline(always)]
    fn to_child(&self, v: V3<T>) -> V3<T> {
        let t = self.e.tmul(v);
        V3 {
            x: self.c.mul_add(t.x, self.s * t.y),
            y: self.c.mul_add(t.y, -(self.s * t.x)),
            z: t.z,
        }
    }

    #[inline(always)]
    fn to_parent(&self, v: V3<T>) -> V3<T> {
        let x = self.c.mul_add(v.x, -(self.s * v.y));
        let y = self.c.mul_add(v.y, self.s * v.x);
        self.e.mul(V3 { x, y, z: v.z })
    }
}

/// A joint's coordinate, its two rates and its acceleration.
#[derive(Clone, Copy)]
struct Joint<T> {
    q: T,
    rate: T,
    rate_r: T,
    acc: T,
}

impl<T: Real> BodyMotion<T> {
    /// The base: a_r,0 = a + v₀ × v_r,0 in spatial terms, so α = a_ω + ω×ω_r and, classically, a_v + ω×v_r.
    #[inline(always)]
    fn base<const SAME: bool>(model: Model, nu: &[T], a: &[T], nu_r: &[T], gravity: V3<T>) -> Self {
        let (omega, v) = model.base_part(nu);
        let (a_ang, a_lin) = model.base_part(a);
        let (omega_r, alpha, acc) = if SAME {
            (omega, a_ang, omega.cross_add(v, a_lin - gravity))
        } else {
            let (omega_r, v_r) = model.base_part(nu_r);
            (
                omega_r,
                omega.cross_add(omega_r, a_ang),
                omega.cross_add(v_r, a_lin - gravity),
            )
        };
        Self {
            omega,
            omega_r,
            alpha,
            acc,
        }
    }

    /// Child of this body on a prismatic joint.
    #[inline(always)]
    fn prismatic_child<const SAME: bool>(&self, link: &Link, rotation: &JointRotation<T>, joint: Joint<T>) -> Self {
        let z = rotation.e.c[2];
        let d = z.mul_add(joint.q, V3::of(link.p));
        // a + α×d + ω_r×ḋ + ω×(z q̇_r) + z q̈, with ḋ = ω×d + z q̇
        let d_rate = self.omega.cross_add(d, z * joint.rate);
        let acc = self.alpha.cross_add(d, z.mul_add(joint.acc, self.acc));
        let acc = self
            .omega
            .cross_add(z * joint.rate_r, self.omega_r.cross_add(d_rate, acc));
        let omega = rotation.to_child(self.omega);
        let omega_r = if SAME { omega } else { rotation.to_child(self.omega_r) };
        Self {
            omega,
            omega_r,
            alpha: rotation.to_child(self.alpha),
            acc: rotation.to_child(acc),
        }
    }

    /// Child of this body on a revolute joint.
    #[inline(always)]
    fn revolute_child<const SAME: bool>(&self, link: &Link, rotation: &JointRotation<T>, joint: Joint<T>) -> Self {
        let d = V3::of(link.p);
        let acc = self
            .omega_r
            .cross_add(self.omega.cross(d), self.alpha.cross_add(d, self.acc));
        let mut omega = rotation.to_child(self.omega);
        let mut alpha = rotation.to_child(self.alpha);
        // z q̈ + ω×(z q̇_r)
        alpha.x = omega.y.mul_add(joint.rate_r, alpha.x);
        alpha.y = (-omega.x).mul_add(joint.rate_r, alpha.y);
        alpha.z = alpha.z + joint.acc;
        omega.z = omega.z + joint.rate;
        let omega_r = if SAME {
            omega
        } else {
            let mut r = rotation.to_child(self.omega_r);
            r.z = r.z + joint.rate_r;
            r
        };
        Self {
            omega,
            omega_r,
            alpha,
            acc: rotation.to_child(acc),
        }
    }
}

/// `out = M(q) a + C(q, ν) ν_r`, in a field `gravity` (base axes). With `SAME` the second velocity is ν itself and
/// `nu_r` is not read.
#[inline(always)]
pub(crate) fn newton_euler<Z: Size, T: Real, const SAME: bool>(
    model: Model,
    q: &[T],
    nu: &[T],
    a: &[T],
    nu_r: &[T],
    gravity: V3<T>,
    out: &mut [T],
) {
    let offset = model.offset();
    let n = model.bodies.len();
    let base = BodyMotion::base::<SAME>(model, nu, a, nu_r, gravity);
    let trig = joint_sin_cos::<Z, T>(model.bodies.len(), q);
    let mut motions = Z::List::<BodyMotion<T>>::with_capacity(n + 1);
    let mut wrenches = Z::List::<Wrench<T>>::with_capacity(n + 1);
    wrenches.push(own_wrench::<T, SAME>(model.base, &base));
    motions.push(base);
    for link in model.bodies {
        let parent = motions[link.parent];
        let k = offset + link.coordinate;
        let rotation = JointRotation::new(link, trig[link.coordinate]);
        let joint = Joint {
            q: q[link.coordinate],
            rate: nu[k],
            rate_r: if SAME { nu[k] } else { nu_r[k] },
            acc: a[k],
        };
        let own = if link.prismatic {
            parent.prismatic_child::<SAME>(link, &rotation, joint)
        } else {
            parent.revolute_child::<SAME>(link, &rotation, joint)
        };
        wrenches.push(own_wrench::<T, SAME>(&link.rigid, &own));
        motions.push(own);
    }

    for i in (0..n).rev() {
        let link = &model.bodies[i];
        let k = offset + link.coordinate;
        let Wrench { n, f } = wrenches[i + 1];
        let rotation = JointRotation::new(link, trig[link.coordinate]);
        let along = if link.prismatic { f.z } else { n.z };
        out[k] = T::of(link.motor_inertia).mul_add(a[k], along);
        let mut d = V3::of(link.p);
        if link.prismatic {
            d = rotation.e.c[2].mul_add(q[link.coordinate], d);
        }
        let parent = &mut wrenches[link.parent];
        let (n, f) = (rotation.to_parent(n), rotation.to_parent(f));
        parent.n = d.cross_add(f, parent.n + n);
        parent.f = parent.f + f;
    }
    if model.floating {
        wrenches[BASE].n.write(out, 0);
        wrenches[BASE].f.write(out, 3);
    }
}

/// The body's own contribution.
#[inline(always)]
fn own_wrench<T: Real, const SAME: bool>(rigid: &Rigid, m: &BodyMotion<T>) -> Wrench<T> {
    let (sigma, j, h) = (Sym3::of(rigid.sigma), Sym3::of(rigid.j), V3::of(rigid.h));
    let omega_r = if SAME { m.omega } else { m.omega_r };
    let n = j.mul_add(m.alpha, -m.omega.cross(sigma.mul(omega_r)));
    let f = omega_r.cross_add(m.omega.cross(h), m.alpha.cross_add(h, m.acc * T::of(rigid.mass)));
    Wrench {
        n: h.cross_add(m.acc, n),
        f,
    }
}
