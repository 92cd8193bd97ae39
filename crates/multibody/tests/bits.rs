//! Bit-identical results in all evaluation modes: four or eight lanes, one state, a tree of static or of dynamic size.

mod common;

use common::random::{Rng, mechanism, state};
use common::{load_reference, servicer};
use multibody::{
    Description, DynState, DynTree, F64x4, ForLanes, Lanes, Method, State, Tree, Trees, lanes_max, rk4, with_lanes,
};
use nalgebra::SVector;

/// A check in lanes of each number that this processor has.
fn in_each_number_of_lanes<C: ForLanes + Copy>(check: C) {
    for lanes in [4, 8] {
        if lanes <= lanes_max() {
            with_lanes(lanes, check);
        }
    }
}

fn lanes<const K: usize, T: Lanes>(columns: &[SVector<f64, K>]) -> [T; K] {
    std::array::from_fn(|i| T::gather(|lane| columns[lane][i]))
}

#[derive(Clone, Copy)]
struct OneTree;

impl ForLanes for OneTree {
    type Output = ();

    fn run<T: Lanes>(self) {
        let mut rng = Rng::new(3);
        for _ in 0..500 {
            let tree = Tree::<7, 13>::new(&mechanism(&mut rng, 7)).expect("valid");
            let mut vectors =
                |n: usize, bound: f64| -> Vec<Vec<f64>> { (0..T::WIDTH).map(|_| rng.list(n, bound)).collect() };
            let q: Vec<SVector<f64, 7>> = vectors(7, 4.0).iter().map(|x| SVector::from_column_slice(x)).collect();
            let nu: Vec<SVector<f64, 13>> = vectors(13, 2.0).iter().map(|x| SVector::from_column_slice(x)).collect();
            let tau: Vec<SVector<f64, 13>> = vectors(13, 5.0).iter().map(|x| SVector::from_column_slice(x)).collect();
            let (q_all, nu_all, tau_all) = (lanes::<7, T>(&q), lanes::<13, T>(&nu), lanes::<13, T>(&tau));
            let acc = tree.aba_in_lanes(&q_all, &nu_all, &tau_all);
            let force = tree.rnea_in(&q_all, &nu_all, &acc);
            let mass = tree.mass_matrix_in(&q_all);
            for lane in 0..T::WIDTH {
                let one = tree.aba(&q[lane], &nu[lane], &tau[lane]);
                let back = tree.rnea(&q[lane], &nu[lane], &one);
                let m = tree.mass_matrix(&q[lane]);
                let same = |a: T, b: f64, what: &str| {
                    assert_eq!(
                        a.lane(lane).to_bits(),
                        b.to_bits(),
                        "{what}, lane {lane} of {}",
                        T::WIDTH
                    );
                };
                for i in 0..13 {
                    same(acc[i], one[i], "aba");
                    same(force[i], back[i], "rnea");
                    for j in 0..13 {
                        same(mass[j][i], m[(i, j)], "mass");
                    }
                }
            }
        }
    }
}

#[test]
fn each_lane_has_the_bits_of_the_scalar() {
    in_each_number_of_lanes(OneTree);
}

#[test]
fn static_and_dynamic_trees_have_the_same_bits() {
    let mut rng = Rng::new(5);
    for _ in 0..300 {
        let d = mechanism(&mut rng, 4);
        let s = state(&mut rng, 4);
        let (fixed, any) = (
            Tree::<4, 10>::new(&d).expect("valid"),
            DynTree::new(&d, true).expect("valid"),
        );
        let (q, nu) = (
            SVector::from_column_slice(&s.q),
            SVector::<f64, 10>::from_column_slice(&s.nu),
        );
        let tau = rng.list(10, 3.0);
        let same =
            |a: &[f64], b: &[f64]| assert!(a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits()), "{a:?} {b:?}");
        same(
            fixed.aba(&q, &nu, &SVector::from_column_slice(&tau)).as_slice(),
            &any.forward_dynamics(&s, &tau),
        );
        same(fixed.bias(&q, &nu).as_slice(), &any.bias(&s));
        let k = fixed.kinematics(&q, &nu);
        let ((m, c), (m2, c2)) = (fixed.mass_and_coriolis(&k), any.mass_and_coriolis(&s));
        let (f, f2) = (fixed.frame("tip").expect("there"), any.frame("tip").expect("there"));
        let (j, (j2, jd2)) = (fixed.jacobian(&k, f), any.jacobian_and_rate(&s, f2));
        let jd = fixed.jacobian_rate(&k, f);
        for r in 0..10 {
            for col in 0..10 {
                assert!(m[(r, col)] == m2[(r, col)] && c[(r, col)] == c2[(r, col)]);
                assert!(r > 5 || j[(r, col)] == j2[(r, col)] && jd[(r, col)] == jd2[(r, col)]);
            }
        }
    }
}

/// The bits themselves, to detect a machine, a compiler or a build without FMA that gives different ones: 100 steps of
/// the stock servicer, hashed.
#[test]
fn short_motion_has_the_recorded_bits() {
    let tree = Tree::<9, 15>::new(&servicer()).expect("valid");
    let reference = &load_reference()[3];
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    for method in [Method::Rk4, Method::Rkmk4, Method::Dop853] {
        let mut state: State<9, 15> = reference.state;
        for _ in 0..100 {
            state = tree.step(method, &state, &reference.tau, 1e-3);
        }
        let numbers = state.p_nb.iter().chain(state.q.iter()).chain(state.nu.iter()).copied();
        for x in numbers.chain(state.quat_nb.to_wxyz()) {
            for byte in x.to_bits().to_le_bytes() {
                hash = (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3);
            }
        }
    }
    assert_eq!(hash, 0x7170_2202_fb59_732c, "{hash:#x}");
}

#[test]
fn a_dynamic_tree_without_joints_is_a_rigid_body() {
    let mut rng = Rng::new(9);
    let body = common::random::inertia(&mut rng);
    let d = multibody::Description::rigid_body("target", body).expect("valid");
    let tree = DynTree::new(&d, true).expect("valid");
    let s = DynState {
        q: vec![],
        ..state(&mut rng, 0)
    };
    let acc = tree.forward_dynamics(&s, &[0.0; 6]);
    let h = tree.bias(&s);
    let back = tree.rnea(&s, &acc);
    assert!(h.iter().any(|x| *x != 0.0) && back.iter().all(|x| x.abs() < 1e-12));
}

/// The same mechanism with other masses, lengths and dampers.
fn changed(description: &Description, rng: &mut Rng) -> Description {
    let mut out = description.clone();
    let mut factor = || 1.0 + 0.3 * rng.list(1, 1.0)[0];
    for inertia in out.links.iter_mut().filter_map(|link| link.inertia.as_mut()) {
        let by = factor();
        inertia.mass *= by;
        inertia.about_com *= by;
        inertia.com *= factor();
    }
    for joint in &mut out.joints {
        joint.origin.p *= factor();
        joint.damping *= factor();
    }
    out
}

/// Trees of one shape in lanes, each compared with itself alone: a step, and the quantities computed from a state.
fn trees_in_lanes<T: Lanes>(seed: u64) {
    let mut rng = Rng::new(seed);
    let shape = servicer();
    for round in 0..200 {
        let there = 1 + round % T::WIDTH;
        let trees: Vec<Tree<9, 15>> = (0..there)
            .map(|_| Tree::new(&changed(&shape, &mut rng)).expect("valid"))
            .collect();
        let states: Vec<State<9, 15>> = (0..there)
            .map(|_| {
                let s = state(&mut rng, 9);
                State {
                    p_nb: s.p_nb,
                    quat_nb: s.quat_nb,
                    q: SVector::from_column_slice(&s.q),
                    nu: SVector::from_column_slice(&s.nu),
                }
            })
            .collect();
        let force: Vec<SVector<f64, 15>> = (0..there)
            .map(|_| SVector::from_column_slice(&rng.list(15, 5.0)))
            .collect();
        let batched = Trees::<9, 15, T>::new(&trees.iter().collect::<Vec<_>>()).expect("one shape");
        let s = State::gather(&states.iter().collect::<Vec<_>>());
        let tau = SVector::from_fn(|i, _| T::gather(|lane| force[lane.min(there - 1)][i]));
        let moved = rk4(&batched, &s, &tau, 1e-3);
        let k = batched.kinematics(&s);
        let frame = trees[0].frame("end_effector").expect("the model has it");
        let (jacobian, (p, _)) = (batched.jacobian(&k, frame), batched.placement(&k, frame));
        let (momentum, energy) = batched.momentum_and_energy(&k);
        for lane in 0..there {
            let (tree, own) = (&trees[lane], &states[lane]);
            let alone = rk4(tree, own, &force[lane], 1e-3);
            let all = |s: &State<9, 15>| {
                let pose = s.p_nb.iter().copied().chain(s.quat_nb.to_wxyz());
                pose.chain(s.q.iter().chain(s.nu.iter()).copied())
                    .map(f64::to_bits)
                    .collect::<Vec<_>>()
            };
            assert_eq!(all(&moved.lane(lane)), all(&alone), "round {round}, lane {lane}");
            let k = tree.kinematics(&own.q, &own.nu);
            let same = |a: T, b: f64, what: &str| {
                assert_eq!(
                    a.lane(lane).to_bits(),
                    b.to_bits(),
                    "{what}, round {round}, lane {lane}"
                );
            };
            for (a, b) in jacobian.iter().zip(tree.jacobian(&k, frame).iter()) {
                same(*a, *b, "jacobian");
            }
            for (a, b) in p.iter().zip(tree.placement(&k, frame).p.iter()) {
                same(*a, *b, "placement");
            }
            let (m, e) = tree.momentum_and_energy(&k);
            assert_eq!((m, e), (tree.momentum(&k), tree.kinetic_energy(&k)));
            same(energy, e, "energy");
            for (a, b) in momentum.angular_b.iter().zip(m.angular_b.iter()) {
                same(*a, *b, "momentum");
            }
            same(batched.damper_power(&s.nu), tree.damper_power(&own.nu), "power");
        }
    }
}

#[test]
fn batched_trees_have_the_bits_of_single_trees() {
    #[derive(Clone, Copy)]
    struct SeveralTrees;

    impl ForLanes for SeveralTrees {
        type Output = ();

        fn run<T: Lanes>(self) {
            trees_in_lanes::<T>(11);
        }
    }

    in_each_number_of_lanes(SeveralTrees);
}

#[test]
fn trees_of_different_shapes_cannot_be_batched() {
    let mut rng = Rng::new(17);
    let one = Tree::<4, 10>::new(&mechanism(&mut rng, 4)).expect("valid");
    let (mut same, mut other) = (0, 0);
    for _ in 0..50 {
        let next = Tree::<4, 10>::new(&mechanism(&mut rng, 4)).expect("valid");
        match Trees::<4, 10, F64x4>::new(&[&one, &next]) {
            Some(_) => same += 1,
            None => other += 1,
        }
    }
    assert!(other > 20, "{same} {other}");
    let heavy = one.clone().with_gravity(nalgebra::Vector3::z());
    assert!(Trees::<4, 10, F64x4>::new(&[&one, &heavy]).is_none(), "gravity");
    assert!(Trees::<4, 10, F64x4>::new(&[]).is_none());
    assert!(
        Trees::<4, 10, F64x4>::new(&[&one; 5]).is_none(),
        "more than there are lanes"
    );
}
