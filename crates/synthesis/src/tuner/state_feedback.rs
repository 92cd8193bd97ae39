//! Start value from the Riccati equation, for full state measurement.
//!
//! Static state feedback attains the optimum of all controllers that measure the state, and that optimum is known from one
//! Riccati equation (Doyle, Glover, Khargonekar and Francis 1989). With many states a descent from a distant start stalls; from
//! this solution it only has to confirm the optimum.

use super::gains::GainKind;
use super::growth_penalty;
use super::objective::Objective;
use super::problem::ValidatedProblem;
use crate::full_order;
use crate::linalg::{self, LinalgError, Matrix};

/// The parameters of the best state feedback; `None` if the problem is of another kind: several models or channels, gains that
/// are not free, measurements that do not determine the state.
pub(super) fn start(checked: &ValidatedProblem) -> Result<Option<Vec<f64>>, LinalgError> {
    let ([model], [gain]) = (&checked.models[..], &checked.gains[..]) else {
        return Ok(None);
    };
    let [channel] = &model.channels[..] else {
        return Ok(None);
    };
    let is_full_gain = gain.block.kind
        == GainKind::Full {
            rows: model.controls,
            columns: model.measurements,
        };
    let p = &model.plant;
    let n = p.states();
    let (nw, nz) = (p.inputs() - model.controls, p.outputs() - model.measurements);
    let measured = p.c.block(nz, 0, model.measurements, n);
    let direct = p.d.block(nz, 0, model.measurements, p.inputs());
    if !is_full_gain
        || model.transforms[0].is_some()
        || linalg::max_abs(&direct) > 0.0
        || model.measurements < n
        || n == 0
    {
        return Ok(None);
    }
    let gram = measured.transpose() * &measured;
    if linalg::reciprocal_condition(&gram)? < 1e-12 {
        return Ok(None);
    }
    let to_state = linalg::solve(&gram, &measured.transpose())?;
    // The plant of this channel alone.
    let mut plant = p.select(channel.outputs.clone(), 0..p.inputs());
    plant = {
        let columns: Vec<usize> = channel.inputs.clone().chain(nw..p.inputs()).collect();
        crate::state_space::StateSpace {
            b: Matrix::from_fn(n, columns.len(), |i, j| plant.b[(i, columns[j])]),
            d: Matrix::from_fn(plant.outputs(), columns.len(), |i, j| plant.d[(i, columns[j])]),
            ..plant
        }
    };
    let mut objective = Objective::new(checked, 1e-7, 1);
    let mut best: Option<(f64, Vec<f64>)> = None;
    for feedback in full_order::state_feedbacks(&plant, model.controls)? {
        let k = feedback * &to_state;
        let start = &gain.block.start;
        let x: Vec<f64> = (0..k.nrows())
            .flat_map(|i| (0..k.ncols()).map(move |j| (i, j)))
            .map(|(i, j)| (k[(i, j)] - start[(i, j)]) / gain.block.unit)
            .collect();
        let Some((penalty, _)) = growth_penalty::penalty(checked, &x, growth_penalty::WEIGHT) else {
            continue;
        };
        let Ok((value, _)) = objective.norm(&x, f64::INFINITY) else {
            continue;
        };
        let total = libm::log(value.gamma) + penalty;
        if value.gamma.is_finite() && best.as_ref().is_none_or(|b| total < b.0) {
            best = Some((total, x));
        }
    }
    Ok(best.map(|b| b.1))
}
