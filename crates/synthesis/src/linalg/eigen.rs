//! Eigenvalues and eigenvectors.

use nalgebra::{DMatrix, SymmetricEigen};

use super::complex_qr::{self, Schur};
use super::construct::{check_finite, to_complex};
use super::error::LinalgError;
use super::matrix::{CMatrix, Dense, Matrix, Scalar, c64};
use super::real_qr;

/// Most iterations of a decomposition for each row of its matrix; three are usual.
pub(super) const ITERATIONS_PER_ROW: usize = 60;

/// Eigenvalues of a real square matrix. Balance it first when its entries differ by orders of magnitude.
pub fn eigenvalues(m: &Matrix) -> Result<Vec<c64>, LinalgError> {
    check_finite(m)?;
    real_qr::eigenvalues(m.0.clone()).ok_or_else(|| no_convergence(m.nrows()))
}

/// Eigenvalues of a complex square matrix.
pub fn eigenvalues_complex(m: &CMatrix) -> Result<Vec<c64>, LinalgError> {
    Ok(schur(m, false)?.t.diagonal().iter().copied().collect())
}

/// Right eigenvectors (columns, of length one) and eigenvalues of a real square matrix.
pub fn eigen(m: &Matrix) -> Result<(Vec<c64>, CMatrix), LinalgError> {
    check_finite(m)?;
    eigen_complex(&to_complex(m))
}

/// Right eigenvectors (columns, of length one) and eigenvalues of a complex square matrix.
pub fn eigen_complex(m: &CMatrix) -> Result<(Vec<c64>, CMatrix), LinalgError> {
    Ok(eigenvectors(schur(m, true)?))
}

fn schur(m: &CMatrix, vectors: bool) -> Result<Schur, LinalgError> {
    let form = m.is_finite().then(|| complex_qr::schur(m.0.clone(), vectors));
    form.flatten().ok_or_else(|| no_convergence(m.nrows()))
}

fn no_convergence(size: usize) -> LinalgError {
    LinalgError::NoConvergence {
        what: "eigenvalue",
        size,
    }
}

/// The eigenvalues and eigenvectors of a matrix, by back substitution in its triangular factor.
fn eigenvectors(Schur { q, t }: Schur) -> (Vec<c64>, CMatrix) {
    let n = t.nrows();
    let size = t.iter().fold(0.0f64, |largest, x| largest.max(x.norm()));
    // A repeated eigenvalue counts as two that rounding error has separated.
    let smallest = (f64::EPSILON * size).max(f64::MIN_POSITIVE);
    let mut y = DMatrix::<c64>::identity(n, n);
    for k in 0..n {
        for i in (0..k).rev() {
            let sum: c64 = (i + 1..=k).map(|j| t[(i, j)] * y[(j, k)]).sum();
            let mut gap = t[(i, i)] - t[(k, k)];
            if gap.norm() < smallest {
                gap = c64::new(smallest, 0.0);
            }
            y[(i, k)] = -sum / gap;
            // The vector of a defective matrix grows without bound.
            if y[(i, k)].norm() > 1e100 {
                y.column_mut(k).unscale_mut(1e100);
            }
        }
        let length = y.column(k).norm();
        y.column_mut(k).unscale_mut(length);
    }
    (t.diagonal().iter().copied().collect(), Dense(q) * Dense(y))
}

/// Eigenvalues (ascending) and orthonormal eigenvectors of a real symmetric matrix; only the lower triangle is read.
pub fn symmetric_eigen(m: &Matrix) -> Result<(Vec<f64>, Matrix), LinalgError> {
    check_finite(m)?;
    hermitian(m)
}

/// Eigenvalues (ascending) and orthonormal eigenvectors of a Hermitian matrix; only the lower triangle is read.
pub fn hermitian_eigen(m: &CMatrix) -> Result<(Vec<f64>, CMatrix), LinalgError> {
    hermitian(m)
}

fn hermitian<T: Scalar>(m: &Dense<T>) -> Result<(Vec<f64>, Dense<T>), LinalgError> {
    let size = m.nrows();
    if size == 0 {
        return Ok((Vec::new(), Dense::zeros(0, 0)));
    }
    let decomposed = m
        .is_finite()
        .then(|| SymmetricEigen::try_new(m.0.clone(), f64::EPSILON, ITERATIONS_PER_ROW * size));
    let e = decomposed.flatten().ok_or_else(|| no_convergence(size))?;
    let mut order: Vec<usize> = (0..size).collect();
    order.sort_by(|&i, &j| e.eigenvalues[i].total_cmp(&e.eigenvalues[j]));
    let values = order.iter().map(|&i| e.eigenvalues[i]).collect();
    let vectors = Dense::from_fn(size, size, |i, j| e.eigenvectors[(i, order[j])]);
    Ok((values, vectors))
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
