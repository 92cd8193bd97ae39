//! Dense real and complex matrices, and the handful of decompositions the rest of the crate needs.
//!
//! This is the only module that calls nalgebra. Everything runs on one thread, in the order that the code says, so a result has
//! the same bits on every processor.

mod complex_qr;
mod eigen;
mod exponential;
mod lu;
mod matrix;
mod product;
mod real_qr;
mod singular;
mod solve;

pub use eigen::{eigen, eigen_complex, eigenvalues, eigenvalues_complex, hermitian_eigen, symmetric_eigen};
pub use exponential::expm;
pub use matrix::{Dense, Scalar};
pub use singular::{norm2, reciprocal_condition, singular_values, svd};
pub use solve::{cholesky, factor, inverse, least_squares, solve, solve_complex, solve_lower};

/// A complex number, `re + j im`.
#[allow(non_camel_case_types)]
pub type c64 = num_complex::Complex64;
/// A dense real matrix; `m[(row, column)]`.
pub type Matrix = Dense<f64>;
/// A dense complex matrix; `m[(row, column)]`.
pub type CMatrix = Dense<c64>;

/// Errors of a dense matrix computation.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LinalgError {
    /// The given rows have different lengths.
    #[error("row {row} has {found} entries, the first row has {expected}")]
    Ragged {
        /// Index of the offending row.
        row: usize,
        /// Number of entries found there.
        found: usize,
        /// Number of entries of the first row.
        expected: usize,
    },
    /// An entry is a NaN or an infinity.
    #[error("entry ({row}, {column}) is {value}")]
    NotFinite {
        /// Row of the entry.
        row: usize,
        /// Column of the entry.
        column: usize,
        /// The value found.
        value: f64,
    },
    /// The eigenvalue or singular-value iteration did not converge.
    #[error("the {what} iteration of a {size} x {size} matrix did not converge")]
    NoConvergence {
        /// Which decomposition.
        what: &'static str,
        /// Dimension of the matrix.
        size: usize,
    },
    /// A matrix that must be inverted is singular to working precision.
    #[error("a {size} x {size} matrix is singular to working precision")]
    Singular {
        /// Dimension of the matrix.
        size: usize,
    },
    /// A matrix that must be positive definite is not.
    #[error("a {size} x {size} matrix is not positive definite (least eigenvalue {least:.6e})")]
    NotPositiveDefinite {
        /// Dimension of the matrix.
        size: usize,
        /// The least eigenvalue.
        least: f64,
    },
}

/// A matrix from its rows; an empty slice gives a 0 × 0 matrix.
pub fn from_rows(rows: &[Vec<f64>]) -> Result<Matrix, LinalgError> {
    let width = rows.first().map_or(0, Vec::len);
    for (row, entries) in rows.iter().enumerate() {
        if entries.len() != width {
            return Err(LinalgError::Ragged {
                row,
                found: entries.len(),
                expected: width,
            });
        }
    }
    let m = Matrix::from_fn(rows.len(), width, |i, j| rows[i][j]);
    check_finite(&m)?;
    Ok(m)
}

/// The rows of a matrix.
pub fn to_rows(m: &Matrix) -> Vec<Vec<f64>> {
    (0..m.nrows())
        .map(|i| (0..m.ncols()).map(|j| m[(i, j)]).collect())
        .collect()
}

/// Rejects NaN and infinity.
pub fn check_finite(m: &Matrix) -> Result<(), LinalgError> {
    for column in 0..m.ncols() {
        for row in 0..m.nrows() {
            let value = m[(row, column)];
            if !value.is_finite() {
                return Err(LinalgError::NotFinite { row, column, value });
            }
        }
    }
    Ok(())
}

/// A square matrix with `d` on its diagonal.
pub fn diagonal(d: &[f64]) -> Matrix {
    Matrix::from_fn(d.len(), d.len(), |i, j| if i == j { d[i] } else { 0.0 })
}

/// Places blocks on a grid; every row of blocks must have equal heights and every column equal widths.
///
/// # Panics
/// When the blocks do not fit: this is a programming error of the caller, never a matter of input.
pub fn blocks(grid: &[&[&Matrix]]) -> Matrix {
    let heights: Vec<usize> = grid.iter().map(|r| r[0].nrows()).collect();
    let widths: Vec<usize> = grid[0].iter().map(|m| m.ncols()).collect();
    let mut out = Matrix::zeros(heights.iter().sum(), widths.iter().sum());
    let mut row = 0;
    for (r, line) in grid.iter().enumerate() {
        let mut column = 0;
        for (c, block) in line.iter().enumerate() {
            assert!(
                block.nrows() == heights[r] && block.ncols() == widths[c],
                "blocks do not fit"
            );
            out.set_block(row, column, block);
            column += widths[c];
        }
        row += heights[r];
    }
    out
}

/// The complex matrix with the same entries.
pub fn to_complex(m: &Matrix) -> CMatrix {
    CMatrix::from_fn(m.nrows(), m.ncols(), |i, j| c64::new(m[(i, j)], 0.0))
}

/// Conjugate transpose.
pub fn adjoint(m: &CMatrix) -> CMatrix {
    CMatrix::from_fn(m.ncols(), m.nrows(), |i, j| m[(j, i)].conj())
}

/// `(m + mᵀ)/2`.
pub fn symmetric_part(m: &Matrix) -> Matrix {
    Matrix::from_fn(m.nrows(), m.ncols(), |i, j| 0.5 * (m[(i, j)] + m[(j, i)]))
}

/// The largest absolute entry; 0 for an empty matrix.
pub fn max_abs<T: Scalar>(m: &Dense<T>) -> f64 {
    m.0.iter().fold(0.0, |largest, entry| largest.max(entry.modulus()))
}

/// Symmetric square root of a symmetric positive definite matrix.
pub fn sqrt_spd(m: &Matrix) -> Result<Matrix, LinalgError> {
    let (w, v) = symmetric_eigen(m)?;
    let size = m.nrows();
    if let Some(&least) = w.first().filter(|&&least| least <= 0.0) {
        return Err(LinalgError::NotPositiveDefinite { size, least });
    }
    let root: Vec<f64> = w.iter().map(|x| x.sqrt()).collect();
    let scaled = Matrix::from_fn(size, size, |i, j| v[(i, j)] * root[j]);
    Ok(&scaled * v.transpose())
}
