//! The full-order H-infinity optimum: what any linear controller could reach on the same plant.
//!
//! A structured optimum is a local one; the full-order optimum is global and bounds it from below, so the distance between
//! the two says how much the structure costs. Two Riccati equations and a coupling condition decide whether a level γ can be
//! reached (Doyle, Glover, Khargonekar and Francis 1989; the general form of Zhou, Doyle and Glover 1996, theorem 17.1);
//! bisection does the rest.

use crate::balance;
use crate::linalg::{self, LinalgError, Matrix, blocks};
use crate::state_space::StateSpace;

/// Why the optimum cannot be computed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FullOrderError {
    /// The control inputs do not all appear in the performance outputs, or the measurements are not all disturbed.
    #[error("{0} has not full rank: add a small effort weight or a small measurement noise")]
    Rank(&'static str),
    /// No level up to the largest tried can be reached.
    #[error(
        "no controller reaches gamma = {0:.3e}: the plant cannot be stabilised, or has zeros on the imaginary axis"
    )]
    Infeasible(f64),
    /// A matrix computation failed.
    #[error(transparent)]
    Linalg(#[from] LinalgError),
}

/// The optimum γ of all linear controllers for `plant` (inputs [w; u], outputs [z; y]), to `tolerance` relative: the first
/// number is infeasible, the second feasible.
///
/// # Errors
/// A singular problem, a plant that cannot be stabilised.
pub fn full_order_optimum(
    plant: &StateSpace,
    controls: usize,
    measurements: usize,
    tolerance: f64,
) -> Result<(f64, f64), FullOrderError> {
    // Control and measurement units are free: make every column of D12 and every row of D21 of size one.
    let (first_u, first_y) = (plant.inputs() - controls, plant.outputs() - measurements);
    let size = |x: f64| if x > 0.0 { 1.0 / x.sqrt() } else { 1.0 };
    let mut right = vec![1.0; plant.inputs()];
    let mut left = vec![1.0; plant.outputs()];
    for (j, r) in right.iter_mut().enumerate().skip(first_u) {
        *r = size((0..first_y).map(|i| plant.d[(i, j)].powi(2)).sum());
    }
    for (i, l) in left.iter_mut().enumerate().skip(first_y) {
        *l = size((0..first_u).map(|j| plant.d[(i, j)].powi(2)).sum());
    }
    let p = balance::balanced_system(&plant.scaled(&left, &right));
    let n = p.states();
    let (nw, nz) = (p.inputs() - controls, p.outputs() - measurements);
    let parts = Parts {
        d11: linalg::sub(&p.d, 0, 0, nz, nw),
        b1: linalg::sub(&p.b, 0, 0, n, nw),
        c1: linalg::sub(&p.c, 0, 0, nz, n),
        d12: linalg::sub(&p.d, 0, nw, nz, controls),
        d21: linalg::sub(&p.d, nz, 0, measurements, nw),
        nw,
        nz,
        plant: p,
    };
    // Least level from the feedthrough alone (Parrott): what no controller can move at infinite frequency.
    let floor = linalg::norm2(&project_out(&parts.d12, &parts.d11, "D12")?)?.max(linalg::norm2(&project_out(
        &parts.d21.transpose().to_owned(),
        &parts.d11.transpose().to_owned(),
        "D21",
    )?)?);
    let mut high = floor.max(1e-6) * 1.01;
    let mut low = floor;
    let most = 1e9 * high.max(1.0);
    while !parts.reachable(high)? {
        low = high;
        high *= 2.0;
        if high > most {
            return Err(FullOrderError::Infeasible(high));
        }
    }
    while high - low > tolerance * high {
        let middle = 0.5 * (low + high);
        if parts.reachable(middle)? {
            high = middle
        } else {
            low = middle
        }
    }
    Ok((low, high))
}

/// The part of `m` outside the range of `d`, whose columns must be independent.
fn project_out(d: &Matrix, m: &Matrix, name: &'static str) -> Result<Matrix, FullOrderError> {
    let gram = d.transpose() * d;
    if linalg::reciprocal_condition(&gram)? < 1e-15 {
        return Err(FullOrderError::Rank(name));
    }
    Ok(m - d * linalg::solve(&gram, &(d.transpose() * m))?)
}

struct Parts {
    plant: StateSpace,
    b1: Matrix,
    c1: Matrix,
    d11: Matrix,
    d12: Matrix,
    d21: Matrix,
    nw: usize,
    nz: usize,
}

impl Parts {
    /// Whether some controller keeps the norm below `level`.
    fn reachable(&self, level: f64) -> Result<bool, LinalgError> {
        let p = &self.plant;
        // Control: D1• = [D11 D12], all inputs.
        let d1 = blocks(&[&[&self.d11, &self.d12]]);
        let Some(x) = riccati(&p.a, &p.b, &self.c1, &d1, self.nw, level)? else {
            return Ok(false);
        };
        // Filtering: the same for the transposed plant.
        let t = |m: &Matrix| m.transpose().to_owned();
        let d1t = blocks(&[&[&t(&self.d11), &t(&self.d21)]]);
        let Some(y) = riccati(&t(&p.a), &t(&p.c), &t(&self.b1), &d1t, self.nz, level)? else {
            return Ok(false);
        };
        let coupling = linalg::eigenvalues(&(&x * &y))?
            .iter()
            .map(|l| l.norm())
            .fold(0.0, f64::max);
        Ok(coupling < level * level)
    }
}

/// The stabilising, positive semidefinite solution of the indefinite Riccati equation of the state-feedback problem with the
/// first `worst` inputs belonging to the adversary; `None` when there is none.
fn riccati(
    a: &Matrix,
    b: &Matrix,
    c1: &Matrix,
    d1: &Matrix,
    worst: usize,
    level: f64,
) -> Result<Option<Matrix>, LinalgError> {
    let n = a.nrows();
    let mut r = d1.transpose() * d1;
    for i in 0..worst {
        r[(i, i)] -= level * level;
    }
    // H = [A 0; −C₁ᵀC₁ −Aᵀ] − [B; −C₁ᵀD₁] R⁻¹ [D₁ᵀC₁ Bᵀ]
    let dc = d1.transpose() * c1;
    let bt = b.transpose().to_owned();
    let right = linalg::solve(&r, &blocks(&[&[&dc, &bt]]))?;
    let left = blocks(&[&[b], &[&(c1.transpose() * d1 * faer::Scale(-1.0))]]);
    let q = c1.transpose() * c1 * faer::Scale(-1.0);
    let minus_at = a.transpose().to_owned() * faer::Scale(-1.0);
    let h = blocks(&[&[a, &Matrix::zeros(n, n)], &[&q, &minus_at]]) - left * right;
    // On the stable invariant subspace [I; X] the matrix sign of H is −1. The sign needs no eigenvectors, which are useless
    // here: banks of equal weights and delays give eigenvalues of high multiplicity.
    let (h, scale) = balance_hamiltonian(h);
    let Some(sign) = matrix_sign(&h) else { return Ok(None) };
    let lhs = blocks(&[
        &[&linalg::sub(&sign, 0, n, n, n)],
        &[&(linalg::sub(&sign, n, n, n, n) + Matrix::identity(n, n))],
    ]);
    let rhs = blocks(&[
        &[&(linalg::sub(&sign, 0, 0, n, n) + Matrix::identity(n, n))],
        &[&linalg::sub(&sign, n, 0, n, n)],
    ]);
    let scaled = linalg::least_squares(&lhs, &(rhs * faer::Scale(-1.0)));
    if linalg::check_finite(&scaled).is_err() {
        return Ok(None);
    }
    // Trust nothing: it must span an invariant subspace, and a stable one.
    let closed = linalg::sub(&h, 0, 0, n, n) + linalg::sub(&h, 0, n, n, n) * &scaled;
    let residual = linalg::sub(&h, n, 0, n, n) + linalg::sub(&h, n, n, n, n) * &scaled - &scaled * &closed;
    if frobenius(&residual) > 1e-6 * frobenius(&h) * (1.0 + frobenius(&scaled)) {
        return Ok(None);
    }
    if linalg::eigenvalues(&balance::balanced(&closed))?
        .iter()
        .any(|l| l.re >= 0.0)
    {
        return Ok(None);
    }
    let x = Matrix::from_fn(n, n, |i, j| scaled[(i, j)] * scale);
    let x = linalg::symmetric_part(&x);
    let least = linalg::symmetric_eigen(&x)?.0[0];
    Ok(if least >= -1e-7 * linalg::max_abs(&x).max(f64::MIN_POSITIVE) {
        Some(x)
    } else {
        None
    })
}

/// Scales the two halves against each other so that the off-diagonal blocks are of like size: X becomes X / scale.
fn balance_hamiltonian(mut h: Matrix) -> (Matrix, f64) {
    let n = h.nrows() / 2;
    let (upper, lower) = (
        linalg::max_abs(&linalg::sub(&h, 0, n, n, n)),
        linalg::max_abs(&linalg::sub(&h, n, 0, n, n)),
    );
    let scale = if upper > 0.0 && lower > 0.0 {
        (lower / upper).sqrt()
    } else {
        1.0
    };
    for i in 0..n {
        for j in 0..n {
            h[(i, n + j)] *= scale;
            h[(n + i, j)] /= scale;
        }
    }
    (h, scale)
}

/// The matrix sign by Newton's iteration with norm scaling (Roberts 1980; Byers 1987); `None` when it does not converge,
/// which is the sign of eigenvalues on the imaginary axis.
fn matrix_sign(h: &Matrix) -> Option<Matrix> {
    let mut z = h.clone();
    for step in 0..60 {
        let inverse = linalg::inverse(&z).ok()?;
        let factor = if step < 40 {
            (frobenius(&inverse) / frobenius(&z)).sqrt()
        } else {
            1.0
        };
        let next = &z * faer::Scale(0.5 * factor) + inverse * faer::Scale(0.5 / factor);
        let change = frobenius(&(&next - &z));
        z = next;
        if change <= 1e-12 * frobenius(&z) {
            break;
        }
    }
    // Rounding can keep the last digits moving; what squares to the identity is a sign. The caller checks its consequences.
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
