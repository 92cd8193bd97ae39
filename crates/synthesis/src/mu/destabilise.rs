//! Upper bounds of a margin: perturbations that place an eigenvalue of the closed loop on the imaginary axis.

use super::lower::{interpolate, lower_bound, random_delta};
use super::options::{Destabilising, MarginOptions};
use super::structure::{MuError, Structure};
use crate::balance;
use crate::linalg::{self, CMatrix, LinalgError, c64};
use crate::rng::Rng;
use crate::state_space::StateSpace;

/// The closed loop's state matrix with `w = Δ z`, and the factors that gradients need.
fn closed(m: &StateSpace, delta: &CMatrix, k: f64) -> (CMatrix, CMatrix, CMatrix) {
    let scaled = CMatrix::from_fn(delta.nrows(), delta.ncols(), |i, j| delta[(i, j)] * k);
    let (b, c, d) = (
        linalg::to_complex(&m.b),
        linalg::to_complex(&m.c),
        linalg::to_complex(&m.d),
    );
    let eye = |n: usize| CMatrix::identity(n, n);
    // A + B Δ (I − D Δ)⁻¹ C
    let left = linalg::solve_complex(&(eye(m.outputs()) - &d * &scaled), &c);
    let right = linalg::solve_complex(&(eye(m.inputs()) - &scaled * &d).transpose(), &b.transpose());
    let a = linalg::to_complex(&m.a) + &b * (&scaled * &left);
    (a, right.transpose(), left)
}

fn rightmost(m: &StateSpace, delta: &CMatrix, k: f64) -> Result<c64, LinalgError> {
    let (a, _, _) = closed(m, delta, k);
    let values = linalg::eigenvalues_complex(&balance::balanced_complex(&a))?;
    Ok(values
        .into_iter()
        .max_by(|a, b| a.re.total_cmp(&b.re))
        .unwrap_or(c64::new(f64::NEG_INFINITY, 0.0)))
}

/// The smallest multiple k in [low, high] at which the loop with kΔ loses stability, by steps and then by bisection.
fn crossing(m: &StateSpace, delta: &CMatrix, low: f64, high: f64) -> Result<Option<(f64, f64)>, LinalgError> {
    let steps = 24;
    let mut below = low;
    while rightmost(m, delta, below)?.re >= 0.0 {
        below *= 0.7;
        if below < 1e-9 * low {
            return Ok(None);
        }
    }
    for i in 0..=steps {
        let k = low * libm::pow(high / low, f64::from(i) / f64::from(steps));
        if rightmost(m, delta, k)?.re >= 0.0 {
            let mut above = k;
            for _ in 0..60 {
                let middle = 0.5 * (below + above);
                if middle <= below || middle >= above {
                    break;
                }
                if rightmost(m, delta, middle)?.re >= 0.0 {
                    above = middle
                } else {
                    below = middle
                }
            }
            return Ok(Some((above, rightmost(m, delta, above)?.im.abs())));
        }
        below = k;
    }
    Ok(None)
}

/// The smallest perturbation found that destabilises; `None` when none was found.
pub(super) fn destabilise(
    m: &StateSpace,
    structure: &Structure,
    options: &MarginOptions,
    critical: f64,
    bound: f64,
) -> Result<Option<Destabilising>, MuError> {
    let mut best: Option<Destabilising> = None;
    let mut seeds = Vec::new();
    // At the peak of the upper bound, and near it on both sides: with real blocks the lower bound jumps from point to point.
    for factor in [1.0, 0.99, 1.01, 0.9, 1.1] {
        let omega = critical * factor;
        if omega.is_infinite() && factor != 1.0 {
            continue;
        }
        if let Some(found) = lower_bound(&m.at(omega), structure, options.starts, options.seed)? {
            seeds.push(CMatrix::from_fn(found.delta.nrows(), found.delta.ncols(), |i, j| {
                found.delta[(i, j)] / found.size
            }));
            if best.as_ref().is_none_or(|b| found.size < b.size) {
                best = Some(Destabilising {
                    delta: found.delta,
                    size: found.size,
                    omega,
                });
            }
        }
    }
    if m.states() == 0 {
        return Ok(best);
    }
    for index in 0..options.starts {
        seeds.push(random_delta(
            structure,
            &mut Rng::new(options.seed, 1000 + index as u64),
            index,
        ));
    }
    // Start of the search along a ray: `bound` is only known on a grid, so stability below it is not assumed either.
    let start = if bound > 0.0 { 0.999 / bound } else { 1.0 };
    for mut delta in seeds {
        let low = best.as_ref().map_or(start, |b| start.min(0.5 * b.size));
        let reach = best.as_ref().map_or(30.0 * low, |b| b.size * (1.0 - 1e-9));
        let mut k = best.as_ref().map_or(1.2 * low, |b| b.size);
        for _ in 0..6 {
            climb_abscissa(m, structure, &mut delta, k)?;
            let size = structure.norm(&delta)?;
            let unit = CMatrix::from_fn(delta.nrows(), delta.ncols(), |i, j| delta[(i, j)] / size);
            let limit = best.as_ref().map_or(reach, |b| b.size.min(reach));
            let Some((found, omega)) = crossing(m, &unit, low, limit.max(low * 1.0001))? else {
                break;
            };
            let improved = best.as_ref().is_none_or(|b| found < b.size * (1.0 - 1e-9));
            if improved {
                let scaled = CMatrix::from_fn(unit.nrows(), unit.ncols(), |i, j| unit[(i, j)] * found);
                best = Some(Destabilising {
                    delta: scaled,
                    size: found,
                    omega,
                });
            }
            if !improved || (k - found).abs() < 1e-6 * found {
                break;
            }
            k = found;
        }
    }
    Ok(best)
}

/// Conditional-gradient ascent of the spectral abscissa over Δ of unit norm, at the multiple k.
fn climb_abscissa(m: &StateSpace, structure: &Structure, delta: &mut CMatrix, k: f64) -> Result<(), LinalgError> {
    let mut current = rightmost(m, delta, k)?.re;
    for _ in 0..30 {
        let (a, b, c) = closed(m, delta, k);
        let n = a.nrows();
        let (values, right) = linalg::eigen_complex(&a)?;
        let Some(at) = (0..n).max_by(|&i, &j| values[i].re.total_cmp(&values[j].re)) else {
            return Ok(());
        };
        let unit = CMatrix::from_fn(n, 1, |i, _| c64::new(f64::from(u8::from(i == at)), 0.0));
        let left = linalg::solve_complex(&right.transpose(), &unit);
        let row: Vec<c64> = (0..b.ncols())
            .map(|j| (0..n).map(|i| left[(i, 0)] * b[(i, j)]).sum())
            .collect();
        let column: Vec<c64> = (0..c.nrows())
            .map(|i| (0..n).map(|j| c[(i, j)] * right[(j, at)]).sum())
            .collect();
        if row
            .iter()
            .chain(&column)
            .any(|x| !x.re.is_finite() || !x.im.is_finite())
        {
            return Ok(());
        }
        let direction = structure.maximising_delta(&row, &column);
        let mut improved_step = false;
        for t in [1.0, 0.5, 0.2, 0.05] {
            let trial = interpolate(delta, &direction, t);
            let value = rightmost(m, &trial, k)?.re;
            if value > current + 1e-9 * current.abs() {
                (*delta, current, improved_step) = (trial, value, true);
                break;
            }
        }
        if !improved_step {
            return Ok(());
        }
    }
    Ok(())
}
