//! The spherical pendulum against the paper's two hinges: the same motion where both are regular, and only the spherical
//! one passes through the pole.

mod common;

use common::servicer;
use multibody::{Method, SloshState, SloshTree, SphericalSlosh, State, Tree, from_two_hinges, rk4};
use nalgebra::{Matrix3, SVector, Vector3};

type Hinged = Tree<9, 15>;
type Spherical = SloshTree<7, 13>;

/// Both models of one bob: without inertia about its rod (which the spherical model lacks) and without dampers (the hinges'
/// act on hinge rates, the spherical pendulum's on the bob's rate).
fn pendulum_models(damping: f64, stiffness: f64) -> (Hinged, Spherical) {
    let mut hinged = servicer();
    for joint in ["slosh_y", "slosh_x"] {
        hinged.set_damping(joint, damping).expect("it exists");
        hinged.set_stiffness(joint, stiffness, 0.0).expect("it exists");
    }
    let bob = hinged
        .links
        .iter_mut()
        .find(|l| l.name == "slosh_bob")
        .expect("the model has a bob");
    bob.inertia.as_mut().expect("with inertia").about_com = Matrix3::from_diagonal(&Vector3::new(0.002, 0.002, 0.0));
    let mut rest = servicer();
    rest.remove_branch("slosh_gimbal").expect("it exists");
    let slosh = SphericalSlosh {
        hinge: Vector3::new(0.0, 0.0, -0.15),
        mass: 10.61,
        length: 0.1317,
        inertia: 0.002,
        damping,
        stiffness,
        rest: -Vector3::z(),
    };
    let spherical = SloshTree::new(Tree::new(&rest).expect("valid"), slosh).expect("valid");
    (Hinged::new(&hinged).expect("valid"), spherical)
}

fn start(q: [f64; 2], rates: [f64; 2]) -> (State<9, 15>, SloshState<7, 13>) {
    let mut s = State::<9, 15>::rest();
    s.q = SVector::from_column_slice(&[0.2, 0.7, -0.1, 1.4, 0.3, 0.7, 0.1, q[0], q[1]]);
    s.nu = SVector::from_column_slice(&[
        0.02, -0.03, 0.05, 0.04, 0.02, -0.06, 0.05, -0.04, 0.06, 0.03, -0.08, 0.05, 0.07, rates[0], rates[1],
    ]);
    let (d, w) = from_two_hinges(q, rates);
    let tree = State {
        p_nb: s.p_nb,
        quat_nb: s.quat_nb,
        q: s.q.fixed_rows::<7>(0).into(),
        nu: s.nu.fixed_rows::<13>(0).into(),
    };
    (s, SloshState { tree, d, w })
}

#[test]
fn pendulum_models_agree_where_both_are_regular() {
    let (hinged, spherical) = pendulum_models(0.0, 0.0);
    let (mut a, mut b) = start([0.4, -0.5], [0.6, -0.3]);
    let (tau, tau7) = (SVector::zeros(), SVector::zeros());
    let mut worst = 0.0_f64;
    for _ in 0..4_000 {
        a = hinged.step(Method::Rk4, &a, &tau, 5e-4);
        b = rk4(&spherical, &b, &tau7, 5e-4);
        let (d, w) = from_two_hinges([a.q[7], a.q[8]], [a.nu[13], a.nu[14]]);
        let base = (a.nu.fixed_rows::<13>(0) - b.tree.nu).norm() + (a.p_nb - b.tree.p_nb).norm();
        worst = worst.max((d - b.d).norm() + (w - b.w).norm() + base);
        assert!(libm::cos(a.q[8]).abs() > 0.2, "this run must stay away from the pole");
    }
    println!("largest difference in 2 s: {worst:.2e}");
    assert!(worst < 1e-10, "{worst:e}");
}

/// With springs and dampers the two models differ to second order in the angles.
#[test]
fn small_swings_with_spring_and_damper_agree_to_second_order() {
    let (hinged, spherical) = pendulum_models(0.0131, 0.5);
    let swing = |size: f64| {
        let (mut a, mut b) = start([0.5 * size, size], [0.0, 0.0]);
        a.nu.fill(0.0);
        b.tree.nu.fill(0.0);
        b.w.fill(0.0);
        let mut worst = 0.0_f64;
        for _ in 0..2_000 {
            a = hinged.step(Method::Rk4, &a, &SVector::zeros(), 1e-3);
            b = rk4(&spherical, &b, &SVector::zeros(), 1e-3);
            let (d, _) = from_two_hinges([a.q[7], a.q[8]], [0.0, 0.0]);
            worst = worst.max((d - b.d).norm());
        }
        worst / size
    };
    let (large, small) = (swing(0.2), swing(0.02));
    println!("relative difference {large:.2e} at 0.2 rad, {small:.2e} at 0.02 rad");
    assert!(small < 2e-4 && large / small > 80.0, "{large:e} {small:e}");
}

#[test]
fn the_spherical_pendulum_conserves_through_the_pole() {
    let (_, spherical) = pendulum_models(0.0, 0.0);
    // towards the pole of the first hinge (d = +y), which it narrowly misses
    let (_, mut s) = start([1e-6, 0.2], [0.0, 1.5]);
    s.tree.nu.fill(0.0);
    let of = |s: &SloshState<7, 13>| {
        let m = spherical.momentum(s);
        let quat = s.tree.quat_nb;
        (
            quat.rotate(&m.linear_b),
            quat.rotate(&m.angular_b),
            spherical.kinetic_energy(s),
        )
    };
    let (p0, l0, e0) = of(&s);
    let (mut worst, mut nearest) = (0.0_f64, 1.0_f64);
    for _ in 0..20_000 {
        s = rk4(&spherical, &s, &SVector::zeros(), 1e-3);
        let (p, l, e) = of(&s);
        worst = worst
            .max((p - p0).norm() / p0.norm())
            .max((l - l0).norm() / l0.norm())
            .max((e - e0).abs() / e0);
        nearest = nearest.min(1.0 - s.d.y.abs());
    }
    println!("worst {worst:.2e}, nearest {nearest:.1e}");
    assert!(nearest < 1e-3, "it must pass the pole: {nearest}");
    assert!(worst < 1e-11, "{worst:e}");
}

#[test]
fn two_hinge_pendulum_does_not_conserve_through_the_pole() {
    let (hinged, spherical) = pendulum_models(0.0, 0.0);
    let (mut a, mut b) = start([0.0, 1.2], [0.02, 1.5]);
    a.nu.fixed_rows_mut::<13>(0).fill(0.0);
    b.tree.nu.fill(0.0);
    let energy = |s: &State<9, 15>| hinged.kinetic_energy(&hinged.kinematics(&s.q, &s.nu));
    let e0 = energy(&a);
    let (mut fastest, mut bob) = (0.0_f64, 0.0_f64);
    for _ in 0..1_000 {
        a = hinged.step(Method::Rk4, &a, &SVector::zeros(), 1e-3);
        b = rk4(&spherical, &b, &SVector::zeros(), 1e-3);
        fastest = fastest.max(a.nu[13].abs());
        bob = bob.max(b.w.norm());
    }
    let lost = (energy(&a) - e0).abs() / e0;
    println!("first hinge up to {fastest:.0} rad/s while the bob moves at {bob:.2}; energy off by {lost:.1e}");
    assert!(fastest > 50.0 * bob && lost > 1e-6);
}

#[test]
fn invalid_pendulum_parameter_is_rejected_by_name() {
    let (_, good) = pendulum_models(0.0, 0.0);
    let refused = |change: &dyn Fn(&mut SphericalSlosh)| {
        let mut slosh = *good.slosh();
        change(&mut slosh);
        SloshTree::new(good.tree().clone(), slosh).unwrap_err().to_string()
    };
    assert!(refused(&|s| s.mass = 0.0).contains("the mass is 0"));
    assert!(refused(&|s| s.damping = -1.0).contains("the damping is -1"));
    assert!(refused(&|s| s.rest = Vector3::zeros()).contains("unit vector"));
}
