//! Vectors and matrices of the degrees of freedom.

use nalgebra::{SMatrix, SVector};

/// Degrees of freedom of the servicer without its propellant.
pub const DOF: usize = 13;
/// Joints of the arm.
pub const JOINTS: usize = 7;

/// Generalised velocity, acceleration or force.
pub type Dof = SVector<f64, DOF>;
/// Twist of the end effector, `[w; v]` in end-effector axes.
pub type Twist = SVector<f64, 6>;
/// Body Jacobian of the end effector: generalised velocity to [`Twist`].
pub type Jacobian = SMatrix<f64, 6, DOF>;
/// Matrix between generalised vectors.
pub type Matrix13 = SMatrix<f64, DOF, DOF>;
