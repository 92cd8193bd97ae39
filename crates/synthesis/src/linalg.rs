//! Dense real and complex matrices, and the handful of decompositions the rest of the crate needs.
//!
//! This is the only module that calls `faer` decompositions. They run on one thread (`faer` is built without its
//! thread pool), so a result depends on the machine only through the instruction set of the kernels. Tuning is done
//! offline and its result is a file of gains, so that is acceptable here; nothing in a simulation step uses this crate.

use faer::linalg::solvers::Solve;
use faer::{Mat, MatRef, Side};

/// A complex number, `re + j im`.
#[allow(non_camel_case_types)]
pub type c64 = faer::c64;
/// A dense real matrix; `m[(row, column)]`.
pub type Matrix = Mat<f64>;
/// A dense complex matrix; `m[(row, column)]`.
pub type CMatrix = Mat<c64>;

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
    let m = Mat::from_fn(rows.len(), width, |i, j| rows[i][j]);
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
    Mat::from_fn(d.len(), d.len(), |i, j| if i == j { d[i] } else { 0.0 })
}

/// Places blocks on a grid; every row of blocks must have equal heights and every column equal widths.
///
/// # Panics
/// When the blocks do not fit: this is a programming error of the caller, never a matter of input.
pub fn blocks(grid: &[&[&Matrix]]) -> Matrix {
    let heights: Vec<usize> = grid.iter().map(|r| r[0].nrows()).collect();
    let widths: Vec<usize> = grid[0].iter().map(|m| m.ncols()).collect();
    let mut out = Mat::zeros(heights.iter().sum(), widths.iter().sum());
    let mut row = 0;
    for (r, line) in grid.iter().enumerate() {
        let mut column = 0;
        for (c, block) in line.iter().enumerate() {
            assert!(
                block.nrows() == heights[r] && block.ncols() == widths[c],
                "blocks do not fit"
            );
            put(&mut out, row, column, block.as_ref());
            column += widths[c];
        }
        row += heights[r];
    }
    out
}

/// Writes `block` into `out` with its upper left corner at (`row`, `column`).
pub fn put(out: &mut Matrix, row: usize, column: usize, block: MatRef<'_, f64>) {
    for j in 0..block.ncols() {
        for i in 0..block.nrows() {
            out[(row + i, column + j)] = block[(i, j)];
        }
    }
}

/// A copy of rows `row..row + height`, columns `column..column + width`.
pub fn sub(m: &Matrix, row: usize, column: usize, height: usize, width: usize) -> Matrix {
    m.as_ref().submatrix(row, column, height, width).to_owned()
}

/// The complex matrix with the same entries.
pub fn to_complex(m: &Matrix) -> CMatrix {
    Mat::from_fn(m.nrows(), m.ncols(), |i, j| c64::new(m[(i, j)], 0.0))
}

/// Conjugate transpose.
pub fn adjoint(m: &CMatrix) -> CMatrix {
    Mat::from_fn(m.ncols(), m.nrows(), |i, j| m[(j, i)].conj())
}

/// `(m + mᵀ)/2`.
pub fn symmetric_part(m: &Matrix) -> Matrix {
    Mat::from_fn(m.nrows(), m.ncols(), |i, j| 0.5 * (m[(i, j)] + m[(j, i)]))
}

/// The largest absolute entry; 0 for an empty matrix.
pub fn max_abs(m: &Matrix) -> f64 {
    let mut largest = 0.0f64;
    for j in 0..m.ncols() {
        for i in 0..m.nrows() {
            largest = largest.max(m[(i, j)].abs());
        }
    }
    largest
}

/// Eigenvalues of a real square matrix. Balance it first when its entries differ by orders of magnitude.
pub fn eigenvalues(m: &Matrix) -> Result<Vec<c64>, LinalgError> {
    if m.nrows() == 0 {
        return Ok(Vec::new());
    }
    let size = m.nrows();
    check_finite(m)?;
    m.eigenvalues().map_err(|_| LinalgError::NoConvergence {
        what: "eigenvalue",
        size,
    })
}

/// Eigenvalues of a complex square matrix.
pub fn eigenvalues_complex(m: &CMatrix) -> Result<Vec<c64>, LinalgError> {
    if m.nrows() == 0 {
        return Ok(Vec::new());
    }
    let size = m.nrows();
    m.eigenvalues().map_err(|_| LinalgError::NoConvergence {
        what: "eigenvalue",
        size,
    })
}

/// Right eigenvectors (columns, not normalised) and eigenvalues of a real square matrix.
pub fn eigen(m: &Matrix) -> Result<(Vec<c64>, CMatrix), LinalgError> {
    let size = m.nrows();
    check_finite(m)?;
    let e = m.eigen().map_err(|_| LinalgError::NoConvergence {
        what: "eigenvalue",
        size,
    })?;
    let values = (0..size).map(|i| e.S()[i]).collect();
    Ok((values, e.U().to_owned()))
}

/// Right eigenvectors and eigenvalues of a complex square matrix.
pub fn eigen_complex(m: &CMatrix) -> Result<(Vec<c64>, CMatrix), LinalgError> {
    let size = m.nrows();
    let e = m.eigen().map_err(|_| LinalgError::NoConvergence {
        what: "eigenvalue",
        size,
    })?;
    let values = (0..size).map(|i| e.S()[i]).collect();
    Ok((values, e.U().to_owned()))
}

/// Eigenvalues (ascending) and orthonormal eigenvectors of a real symmetric matrix; only the lower triangle is read.
pub fn symmetric_eigen(m: &Matrix) -> Result<(Vec<f64>, Matrix), LinalgError> {
    let size = m.nrows();
    check_finite(m)?;
    let e = m
        .self_adjoint_eigen(Side::Lower)
        .map_err(|_| LinalgError::NoConvergence {
            what: "eigenvalue",
            size,
        })?;
    Ok(((0..size).map(|i| e.S()[i]).collect(), e.U().to_owned()))
}

/// Eigenvalues (ascending) and orthonormal eigenvectors of a Hermitian matrix; only the lower triangle is read.
pub fn hermitian_eigen(m: &CMatrix) -> Result<(Vec<f64>, CMatrix), LinalgError> {
    let size = m.nrows();
    let e = m
        .self_adjoint_eigen(Side::Lower)
        .map_err(|_| LinalgError::NoConvergence {
            what: "eigenvalue",
            size,
        })?;
    Ok(((0..size).map(|i| e.S()[i].re).collect(), e.U().to_owned()))
}

/// Singular values of a complex matrix, largest first.
pub fn singular_values(m: &CMatrix) -> Result<Vec<f64>, LinalgError> {
    if m.nrows() == 0 || m.ncols() == 0 {
        return Ok(vec![0.0]);
    }
    let size = m.nrows().max(m.ncols());
    m.singular_values().map_err(|_| LinalgError::NoConvergence {
        what: "singular-value",
        size,
    })
}

/// The largest singular value of a real matrix.
pub fn norm2(m: &Matrix) -> Result<f64, LinalgError> {
    if m.nrows() == 0 || m.ncols() == 0 {
        return Ok(0.0);
    }
    let size = m.nrows().max(m.ncols());
    let s = m.singular_values().map_err(|_| LinalgError::NoConvergence {
        what: "singular-value",
        size,
    })?;
    Ok(s[0])
}

/// Thin singular value decomposition `m = U diag(s) Vᴴ`, largest first.
pub fn svd(m: &CMatrix) -> Result<(CMatrix, Vec<f64>, CMatrix), LinalgError> {
    let size = m.nrows().max(m.ncols());
    let d = m.thin_svd().map_err(|_| LinalgError::NoConvergence {
        what: "singular-value",
        size,
    })?;
    let s = (0..m.nrows().min(m.ncols())).map(|i| d.S()[i].re).collect();
    Ok((d.U().to_owned(), s, d.V().to_owned()))
}

/// Solves `a x = b` for a real square `a`.
pub fn solve(a: &Matrix, b: &Matrix) -> Result<Matrix, LinalgError> {
    if a.nrows() == 0 {
        return Ok(Mat::zeros(0, b.ncols()));
    }
    let x = a.partial_piv_lu().solve(b);
    check_finite(&x).map_err(|_| LinalgError::Singular { size: a.nrows() })?;
    Ok(x)
}

/// The inverse of a real square matrix.
pub fn inverse(a: &Matrix) -> Result<Matrix, LinalgError> {
    solve(a, &Mat::identity(a.nrows(), a.nrows()))
}

/// Solves `a x = b` for a complex square `a`; a singular `a` gives non-finite entries.
pub fn solve_complex(a: &CMatrix, b: &CMatrix) -> CMatrix {
    if a.nrows() == 0 {
        return Mat::zeros(0, b.ncols());
    }
    a.partial_piv_lu().solve(b)
}

/// The least-squares solution of `a x = b`, a with at least as many rows as columns, by a QR factorisation.
pub fn least_squares(a: &Matrix, b: &Matrix) -> Matrix {
    use faer::linalg::solvers::SolveLstsq;
    a.qr().solve_lstsq(b)
}

/// Reciprocal condition number (2-norm) of a real square matrix; 1 for an empty one.
pub fn reciprocal_condition(a: &Matrix) -> Result<f64, LinalgError> {
    if a.nrows() == 0 {
        return Ok(1.0);
    }
    let s = a.singular_values().map_err(|_| LinalgError::NoConvergence {
        what: "singular-value",
        size: a.nrows(),
    })?;
    Ok(if s[0] > 0.0 { s[s.len() - 1] / s[0] } else { 0.0 })
}

/// Symmetric square root of a symmetric positive definite matrix.
pub fn sqrt_spd(m: &Matrix) -> Result<Matrix, LinalgError> {
    let (w, v) = symmetric_eigen(m)?;
    let size = m.nrows();
    if let Some(&least) = w.first().filter(|&&least| least <= 0.0) {
        return Err(LinalgError::NotPositiveDefinite { size, least });
    }
    let root: Vec<f64> = w.iter().map(|x| x.sqrt()).collect();
    let scaled = Mat::from_fn(size, size, |i, j| v[(i, j)] * root[j]);
    Ok(&scaled * v.transpose())
}

/// Lower triangular `L` with `L Lᵀ = m`.
pub fn cholesky(m: &Matrix) -> Result<Matrix, LinalgError> {
    match m.llt(Side::Lower) {
        Ok(f) => Ok(f.L().to_owned()),
        Err(_) => {
            let least = symmetric_eigen(m)?.0.first().copied().unwrap_or(0.0);
            Err(LinalgError::NotPositiveDefinite { size: m.nrows(), least })
        }
    }
}

/// Matrix exponential by scaling and squaring with the [13/13] Padé approximant (Higham 2005, Algorithm 2.3).
pub fn expm(a: &Matrix) -> Result<Matrix, LinalgError> {
    const B: [f64; 14] = [
        64764752532480000.0,
        32382376266240000.0,
        7771770303897600.0,
        1187353796428800.0,
        129060195264000.0,
        10559470521600.0,
        670442572800.0,
        33522128640.0,
        1323241920.0,
        40840800.0,
        960960.0,
        16380.0,
        182.0,
        1.0,
    ];
    // Largest 1-norm for which the unscaled approximant is accurate to double precision (same source, Table 2.3).
    const THETA_13: f64 = 5.371920351148152;
    check_finite(a)?;
    let n = a.nrows();
    let norm1 = (0..n)
        .map(|j| (0..n).map(|i| a[(i, j)].abs()).sum::<f64>())
        .fold(0.0, f64::max);
    let squarings = if norm1 > THETA_13 {
        (norm1 / THETA_13).log2().ceil() as i32
    } else {
        0
    };
    let a = a * faer::Scale(0.5f64.powi(squarings));
    let eye = Matrix::identity(n, n);
    let a2 = &a * &a;
    let a4 = &a2 * &a2;
    let a6 = &a4 * &a2;
    let sum = |c: [f64; 4]| {
        &a6 * faer::Scale(c[3]) + &a4 * faer::Scale(c[2]) + &a2 * faer::Scale(c[1]) + &eye * faer::Scale(c[0])
    };
    let u = &a * (&a6 * sum([0.0, B[9], B[11], B[13]]) + sum([B[1], B[3], B[5], B[7]]));
    let v = &a6 * sum([0.0, B[8], B[10], B[12]]) + sum([B[0], B[2], B[4], B[6]]);
    let mut x = solve(&(&v - &u), &(&v + &u))?;
    for _ in 0..squarings {
        x = &x * &x;
    }
    Ok(x)
}
