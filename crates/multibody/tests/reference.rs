//! The baseline servicer against 50-digit arithmetic and Pinocchio (`data/dynamics-reference.json`; provenance of the
//! numbers in `data/README.md`). Every tolerance is the project's acceptance limit, in scale-free metrics.

mod common;

use common::{Reference, load_reference, m_inv_norm, m_norm, servicer};
use multibody::{Description, Tree};
use nalgebra::{SMatrix, SVector};

type M15 = SMatrix<f64, 15, 15>;

struct WorstErrors(Vec<(&'static str, f64, f64)>);

impl WorstErrors {
    fn record(&mut self, what: &'static str, error: f64, limit: f64) {
        match self.0.iter_mut().find(|w| w.0 == what) {
            Some(w) => w.1 = if error.is_nan() { error } else { w.1.max(error) },
            None => self.0.push((what, error, limit)),
        }
    }
}

impl Drop for WorstErrors {
    fn drop(&mut self) {
        for (what, error, limit) in &self.0 {
            println!("{what:<24} {error:9.2e}   limit {limit:.0e}");
        }
        if !std::thread::panicking() {
            for (what, error, limit) in &self.0 {
                assert!(error <= limit, "{what}: {error:e} is beyond {limit:e}");
            }
        }
    }
}

#[test]
fn every_quantity_of_the_reference_states() {
    let tree = Servicer::new(&servicer()).unwrap();
    let mut worst = WorstErrors(Vec::new());
    for one in load_reference() {
        dynamics(&tree, &one, &mut worst);
        end_effector(&tree, &one, &mut worst);
        momenta(&tree, &one, &mut worst);
    }
}

type Servicer = Tree<9, 15>;

fn dynamics(tree: &Servicer, one: &Reference, worst: &mut WorstErrors) {
    let Reference {
        state,
        tau,
        mass,
        bias,
        acceleration,
        ..
    } = one;
    let k = tree.kinematics(&state.q, &state.nu);
    let (m, c) = tree.mass_and_coriolis(&k);
    for i in 0..15 {
        for l in 0..15 {
            let scale = (mass[(i, i)] * mass[(l, l)]).sqrt();
            worst.record("mass matrix", (m[(i, l)] - mass[(i, l)]).abs() / scale, 1e-13);
        }
    }
    assert_eq!(m, tree.mass_matrix(&state.q));
    let size = m_inv_norm(mass, bias);
    let relative = |error: SVector<f64, 15>| {
        if size > 0.0 {
            m_inv_norm(mass, &error) / size
        } else {
            error.norm()
        }
    };
    worst.record("bias", relative(tree.bias(&state.q, &state.nu) - bias), 1e-12);
    worst.record("C nu", relative(c * state.nu - bias), 1e-12);
    worst.record(
        "one pass",
        relative(tree.mass_coriolis_product(&state.q, &state.nu, &SVector::zeros(), &state.nu) - bias),
        1e-12,
    );
    let acc = tree.aba(&state.q, &state.nu, tau);
    worst.record(
        "acceleration",
        m_norm(mass, &(acc - acceleration)) / m_norm(mass, acceleration),
        1e-11,
    );
    let back = tree.rnea(&state.q, &state.nu, &acc) - tree.passive_force(&state.q, &state.nu);
    worst.record(
        "rnea of acceleration",
        m_inv_norm(mass, &(back - tau)) / m_inv_norm(mass, tau),
        1e-11,
    );
}

fn end_effector(tree: &Servicer, one: &Reference, worst: &mut WorstErrors) {
    let Reference {
        state, p, r, j, j_rate, ..
    } = one;
    let frame = tree.frame("end_effector").unwrap();
    let k = tree.kinematics(&state.q, &state.nu);
    let at = tree.placement_in_world(state, frame);
    worst.record("pose: position", (at.p - p).norm() / p.norm(), 1e-13);
    worst.record("pose: rotation", (at.r - r).amax(), 1e-13);
    worst.record("jacobian", (tree.jacobian(&k, frame) - j).amax() / j.amax(), 1e-13);
    let scale = j_rate.amax().max(f64::MIN_POSITIVE);
    worst.record(
        "jacobian rate",
        (tree.jacobian_rate(&k, frame) - j_rate).amax() / scale,
        1e-12,
    );
}

fn momenta(tree: &Servicer, one: &Reference, worst: &mut WorstErrors) {
    let Reference {
        state,
        mass,
        energy,
        linear,
        angular,
        com,
        ..
    } = one;
    let k = tree.kinematics(&state.q, &state.nu);
    let momentum = tree.momentum(&k);
    let (l, h) = (
        state.quat_nb.rotate(&momentum.linear_b),
        state.quat_nb.rotate(&momentum.angular_b),
    );
    worst.record("linear momentum", (l - linear).norm() / linear.norm().max(1e-30), 1e-13);
    worst.record(
        "angular momentum",
        (h - angular).norm() / angular.norm().max(1e-30),
        1e-13,
    );
    worst.record(
        "centre of mass",
        (tree.com_in_world(state) - com).norm() / com.norm(),
        1e-13,
    );
    worst.record(
        "kinetic energy",
        (tree.kinetic_energy(&k) - energy).abs() / energy.max(1e-30),
        1e-13,
    );
    let half: M15 = *mass * 0.5;
    worst.record(
        "1/2 nu M nu",
        ((state.nu.transpose() * half * state.nu)[0] - tree.kinetic_energy(&k)).abs() / energy.max(1e-30),
        1e-13,
    );
}

#[test]
fn total_mass_is_the_published_one() {
    let d: Description = servicer();
    assert!((d.total_mass() - 450.2).abs() < 1e-9, "{}", d.total_mass());
}
