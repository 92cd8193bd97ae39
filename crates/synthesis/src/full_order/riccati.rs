//! The Riccati equation of the H-infinity problem, solved by the matrix sign function of its Hamiltonian.

use crate::balance;
use crate::linalg::{self, LinalgError, Matrix, blocks};

/// The stabilising, positive semidefinite solution of the indefinite Riccati equation of the state-feedback problem with the
/// first `worst` inputs belonging to the adversary; `None` when there is none.
pub(super) fn riccati(
    a: &Matrix,
    b: &Matrix,
    c1: &Matrix,
    d1: &Matrix,
    worst: usize,
    level: f64,
) -> Result<Option<Matrix>, LinalgError> {
    let n = a.nrows();
    if n == 0 {
        return Ok(Some(Matrix::zeros(0, 0)));
    }
    let mut r = d1.transpose() * d1;
    for i in 0..worst {
        r[(i, i)] -= level * level;
    }
    // H = [A 0; −C₁ᵀC₁ −Aᵀ] − [B; −C₁ᵀD₁] R⁻¹ [D₁ᵀC₁ Bᵀ]
    let dc = d1.transpose() * c1;
    let bt = b.transpose();
    let right = linalg::solve(&r, &blocks(&[&[&dc, &bt]]))?;
    let left = blocks(&[&[b], &[&(c1.transpose() * d1 * -1.0)]]);
    let q = c1.transpose() * c1 * -1.0;
    let minus_at = a.transpose() * -1.0;
    let mut h = blocks(&[&[a, &Matrix::zeros(n, n)], &[&q, &minus_at]]) - left * right;
    // The lower left block is a difference of terms as large as C₁ᵀC₁. Where only rounding error is left of it, the cost can be
    // reduced to zero, and the error would be magnified to a cost of either sign.
    let rounding = 16.0 * f64::EPSILON * linalg::max_abs(&q);
    for (i, j) in (n..2 * n).flat_map(|i| (0..n).map(move |j| (i, j))) {
        if h[(i, j)].abs() <= rounding {
            h[(i, j)] = 0.0;
        }
    }
    // On the stable invariant subspace [I; X] the matrix sign of H is −1. The sign needs no eigenvectors, which are useless
    // here: banks of equal weights and delays give eigenvalues of high multiplicity.
    let (h, scale) = balance_hamiltonian(h);
    let Some(sign) = matrix_sign(&h) else { return Ok(None) };
    let lhs = blocks(&[
        &[&sign.block(0, n, n, n)],
        &[&(sign.block(n, n, n, n) + Matrix::identity(n, n))],
    ]);
    let rhs = blocks(&[
        &[&(sign.block(0, 0, n, n) + Matrix::identity(n, n))],
        &[&sign.block(n, 0, n, n)],
    ]);
    let scaled = linalg::least_squares(&lhs, &(rhs * -1.0));
    if linalg::check_finite(&scaled).is_err() {
        return Ok(None);
    }
    // Verify the result: it must span an invariant subspace, and a stable one.
    let closed = h.block(0, 0, n, n) + h.block(0, n, n, n) * &scaled;
    let residual = h.block(n, 0, n, n) + h.block(n, n, n, n) * &scaled - &scaled * &closed;
    if frobenius(&residual) > 1e-6 * frobenius(&h) * (1.0 + frobenius(&scaled)) {
        return Ok(None);
    }
    if linalg::eigenvalues(&balance::balanced(&closed))?
        .iter()
        .any(|l| l.re >= 0.0)
    {
        return Ok(None);
    }
    // In the balanced coordinates a significant solution is of size one. Where the cost can be reduced to zero the solution
    // is zero, and the computed one is rounding error of either sign.
    let scaled = linalg::symmetric_part(&scaled);
    let least = linalg::symmetric_eigen(&scaled)?.0[0];
    // The lower block is a difference of terms as large as C₁ᵀC₁, which limits its accuracy.
    let own = linalg::max_abs(&h.block(0, 0, n, n)).max(f64::MIN_POSITIVE);
    let rounding = 1e3 * f64::EPSILON * linalg::max_abs(&q) / (scale * own);
    let positive = least >= -1e-7 * linalg::max_abs(&scaled) - 1e-10 - rounding.min(1e-2);
    Ok(positive.then(|| Matrix::from_fn(n, n, |i, j| scaled[(i, j)] * scale)))
}

/// Scales the two halves relative to each other: X becomes X / scale. The off-diagonal blocks become of similar size, or, where
/// their product is small compared with A (and one of them perhaps zero, or rounding), the upper one becomes as large as A.
fn balance_hamiltonian(mut h: Matrix) -> (Matrix, f64) {
    let n = h.nrows() / 2;
    let size = |row, column| linalg::max_abs(&h.block(row, column, n, n));
    let (own, upper, lower) = (size(0, 0), size(0, n), size(n, 0));
    let scale = match (upper > 0.0, lower > 0.0) {
        (true, _) => (lower / upper).sqrt().max(own / upper),
        (false, true) if own > 0.0 => lower / own,
        _ => 1.0,
    };
    let scale = if scale > 0.0 { scale } else { 1.0 };
    for i in 0..n {
        for j in 0..n {
            h[(i, n + j)] *= scale;
            h[(n + i, j)] /= scale;
        }
    }
    (h, scale)
}

/// The matrix sign by Newton's iteration with norm scaling (Roberts 1980; Byers 1987); `None` when it does not converge,
/// which indicates eigenvalues on the imaginary axis.
fn matrix_sign(h: &Matrix) -> Option<Matrix> {
    let mut z = h.clone();
    for step in 0..60 {
        let inverse = linalg::inverse(&z).ok()?;
        let factor = if step < 40 {
            (frobenius(&inverse) / frobenius(&z)).sqrt()
        } else {
            1.0
        };
        let next = &z * (0.5 * factor) + inverse * (0.5 / factor);
        let change = frobenius(&(&next - &z));
        z = next;
        if change <= 1e-12 * frobenius(&z) {
            break;
        }
    }
    // Rounding can keep the last digits changing; a matrix that squares to the identity is accepted. The caller verifies the result.
    let defect = frobenius(&(&z * &z - Matrix::identity(z.nrows(), z.nrows())));
    (defect <= 1e-6 * frobenius(&z).max(1.0)).then_some(z)
}

fn frobenius(m: &Matrix) -> f64 {
    let mut sum = 0.0;
    for j in 0..m.ncols() {
        for i in 0..m.nrows() {
            sum += m[(i, j)] * m[(i, j)];
        }
    }
    sum.sqrt()
}
