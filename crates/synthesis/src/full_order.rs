//! The full-order H-infinity optimum: what any linear controller could reach on the same plant.
//!
//! A structured optimum is a local one; the full-order optimum is global and bounds it from below, so the distance between
//! the two says how much the structure costs. Two Riccati equations and a coupling condition decide whether a level γ can be
//! reached (Doyle, Glover, Khargonekar and Francis 1989; the general form of Zhou, Doyle and Glover 1996, theorem 17.1);
//! bisection does the rest.

use crate::balance;
use crate::linalg::{self, CMatrix, LinalgError, Matrix, blocks, c64};
use crate::state_space::StateSpace;

/// Why the optimum cannot be computed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FullOrderError {
    /// The control inputs do not all appear in the performance outputs, or the measurements are not all disturbed.
    #[error("{0} has not full rank: add a small effort weight or a small measurement noise")]
    Rank(&'static str),
    /// No level up to the largest tried can be reached.
    #[error("no controller reaches gamma = {0:.3e}: the plant cannot be stabilised, or has zeros on the imaginary axis")]
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
pub fn full_order_optimum(plant: &StateSpace, controls: usize, measurements: usize, tolerance: f64) -> Result<(f64, f64), FullOrderError> {
    let p = balance::balanced_system(plant);
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
    let floor = linalg::norm2(&project_out(&parts.d12, &parts.d11, "D12")?)?
        .max(linalg::norm2(&project_out(&parts.d21.transpose().to_owned(), &parts.d11.transpose().to_owned(), "D21")?)?);
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
        if parts.reachable(middle)? { high = middle } else { low = middle }
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
        let Some(x) = riccati(&p.a, &p.b, &self.c1, &d1, self.nw, level)? else { return Ok(false) };
        // Filtering: the same for the transposed plant.
        let t = |m: &Matrix| m.transpose().to_owned();
        let d1t = blocks(&[&[&t(&self.d11), &t(&self.d21)]]);
        let Some(y) = riccati(&t(&p.a), &t(&p.c), &t(&self.b1), &d1t, self.nz, level)? else { return Ok(false) };
        let coupling = linalg::eigenvalues(&(&x * &y))?.iter().map(|l| l.norm()).fold(0.0, f64::max);
        Ok(coupling < level * level)
    }
}

/// The stabilising, positive semidefinite solution of the indefinite Riccati equation of the state-feedback problem with the
/// first `worst` inputs belonging to the adversary; `None` when there is none.
fn riccati(a: &Matrix, b: &Matrix, c1: &Matrix, d1: &Matrix, worst: usize, level: f64) -> Result<Option<Matrix>, LinalgError> {
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
    let (values, vectors) = linalg::eigen(&h)?;
    let size = linalg::max_abs(&h);
    let mut stable: Vec<usize> = (0..2 * n).filter(|&i| values[i].re < 0.0).collect();
    if stable.len() != n || values.iter().any(|l| l.re.abs() <= 1e-13 * size) {
        return Ok(None);
    }
    stable.sort_by(|&i, &j| values[i].re.total_cmp(&values[j].re).then(values[i].im.total_cmp(&values[j].im)));
    let top = CMatrix::from_fn(n, n, |i, j| vectors[(i, stable[j])]);
    let bottom = CMatrix::from_fn(n, n, |i, j| vectors[(n + i, stable[j])]);
    // X = bottom top⁻¹
    let x = linalg::solve_complex(&top.transpose().to_owned(), &bottom.transpose().to_owned());
    let x = Matrix::from_fn(n, n, |i, j| { let v: c64 = x[(j, i)]; v.re });
    if linalg::check_finite(&x).is_err() {
        return Ok(None);
    }
    let x = linalg::symmetric_part(&x);
    let least = linalg::symmetric_eigen(&x)?.0[0];
    Ok(if least >= -1e-7 * linalg::max_abs(&x).max(f64::MIN_POSITIVE) { Some(x) } else { None })
}
