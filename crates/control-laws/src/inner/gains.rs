//! Gains of the inner loop.

use crate::{Dof, Matrix13, ParameterError};

/// `K_P` and `K_I`: from the velocity error to a force, and from its integral.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gains {
    kp: Matrix13,
    ki: Matrix13,
    diagonal: bool,
}

impl Gains {
    /// Diagonal gains: `kp` in N m s/rad and N s/m, `ki` in N m/rad and N/m, order of the generalised velocity.
    pub fn diagonal(kp: &Dof, ki: &Dof) -> Self {
        Self {
            kp: Matrix13::from_diagonal(kp),
            ki: Matrix13::from_diagonal(ki),
            diagonal: true,
        }
    }

    /// Full gain matrices, same units. Matrices that happen to be diagonal are treated as such.
    pub fn full(kp: Matrix13, ki: Matrix13) -> Self {
        let is_diagonal = |matrix: &Matrix13| (0..13).all(|i| (0..13).all(|j| i == j || matrix[(i, j)] == 0.0));
        Self {
            kp,
            ki,
            diagonal: is_diagonal(&kp) && is_diagonal(&ki),
        }
    }

    /// `K_P`.
    pub fn kp(&self) -> &Matrix13 {
        &self.kp
    }

    /// `K_I`.
    pub fn ki(&self) -> &Matrix13 {
        &self.ki
    }

    /// Whether every channel is on its own.
    pub fn is_diagonal(&self) -> bool {
        self.diagonal
    }

    pub(super) fn validated(&self) -> Result<(), ParameterError> {
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
        if (self.kp + self.kp.transpose()).cholesky().is_none() {
            let remedy = "must be positive definite (with diagonal gains: every gain above zero)";
            return Err(ParameterError::new("inner.kp", self.kp.diagonal().as_slice(), remedy));
        }
        // a shift far below any gain of use: a channel without integral action is allowed, a negative one is not
        let shift = Matrix13::identity() * (1e-12 * self.kp.diagonal().amax());
        if (self.ki + self.ki.transpose() + shift).cholesky().is_none() {
            let remedy = "must be positive semidefinite (with diagonal gains: no gain below zero)";
            return Err(ParameterError::new("inner.ki", self.ki.diagonal().as_slice(), remedy));
        }
        Ok(())
    }
}
