//! Linear systems, by factorisation.

use nalgebra::DMatrix;

use super::construct::check_finite;
use super::eigen::symmetric_eigen;
use super::error::LinalgError;
use super::lu;
use super::matrix::{CMatrix, Dense, Matrix, Scalar};

/// Solves `a x = b` for a real square `a`.
pub fn solve(a: &Matrix, b: &Matrix) -> Result<Matrix, LinalgError> {
    let x = solve_any(a, b);
    check_finite(&x).map_err(|_| LinalgError::Singular { size: a.nrows() })?;
    Ok(x)
}

/// The inverse of a real square matrix.
pub fn inverse(a: &Matrix) -> Result<Matrix, LinalgError> {
    solve(a, &Matrix::identity(a.nrows(), a.nrows()))
}

/// Solves `a x = b` for a complex square `a`; a singular `a` gives entries that are not finite.
pub fn solve_complex(a: &CMatrix, b: &CMatrix) -> CMatrix {
    solve_any(a, b)
}

/// Of a singular `a`, entries that are not finite.
fn solve_any<T: Scalar>(a: &Dense<T>, b: &Dense<T>) -> Dense<T> {
    let singular = || Dense::from_fn(b.nrows(), b.ncols(), |_, _| T::from_real(f64::NAN));
    lu::solve(a, b).unwrap_or_else(singular)
}

/// The least-squares solution of `a x = b`, a with at least as many rows as columns, by a QR factorisation; entries are not finite
/// where the columns of `a` depend on each other.
pub fn least_squares(a: &Matrix, b: &Matrix) -> Matrix {
    let columns = a.ncols();
    let qr = a.0.clone().qr();
    let mut rotated = b.0.clone();
    qr.q_tr_mul(&mut rotated);
    let upper = qr.unpack_r();
    let solution = upper.solve_upper_triangular(&rotated.rows(0, columns).into_owned());
    Dense(solution.unwrap_or_else(|| DMatrix::from_element(columns, b.ncols(), f64::NAN)))
}

/// Lower triangular `L` with `L Lᵀ = m`.
pub fn cholesky(m: &Matrix) -> Result<Matrix, LinalgError> {
    match factor(m) {
        Some(lower) => Ok(lower),
        None => {
            let least = symmetric_eigen(m)?.0.first().copied().unwrap_or(0.0);
            Err(LinalgError::NotPositiveDefinite { size: m.nrows(), least })
        }
    }
}

/// Lower triangular `L` with `L Lᴴ = m` for a Hermitian matrix, of which the lower triangle is read; `None` where it is not
/// positive definite. nalgebra's factorisation of a complex matrix takes the root of a negative number.
pub fn factor<T: Scalar>(m: &Dense<T>) -> Option<Dense<T>> {
    let n = m.nrows();
    let mut l = m.0.lower_triangle();
    for j in 0..n {
        let pivot = l[(j, j)].real();
        if !(pivot > 0.0 && pivot.is_finite()) {
            return None;
        }
        let root = pivot.sqrt();
        l.view_mut((j, j), (n - j, 1)).unscale_mut(root);
        for k in j + 1..n {
            let factor = l[(k, j)].conjugate();
            let (done, mut rest) = l.columns_range_pair_mut(j, k);
            rest.rows_mut(k, n - k).axpy(-factor, &done.rows(k, n - k), T::one());
        }
    }
    Some(Dense(l))
}

/// `L⁻¹ b` for a lower triangular `L` without zeros on the diagonal.
pub fn solve_lower<T: Scalar>(l: &Dense<T>, b: &Dense<T>) -> Dense<T> {
    Dense(l.0.solve_lower_triangular_unchecked(&b.0))
}
