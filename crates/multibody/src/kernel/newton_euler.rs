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
//! caller.

use super::place::sines;
use super::{BASE, Model, Rigid, rotate};
use crate::num::{List, Mat3, Real, Size, Sym3, V3};

#[derive(Clone, Copy)]
struct Moving<T> {
    r: Mat3<T>,
    d: V3<T>,
    omega: V3<T>,
    omega_r: V3<T>,
    alpha: V3<T>,
    acc: V3<T>,
}

/// Wrench about the body's origin, base axes.
#[derive(Clone, Copy)]
struct Wrench<T> {
    n: V3<T>,
    f: V3<T>,
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
    let (omega, v) = model.base_part(nu);
    let (a_ang, a_lin) = model.base_part(a);
    // base: a_r,0 = a + v₀ × v_r,0 in spatial terms, so α = a_ω + ω×ω_r and, classically, a_v + ω×v_r
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
    let base = Moving {
        r: Mat3::identity(),
        d: V3::zero(),
        omega,
        omega_r,
        alpha,
        acc,
    };
    let mut base_wrench = own_wrench::<T, SAME>(model.base, &base, false);

    let trig = sines::<Z, T>(model, q);
    let mut moving = Z::List::<Moving<T>>::with_capacity(n);
    let mut wrenches = Z::List::<Wrench<T>>::with_capacity(n);
    for link in model.bodies {
        let on_base = link.parent == BASE;
        let up = if on_base { base } else { moving[link.parent] };
        let (s, c) = trig[link.coordinate];
        let k = offset + link.coordinate;
        let r = rotate(link, &up.r, on_base, s, c);
        let z = r.c[2];
        let z_rate = z * nu[k];
        let z_rate_r = if SAME { z_rate } else { z * nu_r[k] };
        let d = if on_base {
            V3::of(link.p)
        } else {
            up.r.mul(V3::of(link.p))
        };
        let own = if link.prismatic {
            let d = z.mul_add(q[link.coordinate], d);
            // a + α×d + ω_r×ḋ + ω×(z q̇_r) + z q̈, with ḋ = ω×d + z q̇
            let d_rate = up.omega.cross_add(d, z_rate);
            let acc = up.alpha.cross_add(d, z.mul_add(a[k], up.acc));
            let acc = up.omega.cross_add(z_rate_r, up.omega_r.cross_add(d_rate, acc));
            Moving { r, d, acc, ..up }
        } else {
            let acc = up.omega_r.cross_add(up.omega.cross(d), up.alpha.cross_add(d, up.acc));
            let alpha = up.omega.cross_add(z_rate_r, z.mul_add(a[k], up.alpha));
            Moving {
                r,
                d,
                omega: up.omega + z_rate,
                omega_r: up.omega_r + z_rate_r,
                alpha,
                acc,
            }
        };
        wrenches.push(own_wrench::<T, SAME>(&link.rigid, &own, true));
        moving.push(own);
    }

    for i in (0..n).rev() {
        let link = &model.bodies[i];
        let k = offset + link.coordinate;
        let Wrench { n, f } = wrenches[i];
        let z = moving[i].r.c[2];
        let d = moving[i].d;
        let along = if link.prismatic { z.dot(f) } else { z.dot(n) };
        out[k] = T::of(link.motor_inertia).mul_add(a[k], along);
        let parent = if link.parent == BASE {
            &mut base_wrench
        } else {
            &mut wrenches[link.parent]
        };
        parent.n = d.cross_add(f, parent.n + n);
        parent.f = parent.f + f;
    }
    if model.floating {
        base_wrench.n.write(out, 0);
        base_wrench.f.write(out, 3);
    }
}

/// The body's own share. The constant Σ is in body axes, so the two vectors it multiplies go there and the result comes
/// back: cheaper than turning Σ.
#[inline(always)]
fn own_wrench<T: Real, const SAME: bool>(rigid: &Rigid, m: &Moving<T>, turned: bool) -> Wrench<T> {
    let into = |v: V3<T>| if turned { m.r.tmul(v) } else { v };
    let sigma = Sym3::of(rigid.sigma);
    let j = Sym3::of(rigid.j);
    let omega_l = into(m.omega);
    let omega_r_l = if SAME { omega_l } else { into(m.omega_r) };
    let n_l = j.mul_add(into(m.alpha), -omega_l.cross(sigma.mul(omega_r_l)));
    let h = if turned {
        m.r.mul(V3::of(rigid.h))
    } else {
        V3::of(rigid.h)
    };
    let n = h.cross_add(m.acc, if turned { m.r.mul(n_l) } else { n_l });
    let f = m
        .omega_r
        .cross_add(m.omega.cross(h), m.alpha.cross_add(h, m.acc * T::of(rigid.mass)));
    Wrench { n, f }
}
