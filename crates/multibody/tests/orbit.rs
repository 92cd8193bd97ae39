//! Error of neglecting orbital motion in the stock scenarios: bounds quoted in `docs/models/paper.md`.
//!
//! In a non-rotating frame that moves with the target, the gravity gradient remains: a body at r experiences n² (3 e (e · r) − r)
//! per unit of mass, where n is the orbital rate and e points away from Earth. Along e that is 2 n² r, the maximum.

use multibody::nalgebra::{Matrix3, Vector3};
use multibody::{Description, DynTree};

/// Earth's gravitational parameter, m³/s², and its equatorial radius, m (WGS 84, EGM96).
const EARTH: f64 = 3.986_004_418e14;
const EARTH_RADIUS: f64 = 6_378_137.0;
/// A low orbit's height, m.
const HEIGHT: f64 = 500e3;
/// Of the base at the start of the far capture, m, and its duration to the grasp, s (`scenarios/far.toml`).
const FAR: [f64; 3] = [-0.70, 0.0, -4.75];
const TIME: f64 = 55.0;

fn rate_squared() -> f64 {
    EARTH / (EARTH_RADIUS + HEIGHT).powi(3)
}

/// Mass, kg, and inertia about the centre of mass, kg m², of the servicer with its arm at the start.
fn servicer() -> (f64, Matrix3<f64>) {
    let urdf = concat!(env!("CARGO_MANIFEST_DIR"), "/../../models/servicer.urdf");
    let description = Description::from_urdf(&std::fs::read_to_string(urdf).unwrap()).unwrap();
    let tree = DynTree::new(&description, true).unwrap();
    let mut q = [0.0, 40.0, 0.0, 80.0, 0.0, 40.0, 0.0].map(f64::to_radians).to_vec();
    q.resize(tree.joints(), 0.0);
    let (m, n) = (tree.mass_matrix_in(&q), 6 + tree.joints());
    // About the base's origin: the inertia, and next to it the mass times the centre of mass as a skew matrix.
    let block = |row: usize, column: usize| Matrix3::from_fn(|i, j| m[(row + i) * n + column + j]);
    let (about_base, coupling, mass) = (block(0, 0), block(0, 3), m[3 * n + 3]);
    let skew = coupling / mass;
    let centre = Vector3::new(skew[(2, 1)], skew[(0, 2)], skew[(1, 0)]);
    let away = Matrix3::identity() * centre.norm_squared() - centre * centre.transpose();
    (mass, about_base - away * mass)
}

#[test]
fn tide_on_the_servicer_is_within_documented_bounds() {
    let (mass, inertia) = servicer();
    assert!((mass - 450.2).abs() < 0.05, "{mass} kg");
    let tide = 2.0 * rate_squared() * Vector3::from(FAR).norm() * mass;
    assert!((5.2e-3..5.4e-3).contains(&tide), "{tide} N");
    // 3 n² e × J e is largest half-way between the axes of the greatest and the least inertia.
    let axes = inertia.symmetric_eigenvalues();
    let torque = 1.5 * rate_squared() * (axes.max() - axes.min());
    println!("tide {tide:.3e} N, gravity gradient {torque:.3e} N m");
    assert!((8.7e-5..8.8e-5).contains(&torque), "{torque} N m");
}

/// Drift after `TIME`, m, of a body released at `offset` from another one on a circular orbit: both as points in Earth's
/// field, by Runge-Kutta steps of 50 ms.
fn drift(offset: Vector3<f64>) -> f64 {
    let radius = EARTH_RADIUS + HEIGHT;
    let speed = Vector3::new(0.0, (EARTH / radius).sqrt(), 0.0);
    let fly = |start: Vector3<f64>| {
        let pull = |p: &Vector3<f64>| -p * (EARTH / p.norm().powi(3));
        let (mut p, mut v, h) = (start, speed, 0.05);
        for _ in 0..(TIME / h).round() as usize {
            let (k1, l1) = (v, pull(&p));
            let (k2, l2) = (v + l1 * (h / 2.0), pull(&(p + k1 * (h / 2.0))));
            let (k3, l3) = (v + l2 * (h / 2.0), pull(&(p + k2 * (h / 2.0))));
            let (k4, l4) = (v + l3 * h, pull(&(p + k3 * h)));
            p += (k1 + (k2 + k3) * 2.0 + k4) * (h / 6.0);
            v += (l1 + (l2 + l3) * 2.0 + l4) * (h / 6.0);
        }
        p
    };
    let target = Vector3::new(radius, 0.0, 0.0);
    (fly(target + offset) - fly(target) - offset).norm()
}

#[test]
fn free_drift_in_a_far_capture_matches_the_tide() {
    let (r, n) = (Vector3::from(FAR).norm(), rate_squared().sqrt());
    let (up, along) = (drift(Vector3::new(r, 0.0, 0.0)), drift(Vector3::new(0.0, r, 0.0)));
    println!("drift {up:.4} m up, {along:.4} m along");
    // For short times n² r t² radially and half of that along the orbit; the rotation of e and the growth enter later, as (n t)².
    let tide = n * n * r * TIME * TIME;
    assert!((up / tide - 1.0).abs() < (n * TIME).powi(2), "{up} m against {tide} m");
    assert!(
        (2.0 * along / tide - 1.0).abs() < (n * TIME).powi(2),
        "{along} m against {} m",
        tide / 2.0
    );
    assert!((0.0175..0.0180).contains(&up), "{up} m");
}
