//! Brackets for singular problems, which lack the regularity that the Riccati equations require.
//!
//! Where an effort weight or a noise is missing, or a zero lies on the imaginary axis, two families of regular problems
//! enclose the optimum, and both converge to it:
//!
//! - From above, the states and controls are added to the performance outputs and noise to the measurements, all of size ε.
//!   More outputs and inputs can only raise the norm of a closed loop.
//! - From below, the right half-plane is replaced by a disc inside it that touches neither the axis nor infinity (diameter
//!   from ε to 1/ε). A function that is stable and small on the half-plane is so on the disc (maximum modulus), and the zeros
//!   of the boundary are outside. A zero on the boundary itself adds the gain that no controller can change there (Parrott).

use super::regular::{FullOrderError, RegularProblem, normalised};
use super::riccati::riccati;
use crate::linalg::{self, CMatrix, LinalgError, Matrix, blocks};
use crate::state_space::StateSpace;

pub(super) fn bracket(
    plant: &StateSpace,
    controls: usize,
    measurements: usize,
    tolerance: f64,
) -> Result<(f64, f64), FullOrderError> {
    let mut low = boundary(plant, controls, measurements)?;
    let mut high = f64::INFINITY;
    let mut highest_tried = 0.0f64;
    for exponent in 1..=7 {
        let epsilon = 10f64.powi(-exponent);
        let raised = augmented(plant, controls, measurements, epsilon);
        if let Some(problem) =
            RegularProblem::new(&normalised(&raised, controls, measurements), controls, measurements)?
        {
            match problem.search(tolerance)? {
                // The levels decrease with ε; an increase is rounding error.
                Some((_, level)) if level < high => high = level,
                Some(_) => {}
                None => highest_tried = f64::INFINITY,
            }
        }
        if let Some(inside) = disc(plant, epsilon)
            && let Some(problem) =
                RegularProblem::new(&normalised(&inside, controls, measurements), controls, measurements)?
            && let Some((level, _)) = problem.search(tolerance)?
            && level < high
        {
            low = low.max(level);
        }
        if high - low <= tolerance * high {
            break;
        }
    }
    if high.is_infinite() {
        return Err(FullOrderError::Infeasible(highest_tried));
    }
    Ok((low.min(high), high))
}

/// The plant with controls added to its outputs, of size `epsilon` in units in which they are as strong as they are fast.
pub(super) fn with_effort(plant: &StateSpace, controls: usize, epsilon: f64) -> StateSpace {
    let (n, first) = (plant.states(), plant.inputs() - controls);
    let mut d = Matrix::zeros(controls, plant.inputs());
    for j in 0..controls {
        d[(j, first + j)] = epsilon;
    }
    StateSpace {
        c: blocks(&[&[&plant.c], &[&Matrix::zeros(controls, n)]]),
        d: blocks(&[&[&plant.d], &[&d]]),
        ..plant.clone()
    }
}

/// The plant with states and controls among its performance outputs, and noises on states and measurements.
fn augmented(p: &StateSpace, controls: usize, measurements: usize, epsilon: f64) -> StateSpace {
    let n = p.states();
    let (nw, nz) = (p.inputs() - controls, p.outputs() - measurements);
    let small = |size: usize| Matrix::identity(size, size) * epsilon;
    let zero = Matrix::zeros;
    let part = |m: &Matrix, row, column, height, width| m.block(row, column, height, width);
    // Inputs [w; state noise; measurement noise; u], outputs [z; states; controls; y].
    let b = blocks(&[&[
        &part(&p.b, 0, 0, n, nw),
        &small(n),
        &zero(n, measurements),
        &part(&p.b, 0, nw, n, controls),
    ]]);
    let c = blocks(&[
        &[&part(&p.c, 0, 0, nz, n)],
        &[&small(n)],
        &[&zero(controls, n)],
        &[&part(&p.c, nz, 0, measurements, n)],
    ]);
    let noise = n + measurements;
    let d = blocks(&[
        &[
            &part(&p.d, 0, 0, nz, nw),
            &zero(nz, noise),
            &part(&p.d, 0, nw, nz, controls),
        ],
        &[&zero(n, nw), &zero(n, noise), &zero(n, controls)],
        &[&zero(controls, nw), &zero(controls, noise), &small(controls)],
        &[
            &part(&p.d, nz, 0, measurements, nw),
            &blocks(&[&[&zero(measurements, n), &small(measurements)]]),
            &part(&p.d, nz, nw, measurements, controls),
        ],
    ]);
    StateSpace {
        a: p.a.clone(),
        b,
        c,
        d,
    }
}

/// The plant as a function of p, with `s = ω (p + ε)/(1 + ε p)`: the right half-plane of p is the disc of s. `None` when a pole
/// lies on the far end of the disc.
fn disc(plant: &StateSpace, epsilon: f64) -> Option<StateSpace> {
    let n = plant.states();
    let speed = linalg::max_abs(&plant.a);
    let omega = if speed > 0.0 { speed } else { 1.0 };
    let a = &plant.a * (1.0 / omega);
    let eye = Matrix::identity(n, n);
    let e = &eye - &a * epsilon;
    let rate = linalg::solve(&e, &(&a - &eye * epsilon)).ok()?;
    let b = linalg::solve(&e, &(&plant.b * (1.0 / omega))).ok()?;
    // (sI − A)⁻¹ = (ε I + (I + ε Ã)(p I − Ã)⁻¹) E⁻¹/ω
    Some(StateSpace {
        c: &plant.c * (&eye + &rate * epsilon),
        d: &plant.d + &plant.c * &b * epsilon,
        a: rate,
        b,
    })
}

/// Gain that no controller can change on the boundary of the half-plane: at zero and infinite frequency, and at the modes and zeros
/// on the imaginary axis.
///
/// With any stabilising controller in place, the closed loops attainable by others are `T₁₁ + T₁₂ Q T₂₁` with Q and all of T
/// stable (Youla, Jabr and Bongiorno 1976): these can be evaluated where the plant itself has a pole.
fn boundary(p: &StateSpace, controls: usize, measurements: usize) -> Result<f64, LinalgError> {
    let n = p.states();
    let (nw, nz) = (p.inputs() - controls, p.outputs() - measurements);
    let part = |m: &Matrix, row, column, height, width| m.block(row, column, height, width);
    let t = |m: &Matrix| m.transpose();
    let (b1, b2) = (part(&p.b, 0, 0, n, nw), part(&p.b, 0, nw, n, controls));
    let (c1, c2) = (part(&p.c, 0, 0, nz, n), part(&p.c, nz, 0, measurements, n));
    let (d11, d12) = (part(&p.d, 0, 0, nz, nw), part(&p.d, 0, nw, nz, controls));
    let d21 = part(&p.d, nz, 0, measurements, nw);
    let (Some(f), Some(l)) = (regulator(&p.a, &b2)?, regulator(&t(&p.a), &t(&c2))?.map(|l| t(&l))) else {
        return Ok(0.0);
    };
    let (a_f, a_l) = (&p.a + &b2 * &f, &p.a + &l * &c2);
    let c_f = &c1 + &d12 * &f;
    let b_l = &b1 + &l * &d21;
    // T₁₁ in state and estimation error.
    let t11 = StateSpace {
        a: blocks(&[&[&a_f, &(&b2 * &f * -1.0)], &[&Matrix::zeros(n, n), &a_l]]),
        b: blocks(&[&[&b1], &[&b_l]]),
        c: blocks(&[&[&c_f, &(&d12 * &f * -1.0)]]),
        d: d11,
    };
    let t12 = StateSpace {
        a: a_f,
        b: b2.clone(),
        c: c_f,
        d: d12.clone(),
    };
    let t21 = StateSpace {
        a: a_l,
        b: b_l,
        c: c2.clone(),
        d: d21.clone(),
    };
    let mut frequencies = vec![0.0, f64::INFINITY];
    let mut spectra = vec![p.a.clone()];
    spectra.extend(zero_dynamics(&p.a, &b2, &c1, &d12)?);
    spectra.extend(zero_dynamics(&t(&p.a), &t(&c2), &t(&b1), &t(&d21))?);
    for a in spectra {
        let values = linalg::eigenvalues(&crate::balance::balanced(&a))?;
        let size = values.iter().map(|v| v.norm()).fold(0.0, f64::max);
        frequencies.extend(
            values
                .iter()
                .filter(|v| v.im > 0.0 && v.re.abs() <= 1e-9 * size)
                .map(|v| v.im),
        );
    }
    let mut level = 0.0f64;
    for omega in frequencies {
        let (g11, g12, g21) = (t11.at(omega), t12.at(omega), t21.at(omega));
        level = level.max(outside(&g12, &g11)?);
        level = level.max(outside(&linalg::adjoint(&g21), &linalg::adjoint(&g11))?);
    }
    Ok(level)
}

/// A stabilising state feedback `u = F x`: the linear-quadratic one with unit weights.
fn regulator(a: &Matrix, b: &Matrix) -> Result<Option<Matrix>, LinalgError> {
    let (n, m) = (b.nrows(), b.ncols());
    let c1 = blocks(&[&[&Matrix::identity(n, n)], &[&Matrix::zeros(m, n)]]);
    let d1 = blocks(&[&[&Matrix::zeros(n, m)], &[&Matrix::identity(m, m)]]);
    let x = riccati(a, b, &c1, &d1, 0, 1.0)?;
    Ok(x.map(|x| b.transpose() * x * -1.0))
}

/// Matrices with the zeros of `(a, b, c, d)` among their eigenvalues, where d has full column rank.
fn zero_dynamics(a: &Matrix, b: &Matrix, c: &Matrix, d: &Matrix) -> Result<Option<Matrix>, LinalgError> {
    let gram = d.transpose() * d;
    if linalg::reciprocal_condition(&gram)? < 1e-12 {
        return Ok(None);
    }
    Ok(Some(a - b * linalg::solve(&gram, &(d.transpose() * c))?))
}

/// The norm of the part of `m` outside the range of `d`, whatever its rank.
fn outside(d: &CMatrix, m: &CMatrix) -> Result<f64, LinalgError> {
    let (u, s, _) = linalg::svd(d)?;
    let largest = s.first().copied().unwrap_or(0.0);
    let rank = s.iter().filter(|x| **x > 1e-9 * largest).count();
    let basis = CMatrix::from_fn(d.nrows(), rank, |i, j| u[(i, j)]);
    let rest = m - &basis * (linalg::adjoint(&basis) * m);
    let norm = linalg::singular_values(&rest)?[0];
    // Rounding error does not count.
    let own = linalg::singular_values(m)?[0];
    Ok(if norm > 1e-10 * own { norm } else { 0.0 })
}
