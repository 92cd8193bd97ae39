//! Lower bounds: perturbations that make the loop singular, found by ascent and then verified.

use super::structure::{Block, MuError, Structure};
use crate::linalg::{self, CMatrix, LinalgError, c64};
use crate::rng::Rng;

/// A perturbation for which `det(I − M Δ) = 0`.
#[derive(Debug, Clone)]
pub struct Singular {
    /// The perturbation, rows × columns of the structure.
    pub delta: CMatrix,
    /// Its size, the largest norm of its blocks: μ ≥ 1/size.
    pub size: f64,
}

/// The smallest perturbation found that makes `I − M Δ` singular; `None` when none was found (μ may be zero).
///
/// Ascent on the real part of an eigenvalue of MΔ: the Δ of unit norm that increases it most, to first order, is known in
/// closed form for every kind of block (the generalised power iteration of Packard, Fan and Doyle 1988 in another guise).
/// A last Newton step on the size of Δ and the common phase of its complex blocks makes the eigenvalue exactly one.
///
/// # Errors
/// Blocks that do not fit the matrix.
pub fn lower_bound(m: &CMatrix, structure: &Structure, starts: usize, seed: u64) -> Result<Option<Singular>, MuError> {
    structure.check(m.nrows(), m.ncols())?;
    let mut best: Option<Singular> = None;
    for index in 0..starts.max(1) {
        let mut rng = Rng::new(seed, index as u64);
        let mut delta = random_delta(structure, &mut rng, index);
        let Some((mut value, mut step)) = ascent_direction(m, structure, &delta)? else {
            continue;
        };
        for _ in 0..100 {
            let mut improved = false;
            for t in [1.0, 0.5, 0.2, 0.05, 0.01] {
                let trial = interpolate(&delta, &step, t);
                if let Some((trial_value, trial_step)) = ascent_direction(m, structure, &trial)?
                    && trial_value > value * (1.0 + 1e-12) + 1e-300
                {
                    (improved, delta, value, step) =
                        (trial_value > value * (1.0 + 1e-10), trial, trial_value, trial_step);
                    break;
                }
            }
            if !improved {
                break;
            }
        }
        if let Some(found) = make_singular(m, structure, &delta)?
            && best.as_ref().is_none_or(|b| found.size < b.size)
        {
            best = Some(found);
        }
    }
    Ok(best)
}

pub(crate) fn interpolate(a: &CMatrix, b: &CMatrix, t: f64) -> CMatrix {
    CMatrix::from_fn(a.nrows(), a.ncols(), |i, j| a[(i, j)] * (1.0 - t) + b[(i, j)] * t)
}

/// A random member of the unit ball; the first ones are the corners with all signs equal.
pub(crate) fn random_delta(structure: &Structure, rng: &mut Rng, index: usize) -> CMatrix {
    let sign = if index == 1 { -1.0 } else { 1.0 };
    let mut random_vector = |n: usize| -> Vec<c64> {
        (0..n)
            .map(|_| {
                if index < 2 {
                    c64::new(sign, 0.0)
                } else {
                    c64::new(rng.normal(), rng.normal())
                }
            })
            .collect()
    };
    let (row, column) = (random_vector(structure.rows()), random_vector(structure.columns()));
    let mut delta = structure.maximising_delta(&row, &column);
    if index < 2 {
        for (block, r, c) in structure.blocks_with_offsets() {
            if !matches!(block, Block::Full { .. }) {
                (0..block.rows()).for_each(|i| delta[(r + i, c + i)] = c64::new(sign, 0.0));
            }
        }
    }
    delta
}

/// The eigenvalue of MΔ of largest real part, and the Δ of unit norm that would raise it most.
fn ascent_direction(
    m: &CMatrix,
    structure: &Structure,
    delta: &CMatrix,
) -> Result<Option<(f64, CMatrix)>, LinalgError> {
    let product = m * delta;
    let n = product.nrows();
    let (values, right) = linalg::eigen_complex(&product)?;
    let Some(at) = (0..n).max_by(|&i, &j| values[i].re.total_cmp(&values[j].re)) else {
        return Ok(None);
    };
    let unit = CMatrix::from_fn(n, 1, |i, _| c64::new(f64::from(u8::from(i == at)), 0.0));
    let left = linalg::solve_complex(&right.transpose(), &unit);
    // dλ = yᵀ M dΔ x with yᵀ x = 1.
    let row: Vec<c64> = (0..m.ncols())
        .map(|j| (0..n).map(|i| left[(i, 0)] * m[(i, j)]).sum())
        .collect();
    let column: Vec<c64> = (0..n).map(|i| right[(i, at)]).collect();
    if row
        .iter()
        .chain(&column)
        .any(|x| !x.re.is_finite() || !x.im.is_finite())
    {
        return Ok(None);
    }
    Ok(Some((values[at].re, structure.maximising_delta(&row, &column))))
}

/// Scales Δ, and rotates the phase of its complex blocks together, until `I − MΔ` is exactly singular.
fn make_singular(m: &CMatrix, structure: &Structure, delta: &CMatrix) -> Result<Option<Singular>, LinalgError> {
    let product = m * delta;
    let values = linalg::eigenvalues_complex(&product)?;
    let any_complex = !structure.all_real();
    let mut best: Option<Singular> = None;
    for value in values {
        let mut candidate = delta.clone();
        let mut eigenvalue = value;
        if any_complex && eigenvalue.norm() > 0.0 {
            // Newton on the phase: rotate the complex blocks until the eigenvalue is real and positive.
            for _ in 0..30 {
                if eigenvalue.im.abs() <= 1e-14 * eigenvalue.norm() && eigenvalue.re > 0.0 {
                    break;
                }
                rotate(&mut candidate, structure, -eigenvalue.arg());
                let again = linalg::eigenvalues_complex(&(m * &candidate))?;
                let rotated_eigenvalue = eigenvalue * c64::new(0.0, -eigenvalue.arg()).exp();
                let near = |x: &c64| (x - rotated_eigenvalue).norm();
                eigenvalue = again
                    .into_iter()
                    .min_by(|a, b| near(a).total_cmp(&near(b)))
                    .unwrap_or(eigenvalue);
            }
        }
        if eigenvalue.re <= 0.0 || eigenvalue.im.abs() > 1e-10 * eigenvalue.re {
            continue;
        }
        let scale = 1.0 / eigenvalue.re;
        let scaled = CMatrix::from_fn(candidate.nrows(), candidate.ncols(), |i, j| candidate[(i, j)] * scale);
        let size = structure.norm(&scaled)?;
        if !size.is_finite() || best.as_ref().is_some_and(|b| b.size <= size) {
            continue;
        }
        let closed = m * &scaled;
        let rest = CMatrix::from_fn(closed.nrows(), closed.ncols(), |i, j| {
            c64::new(f64::from(u8::from(i == j)), 0.0) - closed[(i, j)]
        });
        let s = linalg::singular_values(&rest)?;
        if s[s.len() - 1] <= 1e-8 * s[0].max(1.0) {
            best = Some(Singular { delta: scaled, size });
        }
    }
    Ok(best)
}

fn rotate(delta: &mut CMatrix, structure: &Structure, angle: f64) {
    let factor = c64::new(0.0, angle).exp();
    for (block, r, c) in structure.blocks_with_offsets() {
        if matches!(block, Block::Real(_)) {
            continue;
        }
        for i in 0..block.rows() {
            for j in 0..block.columns() {
                delta[(r + i, c + j)] *= factor;
            }
        }
    }
}
