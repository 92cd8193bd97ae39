//! Joints that a brake holds.

use interfaces::JOINTS;
use nalgebra::SMatrix;

use super::{Generalised, Servicer, Tree};

/// Changes the acceleration `nu_dot` so that the joints in `braked` do not accelerate: `nu_dot += M⁻¹ S λ`, with the
/// brakes' torques λ from `Sᵀ nu_dot = 0`.
pub fn hold_joints(tree: &Tree, state: &Servicer, braked: &[bool; JOINTS], nu_dot: &mut Generalised) {
    project(tree, state, braked, nu_dot);
}

/// Stops the joints in `braked` at once: an impulse at each that leaves the momentum of the whole as it was. Returns the
/// energy that goes, J.
pub fn stop_joints(tree: &Tree, state: &mut Servicer, braked: &[bool; JOINTS]) -> f64 {
    let mass = tree.mass_matrix(&state.q);
    let energy = |nu: &Generalised| 0.5 * nu.dot(&(mass * nu));
    let before = energy(&state.nu);
    let mut nu = state.nu;
    project(tree, state, braked, &mut nu);
    state.nu = nu;
    before - energy(&nu)
}

/// `x − M⁻¹ S (Sᵀ M⁻¹ S)⁻¹ Sᵀ x`, with exact zeros where `braked`.
fn project(tree: &Tree, state: &Servicer, braked: &[bool; JOINTS], x: &mut Generalised) {
    let Some(factor) = tree.mass_matrix(&state.q).cholesky() else {
        return; // only a state that is not finite gets here, and the output check says so
    };
    // unbraked joints get a unit diagonal and no force, which leaves them out of a system of fixed size
    let mut columns = SMatrix::<f64, { super::VELOCITIES }, JOINTS>::zeros();
    for joint in (0..JOINTS).filter(|&joint| braked[joint]) {
        let mut unit = Generalised::zeros();
        unit[6 + joint] = 1.0;
        columns.set_column(joint, &factor.solve(&unit));
    }
    let mut system = SMatrix::<f64, JOINTS, JOINTS>::identity();
    let mut wanted = nalgebra::SVector::<f64, JOINTS>::zeros();
    for row in (0..JOINTS).filter(|&joint| braked[joint]) {
        for column in (0..JOINTS).filter(|&joint| braked[joint]) {
            system[(row, column)] = columns[(6 + row, column)];
        }
        wanted[row] = -x[6 + row];
    }
    let Some(factor) = system.cholesky() else {
        return;
    };
    *x += columns * factor.solve(&wanted);
    for joint in (0..JOINTS).filter(|&joint| braked[joint]) {
        x[6 + joint] = 0.0;
    }
}
