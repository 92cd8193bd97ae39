//! Heap allocation: no algorithm allocates once a tree is built.

mod common;

use multibody::{F64x4, Method, SloshState, SloshTree, SphericalSlosh, State, Tree, rk4};
use nalgebra::{SVector, Vector3};
use testing::allocation::{Counting, allocations_during};

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn no_algorithm_allocates() {
    let tree = Tree::<9, 15>::new(&common::servicer()).expect("valid");
    let mut rest = common::servicer();
    rest.remove_branch("slosh_gimbal").expect("it exists");
    let slosh = SphericalSlosh {
        hinge: Vector3::new(0.0, 0.0, -0.15),
        mass: 10.61,
        length: 0.1317,
        inertia: 0.002,
        damping: 0.0131,
        stiffness: 0.0,
        rest: -Vector3::z(),
    };
    let sloshing = SloshTree::<7, 13>::new(Tree::new(&rest).expect("valid"), slosh).expect("valid");
    let frame = tree.frame("end_effector").expect("there");
    let mut state = common::load_reference()[3].state;
    let tau = SVector::repeat(0.1);

    let allocations = allocations_during(|| {
        for method in [Method::Rk4, Method::Rkmk4, Method::Dop853] {
            state = tree.step(method, &state, &tau, 1e-3);
        }
        let k = tree.kinematics(&state.q, &state.nu);
        let (m, c) = tree.mass_and_coriolis(&k);
        let force = tree.rnea(&state.q, &state.nu, &tree.aba(&state.q, &state.nu, &tau));
        let product = tree.mass_coriolis_product(&state.q, &state.nu, &force, &tau);
        let j = tree.jacobian(&k, frame) + tree.jacobian_rate(&k, frame);
        let lanes = tree.aba_in_lanes(
            &state.q.data.0[0].map(|x| F64x4::new([x; 4])),
            &state.nu.data.0[0].map(|x| F64x4::new([x; 4])),
            &tau.data.0[0].map(|x| F64x4::new([x; 4])),
        );
        let energy = tree.kinetic_energy(&k) + tree.potential_energy(&state) + tree.momentum(&k).mass;
        let start = SloshState {
            tree: State::rest(),
            d: -Vector3::z(),
            w: Vector3::x() * 0.1,
        };
        let slosh = rk4(&sloshing, &start, &SVector::repeat(0.1), 1e-3);
        std::hint::black_box((m, c, product, j, lanes, energy, slosh));
    });
    assert_eq!(allocations.count, 0);
}
