//! Singular values.

use nalgebra::{Dyn, SVD};

use super::eigen::ITERATIONS_PER_ROW;
use super::error::LinalgError;
use super::matrix::{CMatrix, Dense, Matrix, Scalar};

/// Singular values of a complex matrix, largest first; a zero for an empty matrix.
pub fn singular_values(m: &CMatrix) -> Result<Vec<f64>, LinalgError> {
    if m.nrows() == 0 || m.ncols() == 0 {
        return Ok(vec![0.0]);
    }
    Ok(decompose(m, false)?.singular_values.iter().copied().collect())
}

/// The largest singular value of a real matrix; 0 for an empty one.
pub fn norm2(m: &Matrix) -> Result<f64, LinalgError> {
    if m.nrows() == 0 || m.ncols() == 0 {
        return Ok(0.0);
    }
    Ok(decompose(m, false)?.singular_values[0])
}

/// Thin singular value decomposition `m = U diag(s) Vᴴ`, largest first.
pub fn svd(m: &CMatrix) -> Result<(CMatrix, Vec<f64>, CMatrix), LinalgError> {
    let (rows, columns) = (m.nrows(), m.ncols());
    if rows == 0 || columns == 0 {
        return Ok((CMatrix::zeros(rows, 0), Vec::new(), CMatrix::zeros(columns, 0)));
    }
    let d = decompose(m, true)?;
    let (u, v) = (d.u.expect("requested"), d.v_t.expect("requested").adjoint());
    Ok((Dense(u), d.singular_values.iter().copied().collect(), Dense(v)))
}

/// Reciprocal condition number (2-norm) of a real square matrix; 1 for an empty one.
pub fn reciprocal_condition(a: &Matrix) -> Result<f64, LinalgError> {
    if a.nrows() == 0 {
        return Ok(1.0);
    }
    let s = decompose(a, false)?.singular_values;
    Ok(if s[0] > 0.0 { s[s.len() - 1] / s[0] } else { 0.0 })
}

/// Singular values, largest first, and on request the vectors, of a matrix that is not empty.
fn decompose<T: Scalar>(m: &Dense<T>, vectors: bool) -> Result<SVD<T, Dyn, Dyn>, LinalgError> {
    let size = m.nrows().max(m.ncols());
    let decomposed = m
        .is_finite()
        .then(|| SVD::try_new(m.0.clone(), vectors, vectors, f64::EPSILON, ITERATIONS_PER_ROW * size));
    decomposed.flatten().ok_or(LinalgError::NoConvergence {
        what: "singular-value",
        size,
    })
}
