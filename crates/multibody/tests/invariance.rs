//! Equivalent descriptions give the same mechanism.

mod common;

use common::dense::{minus, motion_size};
use common::random::{Rng, mechanism, state};
use multibody::{Description, DynState, DynTree, Inertia, Joint, JointKind, Link, Placement, State, Tree};
use nalgebra::{Matrix3, SVector, Vector3};
use proptest::prelude::*;

fn cases() -> ProptestConfig {
    ProptestConfig {
        cases: 1000,
        ..ProptestConfig::default()
    }
}

/// Largest difference of the accelerations, in the first tree's mass metric, relative.
fn difference(a: &Description, b: &Description, s: &DynState, tau: &[f64]) -> f64 {
    let tree = DynTree::new(a, true).expect("valid");
    let (x, y) = (
        tree.forward_dynamics(s, tau),
        DynTree::new(b, true).expect("valid").forward_dynamics(s, tau),
    );
    let m = tree.mass_and_coriolis(s).0.to_rows();
    motion_size(&m, &minus(&x, &y)) / motion_size(&m, &x)
}

fn fixed(name: &str, parent: usize, child: usize, origin: Placement) -> Joint {
    Joint {
        name: name.into(),
        kind: JointKind::Fixed,
        parent,
        child,
        origin,
        axis: Vector3::x(),
        limits: None,
        damping: 0.0,
        friction: 0.0,
        stiffness: 0.0,
        rest: 0.0,
        motor_inertia: 0.0,
        mimic: None,
    }
}

fn steiner(m: f64, x: Vector3<f64>) -> Matrix3<f64> {
    (Matrix3::identity() * x.norm_squared() - x * x.transpose()) * m
}

proptest! {
    #![proptest_config(cases())]

    /// A link cut in two and welded together again.
    #[test]
    fn welding_a_split_body_changes_nothing(seed: u64, n in 1_usize..=12) {
        let mut rng = Rng::new(seed);
        let d = mechanism(&mut rng, n);
        let (s, tau) = (state(&mut rng, n), rng.list(n + 6, 5.0));
        let mut split = d.clone();
        let link = (0..=n).rev().find(|&i| d.links[i].inertia.is_some_and(|i| i.mass > 0.0)).expect("one has mass");
        let whole = d.links[link].inertia.expect("just found");
        // remove a ball of a tenth of the mass, near the centre of mass, and attach it by a fixed joint
        let (mass, at) = (0.1 * whole.mass, whole.com + rng.vector() * 0.02);
        let ball = Matrix3::identity() * 1e-3;
        let rest = whole.mass - mass;
        let com = (whole.com * whole.mass - at * mass) / rest;
        let about_com =
            whole.about_com - ball - steiner(mass, at - whole.com) - steiner(rest, com - whole.com);
        split.links[link].inertia = Some(Inertia { mass: rest, com, about_com });
        let origin = Placement { p: rng.vector(), r: rng.rotation() };
        let piece = Inertia { mass, com: origin.r.transpose() * (at - origin.p), about_com: ball };
        split.links.push(Link { name: "piece".into(), inertia: Some(piece) });
        let child = split.links.len() - 1;
        split.joints.push(fixed("weld", link, child, origin));
        prop_assume!(split.validate().is_ok()); // the rest may be too thin to be a body
        prop_assert!(difference(&d, &split, &s, &tau) < 1e-11);
    }

    /// Another choice of axes for a link and its joint.
    #[test]
    fn re_framing_a_joint_changes_nothing(seed: u64, n in 1_usize..=12) {
        let mut rng = Rng::new(seed);
        let d = mechanism(&mut rng, n);
        let (s, tau) = (state(&mut rng, n), rng.list(n + 6, 5.0));
        let mut other = d.clone();
        let (j, turn) = (rng.below(n), rng.rotation());
        let slide = if other.joints[j].kind == JointKind::Prismatic { 0.0 } else { rng.unit() };
        // the new link frame, seen from the old: turned, and moved along the axis
        let new = Placement { p: other.joints[j].axis * slide, r: turn };
        let back = Placement { p: -(turn.transpose() * new.p), r: turn.transpose() };
        let joint = &mut other.joints[j];
        joint.origin = joint.origin.then(&new);
        joint.axis = turn.transpose() * joint.axis;
        let child = joint.child;
        if let Some(i) = &mut other.links[child].inertia {
            i.com = back.p + back.r * i.com;
            i.about_com = back.r * i.about_com * back.r.transpose();
        }
        for k in other.joints.iter_mut().filter(|k| k.parent == child) {
            k.origin = back.then(&k.origin);
        }
        prop_assert!(difference(&d, &other, &s, &tau) < 1e-11);
    }

    /// The same base, seen from another point and in other axes.
    #[test]
    fn moving_the_base_frame_moves_only_the_base_coordinates(seed: u64, n in 1_usize..=12) {
        let mut rng = Rng::new(seed);
        let d = mechanism(&mut rng, n);
        let (s, tau) = (state(&mut rng, n), rng.list(n + 6, 5.0));
        let mut other = d.clone();
        let shift = Placement { p: rng.vector(), r: rng.rotation() }; // old base B in the new base A
        other.links.push(Link { name: "new base".into(), inertia: None });
        let root = other.links.len() - 1;
        other.joints.push(fixed("shift", root, 0, shift));
        let part = |x: &[f64], k: usize| Vector3::new(x[k], x[k + 1], x[k + 2]);
        let put = |x: &mut [f64], a: Vector3<f64>, b: Vector3<f64>| {
            x[..3].copy_from_slice(a.as_slice());
            x[3..6].copy_from_slice(b.as_slice());
        };
        // ω_A = R ω_B, v_A = R v_B − ω_A × p; force likewise, the torque taken about A's origin
        let mut moved = s.clone();
        let omega = shift.r * part(&s.nu, 0);
        put(&mut moved.nu, omega, shift.r * part(&s.nu, 3) - omega.cross(&shift.p));
        let mut tau_a = tau.clone();
        let force = shift.r * part(&tau, 3);
        put(&mut tau_a, shift.r * part(&tau, 0) + shift.p.cross(&force), force);
        let tree = DynTree::new(&d, true).expect("valid");
        let at_b = tree.forward_dynamics(&s, &tau);
        let mut at_a = DynTree::new(&other, true).expect("valid").forward_dynamics(&moved, &tau_a);
        let alpha = shift.r.transpose() * part(&at_a, 0);
        let lin = shift.r.transpose() * (part(&at_a, 3) + part(&at_a, 0).cross(&shift.p));
        put(&mut at_a, alpha, lin);
        let m = tree.mass_and_coriolis(&s).0.to_rows();
        prop_assert!(motion_size(&m, &minus(&at_a, &at_b)) < 1e-11 * motion_size(&m, &at_b));
    }

    /// A branched tree with children listed before parents in the file keeps its coordinates in the order of the file.
    #[test]
    fn the_order_of_the_file_is_the_order_of_the_coordinates(seed: u64, n in 2_usize..=12) {
        let mut rng = Rng::new(seed);
        let d = mechanism(&mut rng, n);
        let (s, tau) = (state(&mut rng, n), rng.list(n + 6, 5.0));
        let mut shuffled = d.clone();
        let moving = &mut shuffled.joints[..n];
        for i in (1..n).rev() {
            moving.swap(i, rng.below(i + 1));
        }
        let old = |j: &Joint| d.joints.iter().position(|k| k.name == j.name).expect("same joints");
        let order: Vec<usize> = moving.iter().map(old).collect();
        let pick = |x: &[f64], skip: usize| -> Vec<f64> {
            x[..skip].iter().copied().chain(order.iter().map(|&k| x[skip + k])).collect()
        };
        let other = DynState { q: pick(&s.q, 0), nu: pick(&s.nu, 6), ..s.clone() };
        let want = pick(&DynTree::new(&d, true).expect("valid").forward_dynamics(&s, &tau), 6);
        let got = DynTree::new(&shuffled, true).expect("valid").forward_dynamics(&other, &pick(&tau, 6));
        let tree = DynTree::new(&shuffled, true).expect("valid");
        let m = tree.mass_and_coriolis(&other).0.to_rows();
        prop_assert!(motion_size(&m, &minus(&got, &want)) < 1e-11 * motion_size(&m, &want));
    }

    /// Rotating the world, base and gravity together changes nothing; and a uniform field accelerates a free base by the
    /// field itself, and its joints not at all.
    #[test]
    fn gravity_and_the_pose_of_the_base(seed: u64) {
        let mut rng = Rng::new(seed);
        let d = mechanism(&mut rng, 5);
        let s = state(&mut rng, 5);
        let tau = SVector::<f64, 11>::from_column_slice(&rng.list(11, 5.0));
        let at = |quat_nb| State::<5, 11> {
            p_nb: s.p_nb,
            quat_nb,
            q: SVector::from_column_slice(&s.q),
            nu: SVector::from_column_slice(&s.nu),
        };
        let g = rng.vector() * 9.8;
        let tree = Tree::<5, 11>::new(&d).expect("valid").with_gravity(g);
        let here = tree.forward_dynamics(&at(s.quat_nb), &tau);
        let turn = rng.quaternion();
        let turned = tree.clone().with_gravity(turn.rotate(&g));
        let there = turned.forward_dynamics(&at(turn.times(s.quat_nb)), &tau);
        prop_assert!((here - there).norm() < 1e-12 * here.norm() * 100.0);
        let free = tree.aba(&at(s.quat_nb).q, &at(s.quat_nb).nu, &tau);
        let mut want = free;
        let g_b = s.quat_nb.rotate_back(&g);
        for k in 0..3 {
            want[3 + k] += g_b[k];
        }
        prop_assert!((here - want).norm() < 1e-12 * want.norm() * 10.0);
        let back = tree.inverse_dynamics(&at(s.quat_nb), &here) - tree.passive_force(&at(s.quat_nb).q, &at(s.quat_nb).nu);
        prop_assert!((back - tau).norm() < 1e-10 * tau.norm());
    }

    /// A joint frozen in the description gives the same motion as a joint held by a constraint force.
    #[test]
    fn freezing_joints_gives_the_block_of_the_mass_matrix(seed: u64, n in 2_usize..=12) {
        let mut rng = Rng::new(seed);
        let d = mechanism(&mut rng, n);
        let mut s = state(&mut rng, n);
        let k = rng.below(n);
        s.nu[6 + k] = 0.0;
        let mut frozen = d.clone();
        frozen.freeze(&format!("j{k}"), s.q[k]).expect("it exists");
        let less = |x: &[f64], at: usize| -> Vec<f64> {
            x.iter().enumerate().filter(|(i, _)| *i != at).map(|(_, x)| *x).collect()
        };
        let other = DynState { q: less(&s.q, k), nu: less(&s.nu, 6 + k), ..s.clone() };
        let (whole, c) = DynTree::new(&d, true).expect("valid").mass_and_coriolis(&s);
        let (part, c_part) = DynTree::new(&frozen, true).expect("valid").mass_and_coriolis(&other);
        let block = |m: &[Vec<f64>]| -> Vec<Vec<f64>> { without_row_and_column(m, 6 + k).iter().map(|r| less(r, 6 + k)).collect() };
        let m = part.to_rows();
        prop_assert!(common::dense::matrix_error(&m, &m, &block(&whole.to_rows())) < 1e-13);
        prop_assert!(common::dense::matrix_error(&m, &c_part.to_rows(), &block(&c.to_rows())) < 1e-12);
    }
}

fn without_row_and_column(m: &[Vec<f64>], at: usize) -> Vec<Vec<f64>> {
    m.iter()
        .enumerate()
        .filter(|(i, _)| *i != at)
        .map(|(_, r)| r.clone())
        .collect()
}

/// A fixed base is equivalent to a floating base held by a constraint wrench.
#[test]
fn fixed_base_is_a_held_floating_base() {
    let mut rng = Rng::new(11);
    for _ in 0..500 {
        let d = mechanism(&mut rng, 6);
        let s = state(&mut rng, 6);
        let tau = SVector::<f64, 6>::from_column_slice(&rng.list(6, 3.0));
        let held = Tree::<6, 6>::new(&d).expect("valid");
        let free = DynTree::new(&d, true).expect("valid");
        let q = SVector::<f64, 6>::from_column_slice(&s.q);
        let nu = SVector::<f64, 6>::from_column_slice(&s.nu[6..]);
        let acc = held.aba(&q, &nu, &tau);
        let mut all = vec![0.0; 12];
        all[6..].copy_from_slice(acc.as_slice());
        let mut still = s.clone();
        still.nu[..6].fill(0.0);
        let needed = free.rnea(&still, &all);
        let passive = held.passive_force(&q, &nu);
        for i in 0..6 {
            assert!(
                (needed[6 + i] - passive[i] - tau[i]).abs() < 1e-10,
                "{}",
                needed[6 + i] - passive[i] - tau[i]
            );
        }
    }
}
