//! Forward dynamics by the articulated-body algorithm (Featherstone, *Rigid Body Dynamics Algorithms*, 2008,
//! chapter 7), in base axes about each joint's origin.
//!
//! An articulated inertia is the 21 numbers of `[n; f] = [A H; Hᵀ M] [α; a] + [n₀; f₀]`.

use super::poses::joint_sin_cos;
use super::{BASE, Link, Model, Rigid, rotate};
use crate::num::{Constant, List, Mat3, Real, Size, Sym3, V3};

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
    /// Zero.
    #[inline(always)]
    pub(crate) fn zero() -> Self {
        let (o, v) = (T::of(0.0), V3::zero());
        Self {
            a: Sym3::scalar(o),
            h: Mat3 { c: [v; 3] },
            m: Sym3::scalar(o),
            n: v,
            f: v,
        }
    }

    /// A rigid body alone; its bias is the wrench due to its velocity-product acceleration.
    #[inline(always)]
    fn rigid<K: Constant<T>>(rigid: &Rigid<K>, at: &Outward<T>) -> Self {
        let (h, j) = (at.r.mul(V3::of(rigid.h)), Sym3::of(rigid.j).rotated(&at.r));
        let Outward { omega, alpha, acc, .. } = *at;
        Self {
            a: j,
            h: Mat3::skew(h),
            m: Sym3::scalar(rigid.mass.lift()),
            n: h.cross_add(acc, j.mul_add(alpha, omega.cross(j.mul(omega)))),
            f: omega.cross_add(omega.cross(h), alpha.cross_add(h, acc * rigid.mass.lift())),
        }
    }

    /// The base alone, with angular velocity `omega`: all quantities are in its axes, and its velocity-product acceleration is zero.
    #[inline(always)]
    fn base<K: Constant<T>>(rigid: &Rigid<K>, omega: V3<T>) -> Self {
        let (h, j) = (V3::of(rigid.h), Sym3::of(rigid.j));
        Self {
            a: j,
            h: Mat3::skew(h),
            m: Sym3::scalar(rigid.mass.lift()),
            n: omega.cross(j.mul(omega)),
            f: omega.cross(omega.cross(h)),
        }
    }

    /// Adds `o`, given about a point at `d` from this one's.
    #[inline(always)]
    pub(crate) fn add_shifted(&mut self, o: &Self, d: V3<T>) {
        let m = o.m.columns();
        let h = Mat3 {
            c: [
                d.cross_add(m[0], o.h.c[0]),
                d.cross_add(m[1], o.h.c[1]),
                d.cross_add(m[2], o.h.c[2]),
            ],
        };
        // A' = A + [d] Hᵀ − H' [d]: element (i, k) is A_ik + (d × row k of H)_i − (row i of H' × d)_k
        let (h0, h1, h2) = (o.h.row(0), o.h.row(1), o.h.row(2));
        let (g0, g1, g2) = (h.row(0), h.row(1), h.row(2));
        let (x, y, z) = (d.x, d.y, d.z);
        let four = |s: T, a: (T, T), b: (T, T), c: (T, T), d: (T, T)| {
            a.0.mul_add(a.1, b.0.mul_add(b.1, c.0.mul_add(c.1, d.0.mul_add(d.1, s))))
        };
        self.a = Sym3 {
            xx: y.mul_add(h0.z + g0.z, (-z).mul_add(h0.y + g0.y, self.a.xx + o.a.xx)),
            xy: four(self.a.xy + o.a.xy, (y, h1.z), (-z, h1.y), (-x, g0.z), (z, g0.x)),
            xz: four(self.a.xz + o.a.xz, (y, h2.z), (-z, h2.y), (-y, g0.x), (x, g0.y)),
            yy: z.mul_add(h1.x + g1.x, (-x).mul_add(h1.z + g1.z, self.a.yy + o.a.yy)),
            yz: four(self.a.yz + o.a.yz, (z, h2.x), (-x, h2.z), (-y, g1.x), (x, g1.y)),
            zz: x.mul_add(h2.y + g2.y, (-y).mul_add(h2.x + g2.x, self.a.zz + o.a.zz)),
        };
        self.h = self.h.add(&h);
        self.m = self.m.add(&o.m);
        self.n = self.n + d.cross_add(o.f, o.n);
        self.f = self.f + o.f;
    }
}

/// Outward pass of a body: pose and velocity products.
#[derive(Clone, Copy)]
struct Outward<T> {
    r: Mat3<T>,
    omega: V3<T>,
    d: V3<T>,
    /// Acceleration of the body and its origin when neither the base nor any joint accelerates.
    alpha: V3<T>,
    acc: V3<T>,
}

impl<T: Real> Outward<T> {
    /// The base, with angular velocity `omega`.
    #[inline(always)]
    fn base(omega: V3<T>) -> Self {
        let zero = V3::zero();
        Self {
            r: Mat3::identity(),
            omega,
            d: zero,
            alpha: zero,
            acc: zero,
        }
    }

    /// A child body of `self` with its joint at `q`, with sine and cosine `(s, c)`, moving at `rate`.
    #[inline(always)]
    fn child<K: Constant<T>>(&self, link: &Link<K>, q: T, (s, c): (T, T), rate: T) -> Self {
        let r = rotate(link, &self.r, s, c);
        let z_rate = r.c[2] * rate;
        let mut d = self.r.mul(V3::of(link.p));
        let (omega, alpha, spin);
        if link.prismatic {
            d = r.c[2].mul_add(q, d);
            omega = self.omega;
            alpha = self.alpha;
            // ω×(ω×d) + 2 ω×(z q̇)
            spin = omega.cross(omega.cross_add(d, z_rate + z_rate));
        } else {
            omega = self.omega + z_rate;
            alpha = self.omega.cross_add(z_rate, self.alpha);
            spin = self.omega.cross(self.omega.cross(d));
        }
        Self {
            r,
            omega,
            d,
            alpha,
            acc: self.alpha.cross_add(d, self.acc + spin),
        }
    }
}

/// Inward pass of a joint: the quantities needed for its acceleration in the final outward pass.
#[derive(Clone, Copy)]
struct Inward<T> {
    u_n: V3<T>,
    u_f: V3<T>,
    u: T,
    inv: T,
}

impl<T: Real> Inward<T> {
    /// A joint about or along `z` with generalised force `drive` that carries the articulated inertia `own`.
    #[inline(always)]
    fn of<K: Constant<T>>(link: &Link<K>, z: V3<T>, own: &Articulated<T>, drive: T) -> Self {
        let (u_n, u_f, pivot, resist) = if link.prismatic {
            let (u_n, u_f) = (own.h.mul(z), own.m.mul(z));
            (u_n, u_f, z.dot(u_f), z.dot(own.f))
        } else {
            let (u_n, u_f) = (own.a.mul(z), own.h.tmul(z));
            (u_n, u_f, z.dot(u_n), z.dot(own.n))
        };
        Self {
            u_n,
            u_f,
            u: drive - resist,
            inv: (pivot + link.motor_inertia.lift()).recip(),
        }
    }

    /// The part of `own` that the joint transmits to the parent.
    #[inline(always)]
    fn reduced(&self, own: &Articulated<T>) -> Articulated<T> {
        let Self { u_n, u_f, u, inv } = *self;
        let k = u * inv;
        let (w_n, w_f) = (u_n * -inv, u_f * -inv);
        Articulated {
            n: u_n.mul_add(k, own.n),
            f: u_f.mul_add(k, own.f),
            a: own.a.add_outer(u_n, w_n),
            h: own.h.add_outer(u_n, w_f),
            m: own.m.add_outer(u_f, w_f),
        }
    }

    /// The joint's acceleration, given the angular acceleration `alpha` of the parent's frame and the acceleration `acc` that the body's
    /// origin would have.
    #[inline(always)]
    fn acceleration(&self, alpha: V3<T>, acc: V3<T>) -> T {
        (self.u - self.u_n.dot_add(alpha, self.u_f.dot(acc))) * self.inv
    }
}

/// Acceleration (`out`, as the generalised velocity's rate) of a tree at `q` moving at `nu` under the generalised
/// force `tau`, joint dampers and springs included, in a uniform field `gravity` (base axes). `load` is added to the
/// base's articulated inertia: the contribution of an attached mechanism that is not part of the tree, about the base origin.
#[inline(always)]
pub(crate) fn aba<Z: Size, T: Real, K: Constant<T>>(
    model: Model<K>,
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
    // Measured: for doubles one pass over a body's pose and inertia is faster, for lanes (four times the registers) separate passes.
    let wide = const { size_of::<T>() > size_of::<f64>() };
    let trig = joint_sin_cos::<Z, T>(model.bodies.len(), q);
    let mut outward = Z::List::<Outward<T>>::with_capacity(n + 1);
    outward.push(Outward::base(omega_base));
    let mut inertias = Z::List::<Articulated<T>>::with_capacity(n + 1);
    inertias.push(Articulated::base(model.base, omega_base));
    if let Some(load) = load {
        inertias[BASE].add_shifted(load, V3::zero());
    }
    for link in model.bodies {
        let at = link.coordinate;
        let own = outward[link.parent].child(link, q[at], trig[at], nu[offset + at]);
        outward.push(own);
        if !wide {
            inertias.push(Articulated::rigid(&link.rigid, &own));
        }
    }
    if wide {
        for (link, own) in model.bodies.iter().zip(&outward[1..]) {
            inertias.push(Articulated::rigid(&link.rigid, own));
        }
    }
    // filled from the leaves: element n − 1 − i belongs to body i
    let mut inward = Z::List::<Inward<T>>::with_capacity(n);
    for i in (0..n).rev() {
        let link = &model.bodies[i];
        let Outward { r, d, .. } = &outward[i + 1];
        let (before, rest) = inertias.split_at_mut(i + 1);
        let (at, row) = (link.coordinate, offset + link.coordinate);
        let joint = Inward::of(link, r.c[2], &rest[0], joint_force(link, q[at], nu[row], tau[row]));
        inward.push(joint);
        before[link.parent].add_shifted(&joint.reduced(&rest[0]), *d);
    }

    let (alpha, acc) = if model.floating {
        let (torque, force) = model.base_part(tau);
        let base = &inertias[BASE];
        solve_base(base, torque - base.n, force - base.f)
    } else {
        (V3::zero(), -gravity)
    };
    if model.floating {
        alpha.write(out, 0);
        // classical acceleration relative to free fall, converted to the rate of the body-axes velocity
        (acc + gravity - omega_base.cross(v_base)).write(out, 3);
    }
    let mut rates = Z::List::<(V3<T>, V3<T>)>::with_capacity(n + 1);
    rates.push((alpha, acc));
    for (i, link) in model.bodies.iter().enumerate() {
        let (joint, own) = (&inward[n - 1 - i], &outward[i + 1]);
        let (alpha, acc) = rates[link.parent];
        let acc = alpha.cross_add(own.d, acc);
        let qdd = joint.acceleration(alpha, acc);
        out[offset + link.coordinate] = qdd;
        let z = own.r.c[2];
        rates.push(match link.prismatic {
            true => (alpha, z.mul_add(qdd, acc)),
            false => (z.mul_add(qdd, alpha), acc),
        });
    }
}

/// The joint's generalised force with damper and spring.
#[inline(always)]
fn joint_force<T: Real, K: Constant<T>>(link: &Link<K>, q: T, rate: T, tau: T) -> T {
    let damped = (-link.damping.lift()).mul_add(rate, tau);
    (-link.stiffness.lift()).mul_add(q - link.rest.lift(), damped)
}

/// `[A H; Hᵀ M] [α; a] = [n; f]` by LDLᵀ, translations first (they are the well-conditioned half).
#[allow(clippy::needless_range_loop)] // the indices are those of the textbook
#[inline(always)]
fn solve_base<T: Real>(i: &Articulated<T>, n: V3<T>, f: V3<T>) -> (V3<T>, V3<T>) {
    let arrays = |c: [V3<T>; 3]| [c[0].to_array(), c[1].to_array(), c[2].to_array()];
    let (m, a) = (arrays(i.m.columns()), arrays(i.a.columns()));
    let h = arrays(i.h.c); // h[c][r] = H[r][c]
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
