//! Forward dynamics by the articulated-body algorithm (Featherstone, *Rigid Body Dynamics Algorithms*, 2008,
//! chapter 7), in base axes about each joint's origin.
//!
//! An articulated inertia is the 21 numbers of `[n; f] = [A H; Hᵀ M] [α; a] + [n₀; f₀]`.

use super::place::sines;
use super::{BASE, Model, Rigid, rotate};
use crate::num::{List, Mat3, Real, Size, Sym3, V3};

/// Articulated inertia and bias wrench about a point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Articulated<T> {
    pub a: Sym3<T>,
    pub h: Mat3<T>,
    pub m: Sym3<T>,
    pub n: V3<T>,
    pub f: V3<T>,
}

impl<T: Real> Articulated<T> {
    /// A rigid body alone, turned by `r` and spinning at `omega`.
    #[inline(always)]
    fn rigid(rigid: &Rigid, r: &Mat3<T>, omega: V3<T>, turned: bool) -> Self {
        let (h, j) = if turned {
            (r.mul(V3::of(rigid.h)), Sym3::of(rigid.j).rotated(r))
        } else {
            (V3::of(rigid.h), Sym3::of(rigid.j))
        };
        Self {
            a: j,
            h: Mat3::skew(h),
            m: Sym3::scalar(T::of(rigid.mass)),
            n: omega.cross(j.mul(omega)),
            f: omega.cross(omega.cross(h)),
        }
    }

    /// Adds `o`, given about a point at `d` from this one's.
    #[inline(always)]
    fn add_shifted(&mut self, o: &Self, d: V3<T>) {
        let m = o.m.columns();
        let h = Mat3 {
            c: [
                d.cross_add(m[0], o.h.c[0]),
                d.cross_add(m[1], o.h.c[1]),
                d.cross_add(m[2], o.h.c[2]),
            ],
        };
        // A' = A + [d] Hᵀ − H' [d]; column k of [d]Hᵀ is d × (row k of H), row i of H'[d] is (row i of H') × d
        let (h0, h1, h2) = (o.h.row(0), o.h.row(1), o.h.row(2));
        let (g0, g1, g2) = (h.row(0), h.row(1), h.row(2));
        let plus =
            |s: T, i: usize, row: V3<T>, g: V3<T>, k: usize| s + cross_component(d, row, i) - cross_component(g, d, k);
        self.a = self.a.add(&Sym3 {
            xx: plus(o.a.xx, 0, h0, g0, 0),
            xy: plus(o.a.xy, 0, h1, g0, 1),
            xz: plus(o.a.xz, 0, h2, g0, 2),
            yy: plus(o.a.yy, 1, h1, g1, 1),
            yz: plus(o.a.yz, 1, h2, g1, 2),
            zz: plus(o.a.zz, 2, h2, g2, 2),
        });
        self.h = self.h.add(&h);
        self.m = self.m.add(&o.m);
        self.n = self.n + d.cross_add(o.f, o.n);
        self.f = self.f + o.f;
    }
}

/// Component `i` of `a × b`.
#[inline(always)]
fn cross_component<T: Real>(a: V3<T>, b: V3<T>, i: usize) -> T {
    match i {
        0 => a.y.mul_add(b.z, -(a.z * b.y)),
        1 => a.z.mul_add(b.x, -(a.x * b.z)),
        _ => a.x.mul_add(b.y, -(a.y * b.x)),
    }
}

/// What the way out needs of a joint.
#[derive(Clone, Copy)]
struct Joint<T> {
    r: Mat3<T>,
    omega: V3<T>,
    d: V3<T>,
    /// Velocity-product accelerations of the origin and the body.
    c_ang: V3<T>,
    c_lin: V3<T>,
    u_n: V3<T>,
    u_f: V3<T>,
    u: T,
    inv: T,
}

/// Acceleration (`out`, as the generalised velocity's rate) of a tree at `q` moving at `nu` under the generalised
/// force `tau`, joint dampers and springs included, in a uniform field `gravity` (base axes). `load` is added to the
/// base's articulated inertia: what an attached mechanism that is not part of the tree contributes.
#[inline(always)]
pub(crate) fn aba<Z: Size, T: Real>(
    model: Model,
    q: &[T],
    nu: &[T],
    tau: &[T],
    gravity: V3<T>,
    load: Option<&Articulated<T>>,
    out: &mut [T],
) {
    let offset = model.offset();
    let n = model.bodies.len();
    let (omega_base, v_base) = model.base_part(nu);
    let identity = Mat3::identity();
    let mut base = Articulated::rigid(model.base, &identity, omega_base, false);
    if let Some(load) = load {
        base.add_shifted(load, V3::zero());
    }

    let trig = sines::<Z, T>(model, q);
    let mut joints = Z::List::<Joint<T>>::with_capacity(n);
    let mut inertias = Z::List::<Articulated<T>>::with_capacity(n);
    for link in model.bodies {
        let on_base = link.parent == BASE;
        let (parent_r, parent_omega) = if on_base {
            (identity, omega_base)
        } else {
            (joints[link.parent].r, joints[link.parent].omega)
        };
        let (s, c) = trig[link.coordinate];
        let r = rotate(link, &parent_r, on_base, s, c);
        let z_rate = r.c[2] * nu[offset + link.coordinate];
        let mut d = if on_base {
            V3::of(link.p)
        } else {
            parent_r.mul(V3::of(link.p))
        };
        let (omega, c_ang, c_lin);
        if link.prismatic {
            d = r.c[2].mul_add(q[link.coordinate], d);
            omega = parent_omega;
            c_ang = V3::zero();
            // ω×(ω×d) + 2 ω×(z q̇)
            c_lin = parent_omega.cross(parent_omega.cross_add(d, z_rate + z_rate));
        } else {
            omega = parent_omega + z_rate;
            c_ang = parent_omega.cross(z_rate);
            c_lin = parent_omega.cross(parent_omega.cross(d));
        }
        inertias.push(Articulated::rigid(&link.rigid, &r, omega, true));
        let zero = V3::zero();
        let o = T::of(0.0);
        joints.push(Joint {
            r,
            omega,
            d,
            c_ang,
            c_lin,
            u_n: zero,
            u_f: zero,
            u: o,
            inv: o,
        });
    }

    for i in (0..n).rev() {
        let link = &model.bodies[i];
        let joint = &mut joints[i];
        let mut own = inertias[i];
        let z = joint.r.c[2];
        let (u_n, u_f, pivot, resist) = if link.prismatic {
            let (u_n, u_f) = (own.h.mul(z), own.m.mul(z));
            (u_n, u_f, z.dot(u_f), z.dot(own.f))
        } else {
            let (u_n, u_f) = (own.a.mul(z), own.h.tmul(z));
            (u_n, u_f, z.dot(u_n), z.dot(own.n))
        };
        let inv = (pivot + T::of(link.motor_inertia)).recip();
        let rate = nu[offset + link.coordinate];
        let drive = drive(link, q[link.coordinate], rate, tau[offset + link.coordinate]);
        let u = drive - resist;
        joint.u_n = u_n;
        joint.u_f = u_f;
        joint.u = u;
        joint.inv = inv;
        // the bias with the joint's own acceleration taken out, then the inertia likewise
        let along = u_n.dot_add(joint.c_ang, u_f.dot(joint.c_lin));
        let k = (u - along) * inv;
        own.n = own
            .a
            .mul_add(joint.c_ang, own.h.mul_add(joint.c_lin, u_n.mul_add(k, own.n)));
        own.f = own
            .h
            .tmul_add(joint.c_ang, own.m.mul_add(joint.c_lin, u_f.mul_add(k, own.f)));
        let (w_n, w_f) = (u_n * -inv, u_f * -inv);
        own.a = own.a.add_outer(u_n, w_n);
        own.h = own.h.add_outer(u_n, w_f);
        own.m = own.m.add_outer(u_f, w_f);
        let d = joint.d;
        let parent = if link.parent == BASE {
            &mut base
        } else {
            &mut inertias[link.parent]
        };
        parent.add_shifted(&own, d);
    }

    let (alpha, acc) = if model.floating {
        let (torque, force) = model.base_part(tau);
        solve_base(&base, torque - base.n, force - base.f)
    } else {
        (V3::zero(), -gravity)
    };
    if model.floating {
        alpha.write(out, 0);
        // classical acceleration relative to free fall, back to the rate of the body-axes velocity
        (acc + gravity - omega_base.cross(v_base)).write(out, 3);
    }
    // from here on `inertias` is done with; the way out keeps (α, a) per body
    let mut rates = Z::List::<(V3<T>, V3<T>)>::with_capacity(n);
    for (link, joint) in model.bodies.iter().zip(joints.iter()) {
        let (alpha_p, acc_p) = if link.parent == BASE {
            (alpha, acc)
        } else {
            rates[link.parent]
        };
        let a_ang = alpha_p + joint.c_ang;
        let a_lin = alpha_p.cross_add(joint.d, acc_p + joint.c_lin);
        let qdd = (joint.u - joint.u_n.dot_add(a_ang, joint.u_f.dot(a_lin))) * joint.inv;
        out[offset + link.coordinate] = qdd;
        let z = joint.r.c[2];
        rates.push(if link.prismatic {
            (a_ang, z.mul_add(qdd, a_lin))
        } else {
            (z.mul_add(qdd, a_ang), a_lin)
        });
    }
}

/// The joint's drive with damper and spring.
#[inline(always)]
fn drive<T: Real>(link: &super::Link, q: T, rate: T, tau: T) -> T {
    let damped = T::of(-link.damping).mul_add(rate, tau);
    T::of(-link.stiffness).mul_add(q - T::of(link.rest), damped)
}

/// `[A H; Hᵀ M] [α; a] = [n; f]` by LDLᵀ, translations first (they are the well-conditioned half).
#[inline(always)]
fn solve_base<T: Real>(i: &Articulated<T>, n: V3<T>, f: V3<T>) -> (V3<T>, V3<T>) {
    let m = i.m.columns().map(V3::to_array);
    let a = i.a.columns().map(V3::to_array);
    let h = i.h.c.map(V3::to_array); // h[c][r] = H[r][c]
    // Lower triangle of the matrix in the order (a, α): rows 3..6, columns 0..3 hold H.
    let mut l = [[T::of(0.0); 6]; 6];
    for r in 0..3 {
        for c in 0..=r {
            l[r][c] = m[c][r];
            l[3 + r][3 + c] = a[c][r];
        }
        for c in 0..3 {
            l[3 + r][c] = h[c][r];
        }
    }
    let mut x = [f.x, f.y, f.z, n.x, n.y, n.z];
    let mut inv = [T::of(0.0); 6];
    for j in 0..6 {
        inv[j] = l[j][j].recip();
        for r in j + 1..6 {
            let k = l[r][j] * inv[j];
            for c in j + 1..=r {
                l[r][c] = (-k).mul_add(l[c][j], l[r][c]);
            }
            x[r] = (-k).mul_add(x[j], x[r]);
        }
    }
    for j in (0..6).rev() {
        let mut s = x[j];
        for r in j + 1..6 {
            s = (-l[r][j]).mul_add(x[r], s);
        }
        x[j] = s * inv[j];
    }
    (V3::new(x[3], x[4], x[5]), V3::new(x[0], x[1], x[2]))
}
