//! Gains of the inner loop.

use crate::{Dof, Matrix13, ParameterError};
use nalgebra::SymmetricEigen;

/// `K_P` and `K_I`: from the velocity error and from its integral to a force.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gains {
    kp: Matrix13,
    ki: Matrix13,
    form: GainForm,
}

/// Kind of the matrices.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum GainForm {
    /// Both constant and diagonal.
    Diagonal,
    /// Constant.
    Full,
    /// `kp` is X of `K_P(q) = M(q)^½ X M(q)^½`.
    Scheduled,
}

/// Rounds of the eigenvalue iteration, which needs two or three for each of the 13 eigenvalues.
const EIGEN_ROUNDS_MAX: usize = 1000;

impl Gains {
    /// Diagonal gains: `kp` in N m s/rad and N s/m, `ki` in N m/rad and N/m, order of the generalised velocity.
    pub fn diagonal(kp: &Dof, ki: &Dof) -> Self {
        Self {
            kp: Matrix13::from_diagonal(kp),
            ki: Matrix13::from_diagonal(ki),
            form: GainForm::Diagonal,
        }
    }

    /// `K_P(q) = M(q)^½ X M(q)^½` with constant symmetric X (1/s), and constant diagonal `ki`: the proportional part follows the
    /// configuration, and the Lyapunov argument of the conditional integrator still holds, because it requires only `K_P > 0` and
    /// a constant `K_I`.
    pub fn scheduled(x: Matrix13, ki: &Dof) -> Self {
        Self {
            kp: x,
            ki: Matrix13::from_diagonal(ki),
            form: GainForm::Scheduled,
        }
    }

    /// Full gain matrices, same units. Matrices that happen to be diagonal are treated as such.
    pub fn full(kp: Matrix13, ki: Matrix13) -> Self {
        Self {
            kp,
            ki,
            form: if is_diagonal(&kp) && is_diagonal(&ki) {
                GainForm::Diagonal
            } else {
                GainForm::Full
            },
        }
    }

    /// `K_P`; X for scheduled gains.
    pub fn kp(&self) -> &Matrix13 {
        &self.kp
    }

    /// `K_I`.
    pub fn ki(&self) -> &Matrix13 {
        &self.ki
    }

    /// Whether the channels are decoupled.
    pub fn is_diagonal(&self) -> bool {
        self.form == GainForm::Diagonal
    }

    /// Whether the channels of the integral part are decoupled.
    pub(super) fn has_diagonal_ki(&self) -> bool {
        is_diagonal(&self.ki)
    }

    /// Whether `K_P` follows the mass matrix.
    pub fn is_scheduled(&self) -> bool {
        self.form == GainForm::Scheduled
    }

    /// `M^½ X M^½` for scheduled gains; NaN for an invalid mass matrix, which the result then shows.
    pub(super) fn kp_at(&self, mass: &Matrix13) -> Matrix13 {
        let Some(eigen) = SymmetricEigen::try_new(*mass, f64::EPSILON, EIGEN_ROUNDS_MAX) else {
            return Matrix13::repeat(f64::NAN);
        };
        let mut half = eigen.eigenvectors;
        for (mut column, value) in half.column_iter_mut().zip(eigen.eigenvalues.iter()) {
            column *= libm::sqrt(*value);
        }
        let root = half * eigen.eigenvectors.transpose();
        root * self.kp * root
    }

    pub(super) fn validate(&self) -> Result<(), ParameterError> {
        for (field, matrix) in [("inner.kp", &self.kp), ("inner.ki", &self.ki)] {
            if !matrix.iter().all(|value| value.is_finite()) {
                let channel = matrix.iter().position(|value| !value.is_finite()).unwrap_or(0) % 13;
                return Err(ParameterError::new(
                    field,
                    matrix.row(channel),
                    "every gain must be finite",
                ));
            }
        }
        let asymmetry = (self.kp - self.kp.transpose()).amax();
        if self.is_scheduled() && asymmetry > 1e-9 * self.kp.amax() {
            let remedy = "X must be symmetric";
            return Err(ParameterError::new("inner.kp", self.kp.diagonal().as_slice(), remedy));
        }
        if (self.kp + self.kp.transpose()).cholesky().is_none() {
            let remedy = "must be positive definite (with diagonal gains: every gain above zero)";
            return Err(ParameterError::new("inner.kp", self.kp.diagonal().as_slice(), remedy));
        }
        // a shift far below any useful gain: a channel without integral action is allowed, a negative one is not
        let shift = Matrix13::identity() * (1e-12 * self.kp.diagonal().amax());
        if (self.ki + self.ki.transpose() + shift).cholesky().is_none() {
            let remedy = "must be positive semidefinite (with diagonal gains: no gain below zero)";
            return Err(ParameterError::new("inner.ki", self.ki.diagonal().as_slice(), remedy));
        }
        Ok(())
    }
}

fn is_diagonal(matrix: &Matrix13) -> bool {
    (0..13).all(|i| (0..13).all(|j| i == j || matrix[(i, j)] == 0.0))
}
