//! Dense real and complex matrices, and the handful of decompositions the rest of the crate needs.
//!
//! This is the only module of the crate that calls nalgebra. Everything runs on one thread, in the order that the code says, so a result has
//! the same bits on every processor.

mod complex_qr;
mod construct;
mod deflation;
mod eigen;
mod error;
mod exponential;
mod lu;
mod matrix;
mod product;
mod real_qr;
mod singular;
mod solve;

pub use construct::{adjoint, blocks, check_finite, diagonal, from_rows, max_abs, symmetric_part, to_complex, to_rows};
pub use eigen::{eigen, eigen_complex, eigenvalues, eigenvalues_complex, hermitian_eigen, sqrt_spd, symmetric_eigen};
pub use error::LinalgError;
pub use exponential::expm;
pub use matrix::{CMatrix, Dense, Matrix, Scalar, c64};
pub use singular::{norm2, reciprocal_condition, singular_values, svd};
pub use solve::{cholesky, factor, inverse, least_squares, solve, solve_complex, solve_lower};
