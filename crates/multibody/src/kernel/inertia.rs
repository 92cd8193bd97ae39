//! Mass matrix and Coriolis matrix by composite rigid bodies.
//!
//! The mass matrix is the composite-rigid-body algorithm (Featherstone 2008, §6.2). The Coriolis matrix is the
//! factorisation of Echeandia and Wensing (*Numerical Methods to Compute the Coriolis Matrix and Christoffel Symbols for
//! Rigid-Body Systems*, J. Comput. Nonlinear Dyn. 16, 2021, Algorithm 1), whose Ṁ − 2C is skew and whose elements are
//! the Christoffel symbols' own. For point masses that factorisation is Σ m Jᵀ J̇; summing over the points of a rigid body
//! turns their 6×6 matrix B(I, v) into nine numbers, `D = ∫ ẋ xᵀ dm`, which shift from joint to joint as
//! `D' = D + ḣ dᵀ + ḋ h'ᵀ`. A composite is (m, h, Σ, ḣ, D) about its joint's origin.

use super::poses::{BodyPose, Rates};
use super::{BASE, Model, Rigid, inertia_times};
use crate::num::{List, Mat3, Real, Size, Sym3, V3};

#[derive(Clone, Copy)]
struct Composite<T> {
    mass: T,
    h: V3<T>,
    /// ∫ x xᵀ dm.
    sigma: Sym3<T>,
    h_rate: V3<T>,
    /// ∫ ẋ xᵀ dm, x from the joint's origin, rates inertial, axes of the base.
    d: Mat3<T>,
}

impl<T: Real> Composite<T> {
    #[inline(always)]
    fn rigid<const RATES: bool>(rigid: &Rigid, at: &BodyPose<T>, omega: V3<T>, rotated_frame: bool) -> Self {
        let (h, sigma) = if rotated_frame {
            (at.r.mul(V3::of(rigid.h)), Sym3::of(rigid.sigma).rotated(&at.r))
        } else {
            (V3::of(rigid.h), Sym3::of(rigid.sigma))
        };
        let (h_rate, d) = if RATES {
            (
                omega.cross(h),
                Mat3 {
                    c: sigma.columns().map(|c| omega.cross(c)),
                },
            )
        } else {
            (V3::zero(), Mat3 { c: [V3::zero(); 3] })
        };
        Self {
            mass: T::of(rigid.mass),
            h,
            sigma,
            h_rate,
            d,
        }
    }

    /// Adds `o`; its origin is at `d` from this one's and moves at `d_rate` relative to it.
    #[inline(always)]
    fn add_shifted<const RATES: bool>(&mut self, o: &Self, d: V3<T>, d_rate: V3<T>) {
        let h = d.mul_add(o.mass, o.h);
        // Σ' = Σ + h dᵀ + d h'ᵀ
        self.sigma = self.sigma.add(&o.sigma.add_outer(o.h, d).add_outer(d, h));
        if RATES {
            self.d = self.d.add(&o.d.add_outer(o.h_rate, d).add_outer(d_rate, h));
            self.h_rate = self.h_rate + d_rate.mul_add(o.mass, o.h_rate);
        }
        self.h = self.h + h;
        self.mass = self.mass + o.mass;
    }

    /// `(tr(D) 1 − D) v`: the torque of a rotating reference velocity on rotating bodies.
    #[inline(always)]
    fn b_times(&self, v: V3<T>) -> V3<T> {
        self.d.mul_add(-v, v * self.d.trace())
    }

    #[inline(always)]
    fn b_transposed_times(&self, v: V3<T>) -> V3<T> {
        self.d.tmul_add(-v, v * self.d.trace())
    }

    /// Wrenches that the composite requires for a joint about `z`, with axis rate `zr`.
    #[inline(always)]
    fn unit_wrenches(&self, prismatic: bool, z: V3<T>, zr: V3<T>) -> UnitWrenches<T> {
        if prismatic {
            UnitWrenches {
                n: self.h.cross(z),
                f: z * self.mass,
                cn: self.h.cross(zr),
                cf: zr * self.mass,
                g: self.h_rate.cross(z),
            }
        } else {
            UnitWrenches {
                n: inertia_times(&self.sigma, z),
                f: z.cross(self.h),
                cn: self.b_times(z) + inertia_times(&self.sigma, zr),
                cf: z.cross_add(self.h_rate, zr.cross(self.h)),
                g: self.b_transposed_times(z),
            }
        }
    }
}

/// Wrench on the composite for unit acceleration of a joint, (n, f); for unit reference velocity, (cn, cf), due to the axis' rate and to
/// the bodies' motion; and the transposed action, g.
struct UnitWrenches<T> {
    n: V3<T>,
    f: V3<T>,
    cn: V3<T>,
    cf: V3<T>,
    g: V3<T>,
}

/// `M` into `mass` and, with `RATES`, `C` into `coriolis`: both square, column by column, and zero on entry
/// (elements between branches are not written).
#[inline(always)]
pub(crate) fn mass_and_coriolis<Z: Size, T: Real, const RATES: bool>(
    model: Model,
    poses: &[BodyPose<T>],
    rates: &[Rates<T>],
    omega_base: V3<T>,
    mass: &mut [T],
    coriolis: &mut [T],
) {
    let offset = model.offset();
    let n = model.bodies.len();
    let dim = offset + n;
    // without RATES there are no rates, and they are not used below
    let none = Rates::base(V3::zero());
    let rate_of = |at: usize| if RATES { rates[at] } else { none };
    let mut composites = Z::List::<Composite<T>>::with_capacity(n + 1);
    composites.push(Composite::rigid::<RATES>(model.base, &poses[BASE], omega_base, false));
    for (i, link) in model.bodies.iter().enumerate() {
        let omega = rate_of(i + 1).omega;
        composites.push(Composite::rigid::<RATES>(&link.rigid, &poses[i + 1], omega, true));
    }

    for i in (0..n).rev() {
        let link = &model.bodies[i];
        let at = &poses[i + 1];
        let rate = rate_of(i + 1);
        let (before, rest) = composites.split_at_mut(i + 1);
        let own = &rest[0];
        before[link.parent].add_shifted::<RATES>(own, at.d, rate.d);

        let col = offset + link.coordinate;
        let (z, zr) = (at.z(), rate.z);
        let mut unit = own.unit_wrenches(link.prismatic, z, zr);
        let diagonal = if link.prismatic { z.dot(unit.f) } else { z.dot(unit.n) };
        mass[col * dim + col] = diagonal + T::of(link.motor_inertia);
        if RATES {
            coriolis[col * dim + col] = if link.prismatic { z.dot(unit.cf) } else { z.dot(unit.cn) };
        }
        let mut from = i + 1;
        loop {
            let d = poses[from].d;
            unit.n = d.cross_add(unit.f, unit.n);
            if RATES {
                unit.cn = d.cross_add(unit.cf, unit.cn);
                unit.g = rate_of(from).d.cross_add(unit.f, unit.g);
            }
            from = model.bodies[from - 1].parent;
            if from == BASE {
                break;
            }
            let row = offset + model.bodies[from - 1].coordinate;
            let (z, zr) = (poses[from].z(), rate_of(from).z);
            let (m, up, down) = if model.bodies[from - 1].prismatic {
                (z.dot(unit.f), z.dot(unit.cf), zr.dot(unit.f))
            } else {
                (z.dot(unit.n), z.dot(unit.cn), zr.dot_add(unit.n, z.dot(unit.g)))
            };
            mass[col * dim + row] = m;
            mass[row * dim + col] = m;
            if RATES {
                coriolis[col * dim + row] = up;
                coriolis[row * dim + col] = down;
            }
        }
        if model.floating {
            write_row_and_column(mass, dim, col, (unit.n, unit.f), (unit.n, unit.f));
            if RATES {
                let row = (unit.n.cross_add(omega_base, unit.g), unit.f.cross(omega_base));
                write_row_and_column(coriolis, dim, col, (unit.cn, unit.cf), row);
            }
        }
    }
    if model.floating {
        base_blocks::<T, RATES>(&composites[BASE], omega_base, dim, mass, coriolis);
    }
}

/// The six base elements of a joint's column and of its row: rotations, then translations.
#[inline(always)]
fn write_row_and_column<T: Real>(
    m: &mut [T],
    dim: usize,
    row: usize,
    above: (V3<T>, V3<T>),
    (ang, lin): (V3<T>, V3<T>),
) {
    above.0.write(m, row * dim);
    above.1.write(m, row * dim + 3);
    m[row] = ang.x;
    m[dim + row] = ang.y;
    m[2 * dim + row] = ang.z;
    m[3 * dim + row] = lin.x;
    m[4 * dim + row] = lin.y;
    m[5 * dim + row] = lin.z;
}

/// The 6×6 block of the base, column by column: unit reference velocity along each base axis, with an inertial rate of
/// ω × that axis.
#[inline(always)]
fn base_blocks<T: Real, const RATES: bool>(
    own: &Composite<T>,
    omega: V3<T>,
    dim: usize,
    mass: &mut [T],
    coriolis: &mut [T],
) {
    let omega_skew = Mat3::skew(omega);
    let axes = Mat3::<T>::identity();
    for k in 0..3 {
        let (e, er) = (axes.c[k], omega_skew.c[k]);
        inertia_times(&own.sigma, e).write(mass, k * dim);
        e.cross(own.h).write(mass, k * dim + 3);
        own.h.cross(e).write(mass, (3 + k) * dim);
        (e * own.mass).write(mass, (3 + k) * dim + 3);
        if RATES {
            (own.b_times(e) + inertia_times(&own.sigma, er)).write(coriolis, k * dim);
            e.cross_add(own.h_rate, er.cross(own.h)).write(coriolis, k * dim + 3);
            own.h.cross(er).write(coriolis, (3 + k) * dim);
            (er * own.mass).write(coriolis, (3 + k) * dim + 3);
        }
    }
}
