//! Body Jacobian of a frame and its rate.

use super::place::Placed;
use super::{BASE, Model};
use crate::num::{Mat3, Real, V3};

/// A frame E fixed to a body (or to the base, [`BASE`]) at a pose in the body's frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FrameConsts {
    pub body: usize,
    pub r: [[f64; 3]; 3],
    pub p: [f64; 3],
}

/// Pose and rates of the frame, base axes: (R_BE, p_BE, ω_NE, rate of p_BE).
#[inline(always)]
pub(crate) fn frame_at<T: Real>(frame: &FrameConsts, placed: &[Placed<T>], omega_base: V3<T>) -> FrameAt<T> {
    let on = if frame.body == BASE {
        Placed::base(omega_base)
    } else {
        placed[frame.body]
    };
    let arm = on.r.mul(V3::of(frame.p));
    FrameAt {
        r: on.r.mul_mat(&Mat3::of(frame.r)),
        p: on.p + arm,
        omega: on.omega,
        p_rate: on.omega.cross_add(arm, on.p_rate),
    }
}

/// See [`frame_at`].
pub(crate) struct FrameAt<T> {
    pub r: Mat3<T>,
    pub p: V3<T>,
    pub omega: V3<T>,
    pub p_rate: V3<T>,
}

/// Rows [ω; v] in E axes, 6 × dim, column by column. With `RATE` the time derivative of that matrix as E and the base
/// move.
#[inline(always)]
pub(crate) fn jacobian<T: Real, const RATE: bool>(
    model: Model,
    placed: &[Placed<T>],
    omega_base: V3<T>,
    frame: &FrameConsts,
    out: &mut [T],
) {
    let offset = model.offset();
    let dim = offset + model.bodies.len();
    out[..6 * dim].fill(T::of(0.0));
    let at = frame_at(frame, placed, omega_base);
    // components of u in E axes, or the rate of those components when u changes at u_rate
    let put = |out: &mut [T], k: usize, u: V3<T>, u_rate: V3<T>| {
        let seen = if RATE { u.cross_add(at.omega, u_rate) } else { u };
        at.r.tmul(seen).write(out, k);
    };
    let mut body = frame.body;
    while body != BASE {
        let link = &model.bodies[body];
        let on = &placed[body];
        let k = 6 * (offset + link.coordinate);
        let (z, zr) = (on.z(), on.z_rate);
        if link.prismatic {
            put(out, k + 3, z, zr);
        } else {
            let (arm, arm_rate) = (at.p - on.p, at.p_rate - on.p_rate);
            put(out, k, z, zr);
            put(out, k + 3, z.cross(arm), z.cross_add(arm_rate, zr.cross(arm)));
        }
        body = link.parent;
    }
    if model.floating {
        let axes = Mat3::<T>::identity();
        let turn = Mat3::skew(omega_base);
        for i in 0..3 {
            let (e, er) = (axes.c[i], turn.c[i]);
            put(out, 6 * i, e, er);
            put(out, 6 * i + 3, e.cross(at.p), e.cross_add(at.p_rate, er.cross(at.p)));
            put(out, 6 * (3 + i) + 3, e, er);
        }
    }
}
