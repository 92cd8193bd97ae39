//! Random rotations and small random misalignments.

use std::f64::consts::TAU;

use super::normal::quantile;
use super::vector::cross;

/// A Hamilton quaternion, the scalar first.
pub type Quaternion = [f64; 4];

/// A uniformly distributed rotation (K. Shoemake, Uniform random rotations, 1992); the scalar part is not negative.
pub fn random_rotation(u: [f64; 3]) -> Quaternion {
    let (a, b) = (libm::sqrt(1.0 - u[0]), libm::sqrt(u[0]));
    let (first, second) = (TAU * u[1], TAU * u[2]);
    let q = [
        b * libm::cos(second),
        a * libm::sin(first),
        a * libm::cos(first),
        b * libm::sin(second),
    ];
    if q[0] < 0.0 { q.map(|x| -x) } else { q }
}

/// The rotation vector of a small rotation, rad: three independent normal angles about the axes, each with standard deviation `deviation`.
pub fn misalignment(deviation: f64, u: [f64; 3]) -> [f64; 3] {
    u.map(|u| deviation * quantile(u))
}

/// The rotation about the vector `rotation_vector` by its length, rad.
pub fn rotation_from_vector(rotation_vector: [f64; 3]) -> Quaternion {
    let angle = libm::sqrt(rotation_vector.iter().map(|x| x * x).sum());
    // sin(x/2)/x, with the limit 1/2 at zero.
    let part = if angle > 1e-9 {
        libm::sin(0.5 * angle) / angle
    } else {
        0.5
    };
    [
        libm::cos(0.5 * angle),
        part * rotation_vector[0],
        part * rotation_vector[1],
        part * rotation_vector[2],
    ]
}

/// First `b`, then `a`, both in the same fixed axes: the product a b.
pub fn compose(a: Quaternion, b: Quaternion) -> Quaternion {
    let (va, vb) = ([a[1], a[2], a[3]], [b[1], b[2], b[3]]);
    let across = cross(va, vb);
    let scalar = a[0] * b[0] - (0..3).map(|i| va[i] * vb[i]).sum::<f64>();
    let vector: [f64; 3] = std::array::from_fn(|i| a[0] * vb[i] + b[0] * va[i] + across[i]);
    [scalar, vector[0], vector[1], vector[2]]
}

/// The vector `v` rotated by `q`.
pub fn rotate(q: Quaternion, v: [f64; 3]) -> [f64; 3] {
    let axis = [q[1], q[2], q[3]];
    let twice = cross(axis, v).map(|x| 2.0 * x);
    let again = cross(axis, twice);
    std::array::from_fn(|i| v[i] + q[0] * twice[i] + again[i])
}

/// Rotations about the fixed axes x, y and z in this order, rad.
pub fn from_roll_pitch_yaw(angles: [f64; 3]) -> Quaternion {
    let about = |axis: usize| {
        let mut q = [libm::cos(0.5 * angles[axis]), 0.0, 0.0, 0.0];
        q[axis + 1] = libm::sin(0.5 * angles[axis]);
        q
    };
    compose(about(2), compose(about(1), about(0)))
}

/// The rotations about the fixed axes x, y and z in this order, rad; the one about y from -π/2 to π/2.
pub fn roll_pitch_yaw(q: Quaternion) -> [f64; 3] {
    let [w, x, y, z] = q;
    let sine = (2.0 * (w * y - z * x)).clamp(-1.0, 1.0);
    [
        libm::atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
        libm::asin(sine),
        libm::atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
    ]
}
