//! Properties that hold for every tree, state and force, on thousands of random trees of 1 to 12 joints (skew axes, random
//! placements, prismatic joints, massless bodies, motors, springs, dampers).

mod common;

use common::dense::{dot, force_size, matrix_error, minus, motion_size, solve, times};
use common::dual::Dual;
use common::random::{Rng, mechanism, state};
use common::slow::{Slow, evaluate};
use multibody::{Description, DynState, DynTree};
use nalgebra::{Matrix3, Vector3};
use proptest::prelude::*;

struct Case {
    rng: Rng,
    d: Description,
    tree: DynTree,
    s: DynState,
    m: Vec<Vec<f64>>,
    c: Vec<Vec<f64>>,
}

fn case(seed: u64, n: usize) -> Case {
    let mut rng = Rng::new(seed);
    let d = mechanism(&mut rng, n);
    let tree = DynTree::new(&d, true).expect("a random mechanism is valid");
    let s = state(&mut rng, n);
    let (m, c) = tree.mass_and_coriolis(&s);
    Case {
        rng,
        d,
        tree,
        s,
        m: m.to_rows(),
        c: c.to_rows(),
    }
}

fn cases() -> ProptestConfig {
    ProptestConfig {
        cases: 3000,
        ..ProptestConfig::default()
    }
}

/// Error relative to `size`, or absolute if `size` is zero.
fn relative(error: f64, size: f64) -> f64 {
    error / size.max(1e-6)
}

proptest! {
    #![proptest_config(cases())]

    #[test]
    fn algorithms_agree_with_the_slow_reference(seed: u64, n in 1_usize..=12) {
        let Case { d, tree, s, m, .. } = case(seed, n);
        let Slow { mass, bias, energy, linear_n, angular_com_n, com_n, poses } = evaluate(&d, &s);
        prop_assert!(matrix_error(&mass, &m, &mass) < 1e-13);
        let ours = tree.bias(&s);
        prop_assert!(relative(force_size(&mass, &minus(&ours, &bias)), force_size(&mass, &bias)) < 1e-12);
        prop_assert!(relative(tree.kinetic_energy(&s) - energy, energy).abs() < 1e-13);
        let h = tree.momentum(&s);
        let each = tree.body_momenta(&s);
        prop_assert!(each.iter().map(|body| body.mass).eq(tree.bodies().iter().map(|body| body.mass)));
        let mass: f64 = each.iter().map(|body| body.mass).sum();
        let centre = each.iter().map(|body| body.p_bc * body.mass).sum::<Vector3<f64>>() / mass;
        let linear: Vector3<f64> = each.iter().map(|body| body.linear_b).sum();
        let about = |body: &multibody::Momentum| body.angular_b + (body.p_bc - centre).cross(&body.linear_b);
        let angular: Vector3<f64> = each.iter().map(about).sum();
        let sizes = each.iter().map(|body| about(body).norm() + body.linear_b.norm()).sum::<f64>();
        prop_assert!((mass - h.mass).abs() < 1e-12 * mass && (centre - h.p_bc).norm() < 1e-12 * (1.0 + centre.norm()));
        prop_assert!((linear - h.linear_b).norm() < 1e-12 * sizes && (angular - h.angular_b).norm() < 1e-11 * sizes);
        let scale = (2.0 * energy * h.mass).sqrt();
        prop_assert!((s.quat_nb.rotate(&h.linear_b) - linear_n).norm() < 1e-13 * scale);
        prop_assert!((s.quat_nb.rotate(&h.angular_b) - angular_com_n).norm() < 1e-13 * scale * 10.0);
        prop_assert!((s.p_nb + s.quat_nb.rotate(&h.p_bc) - com_n).norm() < 1e-13 * 10.0);
        for (i, link) in d.links.iter().enumerate() {
            let at = tree.placement_in_world(&s, tree.frame(&link.name).expect("every link is a frame"));
            prop_assert!((at.p - poses[i].0).norm() < 1e-13 * 10.0);
            prop_assert!((at.r - poses[i].1).amax() < 1e-13);
        }
    }

    #[test]
    fn mass_matrix_is_symmetric_and_positive_definite(seed: u64, n in 1_usize..=12) {
        let Case { tree, s, m, .. } = case(seed, n);
        for (i, row) in m.iter().enumerate() {
            for (j, x) in row.iter().enumerate() {
                prop_assert_eq!(*x, m[j][i]);
            }
        }
        prop_assert!(common::dense::cholesky(&m).is_ok());
        let twice = dot(&s.nu, &times(&m, &s.nu));
        prop_assert!(relative(0.5 * twice - tree.kinetic_energy(&s), twice).abs() < 1e-13);
    }

    /// Either property alone can be satisfied by a wrong C.
    #[test]
    fn coriolis_matrix_gives_bias_and_rate_of_mass_matrix(seed: u64, n in 1_usize..=12) {
        let Case { tree, s, m, c, .. } = case(seed, n);
        let bias = tree.bias(&s);
        let cv = times(&c, &s.nu);
        prop_assert!(relative(force_size(&m, &minus(&cv, &bias)), force_size(&m, &bias)) < 1e-12);
        let moving: Vec<Dual> = (0..n).map(|i| Dual { v: s.q[i], d: s.nu[6 + i] }).collect();
        let rate = tree.mass_matrix_in(&moving);
        let dim = n + 6;
        let m_rate: Vec<Vec<f64>> = (0..dim).map(|r| (0..dim).map(|k| rate[k * dim + r].d).collect()).collect();
        let sum: Vec<Vec<f64>> = (0..dim).map(|r| (0..dim).map(|k| c[r][k] + c[k][r]).collect()).collect();
        prop_assert!(matrix_error(&m, &sum, &m_rate) < 1e-12);
    }

    #[test]
    fn coriolis_matrix_is_christoffel_consistent(seed: u64, n in 1_usize..=12) {
        let Case { mut rng, tree, s, m, .. } = case(seed, n);
        let other = DynState { nu: rng.list(n + 6, 1.5), ..s.clone() };
        let zero = vec![0.0; n + 6];
        let one = tree.mass_coriolis_product(&s, &zero, &other.nu);
        let two = tree.mass_coriolis_product(&other, &zero, &s.nu);
        let part = |x: &[f64], k: usize| Vector3::new(x[k], x[k + 1], x[k + 2]);
        let (w1, v1, w2, v2) = (part(&s.nu, 0), part(&s.nu, 3), part(&other.nu, 0), part(&other.nu, 3));
        let mut bracket = zero.clone();
        bracket[..3].copy_from_slice(w1.cross(&w2).as_slice());
        bracket[3..6].copy_from_slice((w1.cross(&v2) + v1.cross(&w2)).as_slice());
        let want = times(&m, &bracket);
        let size = force_size(&m, &one) + force_size(&m, &two);
        prop_assert!(relative(force_size(&m, &minus(&minus(&one, &two), &want)), size) < 1e-12);
    }

    #[test]
    fn one_pass_product_is_m_a_plus_c_nu_r(seed: u64, n in 1_usize..=12) {
        let Case { mut rng, tree, s, m, c, .. } = case(seed, n);
        let (a, nu_r) = (rng.list(n + 6, 2.0), rng.list(n + 6, 2.0));
        let (ma, cr) = (times(&m, &a), times(&c, &nu_r));
        let want: Vec<f64> = ma.iter().zip(&cr).map(|(a, b)| a + b).collect();
        let got = tree.mass_coriolis_product(&s, &a, &nu_r);
        prop_assert!(relative(force_size(&m, &minus(&got, &want)), force_size(&m, &want)) < 1e-12);
    }

    #[test]
    fn forward_dynamics_three_ways(seed: u64, n in 1_usize..=12) {
        let Case { mut rng, d, tree, s, m, .. } = case(seed, n);
        let tau = rng.list(n + 6, 5.0);
        let passive: Vec<f64> = d.moving_joints().enumerate()
            .map(|(i, j)| -j.damping * s.nu[6 + i] - j.stiffness * (s.q[i] - j.rest)).collect();
        let mut right = minus(&tau, &tree.bias(&s));
        right.iter_mut().skip(6).zip(&passive).for_each(|(r, p)| *r += p);
        let want = solve(&m, &right);
        let got = tree.forward_dynamics(&s, &tau);
        let size = motion_size(&m, &want);
        prop_assert!(relative(motion_size(&m, &minus(&got, &want)), size) < 1e-11);
        let mut back = tree.rnea(&s, &got);
        back.iter_mut().skip(6).zip(&passive).for_each(|(r, p)| *r -= p);
        prop_assert!(relative(force_size(&m, &minus(&back, &tau)), size) < 1e-11);
    }

    #[test]
    fn jacobian_and_rate_are_derivatives_of_the_pose(seed: u64, n in 1_usize..=12) {
        let Case { tree, s, .. } = case(seed, n);
        let frame = tree.frame("tip").expect("it was put there");
        let (j, j_rate) = tree.jacobian_and_rate(&s, frame);
        for i in 0..n {
            let q: Vec<Dual> = (0..n).map(|k| Dual { v: s.q[k], d: f64::from(u8::from(k == i)) }).collect();
            let (p, r) = tree.placement_in(&q, frame);
            let value = Matrix3::from_columns(&r.map(|c| Vector3::from(c.map(|x| x.v))));
            let rate = Matrix3::from_columns(&r.map(|c| Vector3::from(c.map(|x| x.d))));
            let v = value.transpose() * Vector3::from(p.map(|x| x.d));
            let w = value.transpose() * rate;
            let want = [w[(2, 1)], w[(0, 2)], w[(1, 0)], v.x, v.y, v.z];
            for (k, want) in want.iter().enumerate() {
                prop_assert!((j[(k, 6 + i)] - want).abs() < 1e-13 * 10.0, "row {k} column {i}");
            }
        }
        let moving: Vec<Dual> = (0..n).map(|i| Dual { v: s.q[i], d: s.nu[6 + i] }).collect();
        for (k, x) in tree.jacobian_in(&moving, frame).iter().enumerate() {
            let (row, column) = (k % 6, k / 6);
            prop_assert!((j[(row, column)] - x.v).abs() < 1e-13 * 10.0);
            prop_assert!((j_rate[(row, column)] - x.d).abs() < 1e-12 * 10.0, "row {row} column {column}");
        }
        // the base columns: a frame's velocity is the base's, transformed to the frame
        let (p, r) = tree.placement_in(&s.q, frame);
        let (p, r) = (Vector3::from(p), Matrix3::from_columns(&r.map(Vector3::from)));
        for k in 0..3 {
            let e = Vector3::from_fn(|i, _| f64::from(u8::from(i == k)));
            let (ang, lin) = (r.transpose() * e, r.transpose() * e.cross(&p));
            for i in 0..3 {
                prop_assert!((j[(i, k)] - ang[i]).abs() < 1e-14 && (j[(3 + i, k)] - lin[i]).abs() < 1e-13);
                prop_assert!(j[(i, 3 + k)] == 0.0 && (j[(3 + i, 3 + k)] - ang[i]).abs() < 1e-14);
            }
        }
    }

    /// The base's position and a velocity common to all bodies do not change the motion of the joints by a single bit.
    #[test]
    fn base_position_and_speed_cost_no_accuracy(seed: u64, n in 1_usize..=12) {
        let Case { mut rng, tree, s, m, .. } = case(seed, n);
        let tau = rng.list(n + 6, 5.0);
        let near = tree.forward_dynamics(&s, &tau);
        let mut far = s.clone();
        far.p_nb = Vector3::new(7.0e6, -1.0e6, 3.0e5);
        far.quat_nb = rng.quaternion();
        let shift = rng.vector() * 7500.0;
        for k in 0..3 {
            far.nu[3 + k] = shift[k];
        }
        let there = tree.forward_dynamics(&far, &tau);
        prop_assert_eq!(&near[6..], &there[6..]);
        prop_assert_eq!(&near[..3], &there[..3]);
        let (m_far, _) = tree.mass_and_coriolis(&far);
        prop_assert_eq!(m, m_far.to_rows());
        prop_assert_eq!(tree.momentum(&s).angular_b, tree.momentum(&far).angular_b);
    }

    #[test]
    fn nan_input_gives_nan_output(seed: u64, n in 1_usize..=12, poison in 0_usize..3, bad: bool) {
        let Case { mut rng, tree, mut s, .. } = case(seed, n);
        let mut tau = rng.list(n + 6, 5.0);
        let value = if bad { f64::NAN } else { f64::INFINITY };
        match poison {
            0 => s.q[rng.below(n)] = value,
            1 => s.nu[rng.below(n + 6)] = value,
            _ => tau[rng.below(n + 6)] = value,
        }
        prop_assert!(tree.forward_dynamics(&s, &tau).iter().any(|x| !x.is_finite()));
        let _ = (tree.bias(&s), tree.mass_and_coriolis(&s), tree.momentum(&s), tree.kinetic_energy(&s));
    }

    #[test]
    fn angles_of_a_hundred_thousand_radians(seed: u64, n in 1_usize..=12) {
        let Case { mut rng, d, tree, mut s, .. } = case(seed, n);
        for (q, j) in s.q.iter_mut().zip(d.moving_joints()) {
            *q = if j.kind == multibody::JointKind::Prismatic { *q } else { 1.0e5 * rng.unit() };
        }
        let slow = evaluate(&d, &s);
        prop_assert!(matrix_error(&slow.mass, &tree.mass_and_coriolis(&s).0.to_rows(), &slow.mass) < 1e-13);
        prop_assert!(
            relative(force_size(&slow.mass, &minus(&tree.bias(&s), &slow.bias)), force_size(&slow.mass, &slow.bias))
                < 1e-12
        );
    }
}
