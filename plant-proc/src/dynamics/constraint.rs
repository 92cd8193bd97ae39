//! Constraint forces of joint brakes.

use interfaces::JOINTS;
use nalgebra::SMatrix;

use super::{Generalised, Model, Motion, VELOCITIES};

/// A mass matrix.
type MassMatrix = SMatrix<f64, VELOCITIES, VELOCITIES>;

/// Changes the acceleration `nu_dot` so that the joints in `braked` do not accelerate: `nu_dot += M⁻¹ S λ`, with the
/// brakes' torques λ from `Sᵀ nu_dot = 0`.
pub fn hold_joints(mass: &MassMatrix, braked: &[bool; JOINTS], nu_dot: &mut Generalised) {
    project(mass, braked, nu_dot);
}

/// Stops the joints in `braked` instantly by an impulse at each, which conserves the total momentum. Returns the energy
/// lost, J.
pub fn stop_joints(model: &Model, motion: &mut Motion, braked: &[bool; JOINTS]) -> f64 {
    let mass = model.mass_matrix(motion);
    let energy = |nu: &Generalised| 0.5 * nu.dot(&(mass * nu));
    let mut nu = model.velocities(motion);
    let before = energy(&nu);
    project(&mass, braked, &mut nu);
    model.set_velocities(motion, &nu);
    before - energy(&nu)
}

/// `x − M⁻¹ S (Sᵀ M⁻¹ S)⁻¹ Sᵀ x`, with exact zeros where `braked`.
fn project(mass: &MassMatrix, braked: &[bool; JOINTS], x: &mut Generalised) {
    let Some(factor) = mass.cholesky() else {
        return; // only a state that is not finite gets here, and the output check says so
    };
    // unbraked joints get a unit diagonal and no force, which removes them from the fixed-size system
    let mut columns = SMatrix::<f64, VELOCITIES, JOINTS>::zeros();
    for joint in (0..JOINTS).filter(|&joint| braked[joint]) {
        let mut unit = Generalised::zeros();
        unit[6 + joint] = 1.0;
        columns.set_column(joint, &factor.solve(&unit));
    }
    let mut system = SMatrix::<f64, JOINTS, JOINTS>::identity();
    let mut rhs = nalgebra::SVector::<f64, JOINTS>::zeros();
    for row in (0..JOINTS).filter(|&joint| braked[joint]) {
        for column in (0..JOINTS).filter(|&joint| braked[joint]) {
            system[(row, column)] = columns[(6 + row, column)];
        }
        rhs[row] = -x[6 + row];
    }
    let Some(factor) = system.cholesky() else {
        return;
    };
    *x += columns * factor.solve(&rhs);
    for joint in (0..JOINTS).filter(|&joint| braked[joint]) {
        x[6 + joint] = 0.0;
    }
}
