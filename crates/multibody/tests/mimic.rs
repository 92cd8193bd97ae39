//! Joints that follow others, compared with the tree in which they are free and held by constraint forces.

mod common;

use common::dense::{minus, motion_size, solve, times};
use common::random::{Rng, mechanism, state};
use multibody::{Description, DynState, DynTree, Mimic, Tree, TreeError};
use proptest::prelude::*;

/// The position of joint i is `multiplier · q + offset` of joint `leader`.
struct Follower {
    joint: usize,
    leader: usize,
    multiplier: f64,
    offset: f64,
}

/// Some joints of `d` follow earlier ones, which may follow others in turn.
fn add_followers(d: &mut Description, rng: &mut Rng, n: usize) -> Vec<Follower> {
    let mut followers = Vec::new();
    for joint in 1..n {
        if !rng.chance(40) && joint + 1 < n {
            continue;
        }
        let leader = rng.below(joint);
        let (multiplier, offset) = (1.5 * rng.unit(), rng.unit());
        d.joints[joint].mimic = Some(Mimic {
            joint: format!("j{leader}"),
            multiplier,
            offset,
        });
        followers.push(Follower {
            joint,
            leader,
            multiplier,
            offset,
        });
    }
    followers
}

/// The state of all joints from that of the independent ones: link by link, by definition.
fn full_state(followers: &[Follower], s: &DynState, n: usize) -> DynState {
    let mut all = DynState {
        q: vec![0.0; n],
        nu: s.nu[..6].to_vec(),
        ..s.clone()
    };
    all.nu.resize(6 + n, 0.0);
    let mut own = 0;
    for joint in 0..n {
        match followers.iter().find(|f| f.joint == joint) {
            Some(f) => {
                all.q[joint] = f.multiplier * all.q[f.leader] + f.offset;
                all.nu[6 + joint] = f.multiplier * all.nu[6 + f.leader];
            }
            None => {
                all.q[joint] = s.q[own];
                all.nu[6 + joint] = s.nu[6 + own];
                own += 1;
            }
        }
    }
    all
}

/// Accelerations of all joints with the followers held by constraint forces λ: `M a + Aᵀ λ = f = τ − C ν + passive` with `A a = 0`, so
/// `A M⁻¹ Aᵀ λ = A M⁻¹ f`.
fn constrained(free: &DynTree, d: &Description, followers: &[Follower], s: &DynState, tau: &[f64]) -> Vec<f64> {
    let mass = free.mass_and_coriolis(s).0.to_rows();
    let mut force = minus(tau, &free.bias(s));
    for (k, joint) in d.joints.iter().take(s.q.len()).enumerate() {
        force[6 + k] -= joint.damping * s.nu[6 + k] + joint.stiffness * (s.q[k] - joint.rest);
    }
    let row = |f: &Follower| {
        let mut row = vec![0.0; s.nu.len()];
        (row[6 + f.joint], row[6 + f.leader]) = (1.0, -f.multiplier);
        row
    };
    let rows: Vec<Vec<f64>> = followers.iter().map(row).collect();
    let moved: Vec<Vec<f64>> = rows.iter().map(|row| solve(&mass, row)).collect();
    let coupling: Vec<Vec<f64>> = moved.iter().map(|column| times(&rows, column)).collect();
    let lambda = solve(&coupling, &times(&rows, &solve(&mass, &force)));
    for (row, lambda) in rows.iter().zip(lambda) {
        force.iter_mut().zip(row).for_each(|(f, a)| *f -= a * lambda);
    }
    solve(&mass, &force)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(500))]

    #[test]
    fn followers_move_as_if_held_by_constraint_forces(seed: u64, n in 2_usize..=10) {
        let mut rng = Rng::new(seed);
        let mut d = mechanism(&mut rng, n);
        let free = DynTree::new(&d, true).expect("valid");
        let followers = add_followers(&mut d, &mut rng, n);
        let tied = DynTree::new(&d, true).expect("valid");
        let own = n - followers.len();
        prop_assert_eq!((tied.joints(), tied.dim(), d.dof()), (own, 6 + own, own));
        let s = state(&mut rng, own);
        let all = full_state(&followers, &s, n);
        let tau = rng.list(6 + own, 5.0);
        // the drives of the independent joints
        let is_own = |joint: &usize| followers.iter().all(|f| f.joint != *joint);
        let mut drives = vec![0.0; 6 + n];
        drives[..6].copy_from_slice(&tau[..6]);
        for (at, joint) in (0..n).filter(is_own).enumerate() {
            drives[6 + joint] = tau[6 + at];
        }
        let expected = constrained(&free, &d, &followers, &all, &drives);
        let expected: Vec<f64> = (0..6).chain((0..n).filter(is_own).map(|joint| 6 + joint)).map(|row| expected[row]).collect();
        let found = tied.forward_dynamics(&s, &tau);
        let (m, c) = tied.mass_and_coriolis(&s);
        let m = m.to_rows();
        prop_assert!(motion_size(&m, &minus(&found, &expected)) < 1e-8 * motion_size(&m, &expected));

        // quantities that do not depend on the choice of coordinates
        prop_assert!((tied.kinetic_energy(&s) - free.kinetic_energy(&all)).abs() < 1e-12 * free.kinetic_energy(&all));
        let momentum: Vec<f64> = times(&m, &s.nu);
        let energy: f64 = momentum.iter().zip(&s.nu).map(|(p, v)| 0.5 * p * v).sum();
        prop_assert!((energy - tied.kinetic_energy(&s)).abs() < 1e-11 * energy);
        let (there, here) = (free.momentum(&all), tied.momentum(&s));
        prop_assert!((there.angular_b - here.angular_b).amax() < 1e-11 * (1.0 + there.angular_b.amax()));
        let (tip, of_free) = (tied.frame("tip").unwrap(), free.frame("tip").unwrap());
        prop_assert!((tied.placement_in_world(&s, tip).p - free.placement_in_world(&all, of_free).p).amax() < 1e-12 * (1.0 + s.p_nb.amax()));
        let (jacobian, rate) = tied.jacobian_and_rate(&s, tip);
        let (full, full_rate) = free.jacobian_and_rate(&all, of_free);
        for (reduced, full) in [(jacobian, full), (rate, full_rate)] {
            let (a, b) = (times(&reduced.to_rows(), &s.nu), times(&full.to_rows(), &all.nu));
            let size = b.iter().fold(1.0_f64, |size, x| size.max(x.abs()));
            prop_assert!(minus(&a, &b).iter().all(|x| x.abs() < 1e-11 * size));
        }
        // C ν is the bias, and inverse dynamics undoes forward dynamics
        let bias = tied.bias(&s);
        let size = bias.iter().fold(1.0_f64, |size, x| size.max(x.abs()));
        prop_assert!(minus(&times(&c.to_rows(), &s.nu), &bias).iter().all(|x| x.abs() < 1e-11 * size));
    }
}

const GRIPPER: &str = r#"<robot name="gripper">
  <link name="palm"><inertial><mass value="2"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
  <link name="left"><inertial><mass value="0.1"/><inertia ixx="1e-4" ixy="0" ixz="0" iyy="1e-4" iyz="0" izz="1e-4"/></inertial></link>
  <link name="right"><inertial><mass value="0.1"/><inertia ixx="1e-4" ixy="0" ixz="0" iyy="1e-4" iyz="0" izz="1e-4"/></inertial></link>
  <joint name="grip" type="prismatic"><parent link="palm"/><child link="left"/><axis xyz="0 1 0"/></joint>
  <joint name="grip_2" type="prismatic"><parent link="palm"/><child link="right"/><axis xyz="0 -1 0"/>
    <mimic joint="grip" multiplier="1" offset="0.01"/></joint>
</robot>"#;

#[test]
fn gripper_of_two_fingers_has_one_coordinate() {
    let d = Description::from_urdf(GRIPPER).expect("valid");
    let tree = DynTree::new(&d, true).expect("valid");
    let s = DynState {
        p_nb: nalgebra::Vector3::zeros(),
        quat_nb: multibody::Quaternion::IDENTITY,
        q: vec![0.02],
        nu: vec![0.0; 7],
    };
    // both fingers move, and symmetric fingers exert no net force on the palm
    let m = tree.mass_and_coriolis(&s).0;
    assert!((m[(6, 6)] - 0.2).abs() < 1e-15 && m[(4, 6)].abs() < 1e-15);
    let right = tree.placement_in_world(&s, tree.frame("right").unwrap());
    assert!((right.p.y + 0.03).abs() < 1e-15, "{}", right.p);
    let a = tree.forward_dynamics(&s, &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
    assert!((a[6] - 5.0).abs() < 1e-12, "{a:?}");
    // when one finger is frozen, the other stays at its follower position
    let mut frozen = d.clone();
    frozen.freeze("grip", 0.02).expect("it moves");
    assert_eq!(frozen.dof(), 0);
    let frozen = DynTree::new(&frozen, true).expect("valid");
    let still = DynState {
        q: vec![],
        nu: vec![0.0; 6],
        ..s
    };
    assert!((frozen.placement_in_world(&still, frozen.frame("right").unwrap()).p.y + 0.03).abs() < 1e-15);
    // the error of a tree of static size states the remedy
    let error = Tree::<1, 7>::new(&d).unwrap_err();
    assert!(
        matches!(&error, TreeError::Mimic { joint, .. } if joint == "grip_2"),
        "{error}"
    );
    assert_ne!(
        d.digest(),
        Description::from_urdf(&GRIPPER.replace("0.01", "0.02"))
            .unwrap()
            .digest()
    );
}

#[test]
fn mimic_of_missing_joint_or_itself_is_rejected() {
    let refused = |from: &str, to: &str| {
        Description::from_urdf(&GRIPPER.replace(from, to))
            .unwrap_err()
            .to_string()
    };
    let error = refused(r#"<mimic joint="grip""#, r#"<mimic joint="thumb""#);
    assert!(
        error.starts_with("line 6: ") && error.contains("`grip_2` mimics `thumb`, which is not there"),
        "{error}"
    );
    let error = refused(r#"<mimic joint="grip""#, r#"<mimic joint="grip_2""#);
    assert!(error.contains("follows it in turn"), "{error}");
    let error = refused(r#"name="grip" type="prismatic""#, r#"name="grip" type="fixed""#);
    assert!(error.contains("does not move"), "{error}");
    let error = refused(r#"multiplier="1""#, r#"multiplier="one""#);
    assert!(
        error.starts_with("line 7: ") && error.contains("multiplier=\"one\""),
        "{error}"
    );
}
