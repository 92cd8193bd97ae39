//! Matrices from rows, blocks and other matrices, and their entries.

use super::error::LinalgError;
use super::matrix::{CMatrix, Dense, Matrix, Scalar, c64};

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
