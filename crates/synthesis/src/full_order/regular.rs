//! Regular H-infinity problems, solved by bisection.

use super::riccati::riccati;
use crate::linalg::{self, LinalgError, Matrix, blocks};
use crate::state_space::StateSpace;

/// Errors of computing the optimum.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FullOrderError {
    /// No level up to the largest tried is attainable.
    #[error("no controller reaches gamma = {0:.3e}: the plant cannot be stabilised")]
    Infeasible(f64),
    /// A matrix computation failed.
    #[error(transparent)]
    Linalg(#[from] LinalgError),
}

/// The plant with every column of D12 and every row of D21 of size one, which only changes the units of control and
/// measurement; balanced.
pub(super) fn normalised(plant: &StateSpace, controls: usize, measurements: usize) -> StateSpace {
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
    plant.scaled(&left, &right).balanced()
}

/// A level of the order of the plant's own gain, from the sizes of its matrices.
pub(super) fn reference(plant: &StateSpace, nw: usize, nz: usize) -> f64 {
    let size = |m: &Matrix, row, column, height, width| linalg::max_abs(&m.block(row, column, height, width));
    let n = plant.states();
    let speed = linalg::max_abs(&plant.a);
    let through = size(&plant.b, 0, 0, n, nw) * size(&plant.c, 0, 0, nz, n);
    let direct = size(&plant.d, 0, 0, nz, nw);
    let level = direct + if speed > 0.0 { through / speed } else { through };
    if level > 0.0 { level } else { 1.0 }
}

/// The least level above `floor` that is `reachable`, as a bracket of relative width `tolerance`; `None` when none is.
pub(super) fn bisect<E>(
    start: f64,
    floor: f64,
    tolerance: f64,
    reachable: impl Fn(f64) -> Result<bool, E>,
) -> Result<Option<(f64, f64)>, E> {
    const LOWEST: f64 = 1e-7;
    const HIGHEST: f64 = 1e12;
    let mut high = start.max(1.01 * floor);
    let mut low = floor;
    if reachable(high)? {
        let mut trial = 0.25 * high;
        while trial > floor && reachable(trial)? {
            high = trial;
            if high <= LOWEST * start {
                return Ok(Some((floor, high)));
            }
            trial *= 0.25;
        }
        low = low.max(trial);
    } else {
        loop {
            low = high;
            high *= 4.0;
            if high > HIGHEST * start {
                return Ok(None);
            }
            if reachable(high)? {
                break;
            }
        }
    }
    while high - low > tolerance * high {
        let middle = if low > 0.0 { (low * high).sqrt() } else { 0.5 * high };
        if middle <= low || middle >= high {
            break;
        }
        if reachable(middle)? {
            high = middle
        } else {
            low = middle
        }
    }
    Ok(Some((low, high)))
}

/// The part of `m` outside the range of `d`, which must have independent columns.
fn project_out(d: &Matrix, m: &Matrix) -> Result<Option<Matrix>, LinalgError> {
    let gram = d.transpose() * d;
    if linalg::reciprocal_condition(&gram)? < 1e-15 {
        return Ok(None);
    }
    Ok(Some(m - d * linalg::solve(&gram, &(d.transpose() * m))?))
}

/// A regular problem: D12 has full column rank, D21 full row rank.
pub(super) struct RegularProblem {
    plant: StateSpace,
    b1: Matrix,
    c1: Matrix,
    d11: Matrix,
    d12: Matrix,
    d21: Matrix,
    nw: usize,
    nz: usize,
    /// The least level from the feedthrough alone (Parrott): the gain at infinite frequency that no controller can change.
    floor: f64,
}

impl RegularProblem {
    /// `None` for a plant without full effort weights or without full measurement noise.
    pub(super) fn new(p: &StateSpace, controls: usize, measurements: usize) -> Result<Option<Self>, LinalgError> {
        let n = p.states();
        let (nw, nz) = (p.inputs() - controls, p.outputs() - measurements);
        let d11 = p.d.block(0, 0, nz, nw);
        let d12 = p.d.block(0, nw, nz, controls);
        let d21 = p.d.block(nz, 0, measurements, nw);
        let Some(outputs) = project_out(&d12, &d11)? else {
            return Ok(None);
        };
        let Some(inputs) = project_out(&d21.transpose(), &d11.transpose())? else {
            return Ok(None);
        };
        // The rounding residue of the projection does not count.
        let rounding = 1e-14 * linalg::norm2(&d11)?;
        let floor = linalg::norm2(&outputs)?.max(linalg::norm2(&inputs)?);
        Ok(Some(Self {
            b1: p.b.block(0, 0, n, nw),
            c1: p.c.block(0, 0, nz, n),
            d11,
            d12,
            d21,
            nw,
            nz,
            plant: p.clone(),
            floor: if floor > rounding { floor } else { 0.0 },
        }))
    }

    /// The bracket of the optimum; `None` when no level is attainable.
    pub(super) fn search(&self, tolerance: f64) -> Result<Option<(f64, f64)>, LinalgError> {
        let start = reference(&self.plant, self.nw, self.nz);
        bisect(start, self.floor, tolerance, |level| self.reachable(level))
    }

    /// Whether some controller keeps the norm below `level`.
    fn reachable(&self, level: f64) -> Result<bool, LinalgError> {
        let p = &self.plant;
        // Control: D1• = [D11 D12], all inputs.
        let d1 = blocks(&[&[&self.d11, &self.d12]]);
        let Some(x) = riccati(&p.a, &p.b, &self.c1, &d1, self.nw, level)? else {
            return Ok(false);
        };
        // Filtering: the same for the transposed plant.
        let t = |m: &Matrix| m.transpose();
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
