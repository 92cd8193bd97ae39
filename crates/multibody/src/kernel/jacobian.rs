//! Body Jacobian of a frame and its rate.

use super::poses::{BodyPose, Rates};
use super::{BASE, Model};
use crate::num::{Constant, Mat3, Real, V3};

/// A frame E fixed to a body, given by the body's index in the lists (the base is at [`BASE`]) and the pose in its frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FrameConsts<K = f64> {
    pub body: usize,
    pub r: [[K; 3]; 3],
    pub p: [K; 3],
}

/// Pose of the frame in base axes: (R_BE, p_BE).
#[inline(always)]
pub(crate) fn frame_at<T: Real, K: Constant<T>>(
    frame: &FrameConsts<K>,
    poses: &[BodyPose<T>],
    rates: &[Rates<T>],
) -> (Mat3<T>, V3<T>) {
    let on = &poses[frame.body];
    (
        on.r.mul_mat(&Mat3::of(frame.r)),
        on.r.mul_add(V3::of(frame.p), rates[frame.body].p),
    )
}

/// Rows [ω; v] in E axes, 6 × dim, column by column. With `RATE` the time derivative of that matrix as E and the base
/// move.
#[inline(always)]
pub(crate) fn jacobian<T: Real, K: Constant<T>, const RATE: bool>(
    model: Model<K>,
    poses: &[BodyPose<T>],
    rates: &[Rates<T>],
    omega_base: V3<T>,
    frame: &FrameConsts<K>,
    out: &mut [T],
) {
    let offset = model.offset();
    let dim = offset + model.bodies.len();
    out[..6 * dim].fill(T::of(0.0));
    let (r, p) = frame_at(frame, poses, rates);
    // not used below without RATE
    let base = Rates::base(omega_base);
    let (omega, p_rate) = if RATE {
        let on = &rates[frame.body];
        (on.omega, on.omega.cross_add(p - on.p, on.p_rate))
    } else {
        (base.omega, base.p_rate)
    };
    let mut body = frame.body;
    while body != BASE {
        let link = &model.bodies[body - 1];
        let on = &poses[body];
        let k = 6 * (offset + link.coordinate);
        let rate = &rates[body];
        let (z, zr) = (on.z(), rate.z);
        if link.prismatic {
            write_column::<T, RATE>(out, &r, omega, k + 3, z, zr);
        } else {
            let (arm, arm_rate) = (p - rate.p, p_rate - rate.p_rate);
            write_column::<T, RATE>(out, &r, omega, k, z, zr);
            write_column::<T, RATE>(
                out,
                &r,
                omega,
                k + 3,
                z.cross(arm),
                z.cross_add(arm_rate, zr.cross(arm)),
            );
        }
        body = link.parent;
    }
    if model.floating {
        let axes = Mat3::<T>::identity();
        let omega_skew = Mat3::skew(omega_base);
        for i in 0..3 {
            let (e, er) = (axes.c[i], omega_skew.c[i]);
            write_column::<T, RATE>(out, &r, omega, 6 * i, e, er);
            write_column::<T, RATE>(out, &r, omega, 6 * i + 3, e.cross(p), e.cross_add(p_rate, er.cross(p)));
            write_column::<T, RATE>(out, &r, omega, 6 * (3 + i) + 3, e, er);
        }
    }
}

/// Writes the components of `u` in the axes `r`, or with `RATE` their rate as the axes turn at `omega` and `u` changes at `u_rate`.
// A function, since a closure cannot be forced to be inlined, which lanes need.
#[inline(always)]
fn write_column<T: Real, const RATE: bool>(
    out: &mut [T],
    r: &Mat3<T>,
    omega: V3<T>,
    k: usize,
    u: V3<T>,
    u_rate: V3<T>,
) {
    let components = if RATE { u.cross_add(omega, u_rate) } else { u };
    r.tmul(components).write(out, k);
}
