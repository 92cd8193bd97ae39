//! The full-order H-infinity optimum: the least norm that any linear controller attains on the same plant.
//!
//! A structured optimum is local; the full-order optimum is global and bounds it from below, so the gap between the two is the
//! cost of the structure. Two Riccati equations and a coupling condition decide whether a level γ is attainable (Doyle, Glover,
//! Khargonekar and Francis 1989; the general form of Zhou, Doyle and Glover 1996, theorem 17.1); the optimum is found by
//! bisection. Plants without full effort weights or measurement noise, or with zeros on the imaginary axis, are bracketed by
//! regular ones (`singular.rs`).

mod regular;
mod riccati;
mod singular;

pub use regular::FullOrderError;

use crate::linalg::{self, LinalgError, Matrix};
use crate::state_space::StateSpace;
use regular::{RegularProblem, bisect, normalised, reference};
use riccati::riccati;

/// The optimum γ of all linear controllers for `plant` (inputs [w; u], outputs [z; y]): no controller reaches less than the
/// first number, and some controller reaches less than the second.
///
/// For a regular problem the two differ by `tolerance`, relative. The first is zero when the optimum is zero, or below 1e-7
/// of the plant's own gain. For a singular problem the bracket is as narrow as rounding permits.
///
/// # Errors
/// A plant that cannot be stabilised.
pub fn full_order_optimum(
    plant: &StateSpace,
    controls: usize,
    measurements: usize,
    tolerance: f64,
) -> Result<(f64, f64), FullOrderError> {
    let plant = normalised(plant, controls, measurements);
    let (nw, nz) = (plant.inputs() - controls, plant.outputs() - measurements);
    let loop_part = plant.select(nz..plant.outputs(), nw..plant.inputs()).balanced();
    for inputs in [true, false] {
        if !loop_part.fixed_unstable_modes(inputs)?.is_empty() {
            return Err(FullOrderError::Infeasible(f64::INFINITY));
        }
    }
    if let Some(problem) = RegularProblem::new(&plant, controls, measurements)?
        && let Some(found) = problem.search(tolerance)?
    {
        return Ok(found);
    }
    singular::bracket(&plant, controls, measurements, tolerance)
}

/// State feedbacks `u = F x` for a plant with inputs [w; u] and outputs z, at levels a millionth, a ten-thousandth and a
/// hundredth above the least one.
///
/// # Errors
/// A matrix computation that fails.
pub(crate) fn state_feedbacks(plant: &StateSpace, controls: usize) -> Result<Vec<Matrix>, LinalgError> {
    let nw = plant.inputs() - controls;
    let effort = plant.d.block(0, nw, plant.outputs(), controls);
    let gram = effort.transpose() * &effort;
    let plant = if linalg::reciprocal_condition(&gram)? < 1e-12 {
        // Unweighted control effort gets a small weight.
        singular::with_effort(plant, controls, 1e-4)
    } else {
        plant.clone()
    };
    let (c1, d1) = (&plant.c, &plant.d);
    let solve = |level: f64| riccati(&plant.a, &plant.b, c1, d1, nw, level);
    let Some((_, least)) = bisect(reference(&plant, nw, plant.outputs()), 0.0, 1e-7, |g| {
        Ok::<_, LinalgError>(solve(g)?.is_some())
    })?
    else {
        return Ok(Vec::new());
    };
    let mut out = Vec::new();
    for above in [1e-6, 1e-4, 1e-2] {
        let level = least * (1.0 + above);
        if let Some(x) = solve(level)? {
            let mut r = d1.transpose() * d1;
            (0..nw).for_each(|i| r[(i, i)] -= level * level);
            // [w; u] = −R⁻¹ (D₁ᵀ C₁ + Bᵀ X) x
            let both = linalg::solve(&r, &(d1.transpose() * c1 + plant.b.transpose() * x))?;
            out.push(both.block(nw, 0, controls, plant.states()) * -1.0);
        }
    }
    Ok(out)
}
