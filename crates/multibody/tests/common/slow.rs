//! A slow reference, written to share nothing with the crate: world axes, link by link over the unmerged description
//! (fixed joints are joints too), Rodrigues rotations with `libm`, M = Σ Jᵀ I J with dense geometric Jacobians, and the
//! bias from explicit accelerations of the centres of mass.

use multibody::{Description, DynState, JointKind};
use nalgebra::{Matrix3, Vector3};

type V = Vector3<f64>;

pub(crate) struct Slow {
    /// Row-major dim × dim.
    pub(crate) mass: Vec<Vec<f64>>,
    pub(crate) bias: Vec<f64>,
    pub(crate) energy: f64,
    pub(crate) linear_n: V,
    pub(crate) angular_com_n: V,
    pub(crate) com_n: V,
    /// Pose of every link, by index.
    pub(crate) poses: Vec<(V, Matrix3<f64>)>,
}

#[derive(Clone)]
struct BodyMotion {
    p: V,
    r: Matrix3<f64>,
    omega: V,
    v: V,
    alpha: V,
    a: V,
    /// Columns (angular, linear at `p`) per generalised velocity, world axes.
    columns: Vec<(V, V)>,
}

fn rotation(axis: &V, angle: f64) -> Matrix3<f64> {
    let (s, c) = (libm::sin(angle), libm::cos(angle));
    Matrix3::identity() * c + axis.cross_matrix() * s + axis * axis.transpose() * (1.0 - c)
}

/// The base, from the state.
fn base(s: &DynState, dim: usize) -> BodyMotion {
    let r = s.quat_nb.matrix();
    let b = |k: usize| V::new(s.nu[k], s.nu[k + 1], s.nu[k + 2]);
    let (omega, v) = (r * b(0), r * b(3));
    let mut columns = vec![(V::zeros(), V::zeros()); dim];
    for k in 0..3 {
        columns[k].0 = r.column(k).into();
        columns[3 + k].1 = r.column(k).into();
    }
    // with ν̇ = 0 the base's body-axes velocity is constant: its world acceleration is ω × v
    BodyMotion {
        p: s.p_nb,
        r,
        omega,
        v,
        alpha: V::zeros(),
        a: omega.cross(&v),
        columns,
    }
}

/// How every link moves, from the base outwards.
fn motion(d: &Description, s: &DynState, dim: usize) -> Vec<Option<BodyMotion>> {
    let mut links: Vec<Option<BodyMotion>> = vec![None; d.links.len()];
    let root = (0..d.links.len())
        .find(|&i| d.joints.iter().all(|j| j.child != i))
        .expect("a root");
    links[root] = Some(base(s, dim));
    let mut open: Vec<usize> = (0..d.joints.len()).collect();
    while let Some(at) = open.iter().position(|&j| links[d.joints[j].parent].is_some()) {
        let index = open.remove(at);
        let j = &d.joints[index];
        let coordinate = d.joints[..index].iter().filter(|j| j.kind != JointKind::Fixed).count();
        let up = links[j.parent].clone().expect("placed");
        let axis = up.r * j.origin.r * j.axis.normalize();
        let mut arm = up.r * j.origin.p;
        let mut r = up.r * j.origin.r;
        let (mut omega, mut alpha) = (up.omega, up.alpha);
        let (mut slide_v, mut slide_a) = (V::zeros(), V::zeros());
        let mut columns = up.columns.clone();
        let mut own = (V::zeros(), V::zeros());
        match j.kind {
            JointKind::Fixed => {}
            JointKind::Prismatic => {
                let (x, rate) = (s.q[coordinate], s.nu[6 + coordinate]);
                arm += axis * x;
                slide_v = axis * rate;
                slide_a = up.omega.cross(&slide_v) * 2.0;
                own = (V::zeros(), axis);
            }
            JointKind::Revolute | JointKind::Continuous => {
                let rate = s.nu[6 + coordinate];
                // in joint axes: rotating about the world axis instead would let rounding errors grow from joint to joint
                r *= rotation(&j.axis.normalize(), s.q[coordinate]);
                omega += axis * rate;
                alpha += up.omega.cross(&axis) * rate;
                own = (axis, V::zeros());
            }
        }
        for (ang, lin) in &mut columns {
            *lin += ang.cross(&arm);
        }
        if j.kind != JointKind::Fixed {
            columns[6 + coordinate] = own;
        }
        links[j.child] = Some(BodyMotion {
            p: up.p + arm,
            r,
            omega,
            v: up.v + up.omega.cross(&arm) + slide_v,
            alpha,
            a: up.a + up.alpha.cross(&arm) + up.omega.cross(&up.omega.cross(&arm)) + slide_a,
            columns,
        });
    }
    links
}

pub(crate) fn evaluate(d: &Description, s: &DynState) -> Slow {
    let dim = 6 + s.q.len();
    let links = motion(d, s, dim);
    let mut out = Slow {
        mass: vec![vec![0.0; dim]; dim],
        bias: vec![0.0; dim],
        energy: 0.0,
        linear_n: V::zeros(),
        angular_com_n: V::zeros(),
        com_n: V::zeros(),
        poses: Vec::new(),
    };
    let mut total = 0.0;
    let mut angular_origin = V::zeros();
    for (link, moving) in d.links.iter().zip(&links) {
        let m = moving.as_ref().expect("every link is placed");
        out.poses.push((m.p, m.r));
        let Some(i) = link.inertia else { continue };
        let arm = m.r * i.com;
        let about = m.r * i.about_com * m.r.transpose();
        let (p, v) = (m.p + arm, m.v + m.omega.cross(&arm));
        let a = m.a + m.alpha.cross(&arm) + m.omega.cross(&m.omega.cross(&arm));
        let columns: Vec<(V, V)> = m.columns.iter().map(|(w, l)| (*w, l + w.cross(&arm))).collect();
        let torque = about * m.alpha + m.omega.cross(&(about * m.omega));
        for (r, (wr, lr)) in columns.iter().enumerate() {
            out.bias[r] += lr.dot(&a) * i.mass + wr.dot(&torque);
            for (c, (wc, lc)) in columns.iter().enumerate() {
                out.mass[r][c] += lr.dot(lc) * i.mass + wr.dot(&(about * wc));
            }
        }
        out.energy += 0.5 * i.mass * v.norm_squared() + 0.5 * m.omega.dot(&(about * m.omega));
        out.linear_n += v * i.mass;
        angular_origin += (p - s.p_nb).cross(&(v * i.mass)) + about * m.omega;
        out.com_n += p * i.mass;
        total += i.mass;
    }
    out.com_n /= total;
    out.angular_com_n = angular_origin - (out.com_n - s.p_nb).cross(&out.linear_n);
    for (k, j) in d.joints.iter().filter(|j| j.kind != JointKind::Fixed).enumerate() {
        out.mass[6 + k][6 + k] += j.motor_inertia;
        out.energy += 0.5 * j.motor_inertia * s.nu[6 + k] * s.nu[6 + k];
    }
    out
}
