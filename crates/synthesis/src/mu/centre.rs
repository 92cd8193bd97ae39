//! Newton's method for the analytic centre of the scalings that prove a level.
//!
//! In the congruence that makes the certificate (and every barrier) the identity, the derivative of the potential along a
//! parameter is a trace and its Hessian a Gram matrix of real vectors: one real matrix product is the bulk of the work. A
//! parameter is one entry of D or G, so its image is a sum of a few dyads of columns that are computed once.

use super::scalings::{Parameter, ScalingProblem};
use super::structure::Block;
use crate::linalg::{self, CMatrix, LinalgError, Matrix, c64};

impl ScalingProblem<'_> {
    /// Potential at `x`: minus the logarithms of the determinants of the certificate and the barriers; `None` outside the domain.
    fn potential(&self, x: &[f64], level: f64) -> Option<f64> {
        let mut sum = log_det(&self.certificate(x, level))?;
        for barrier in self.barrier_matrices(x) {
            sum += log_det(&barrier)?;
        }
        Some(-sum)
    }

    fn barrier_matrices(&self, x: &[f64]) -> Vec<CMatrix> {
        let small = self.block_scalings(x);
        self.barriers()
            .iter()
            .map(|b| {
                let (d, g) = &small[b.block];
                CMatrix::from_fn(b.size, b.size, |i, j| d[(i, j)] * b.d + g[(i, j)] * b.g)
            })
            .collect()
    }

    /// Moves `x` to the analytic centre at level β², on the slice of constant trace of D; at most so many steps. Returns whether
    /// the centre was reached.
    pub(super) fn centre(&self, x: &mut Vec<f64>, level: f64, newton_steps: usize) -> Result<bool, LinalgError> {
        let n = self.parameters.len();
        let trace: Vec<f64> = self.identity();
        let barriers = self.barriers();
        let offsets: Vec<(Block, usize, usize)> = self.structure.blocks_with_offsets().collect();
        for _ in 0..newton_steps {
            let Some(current) = self.potential(x, level) else {
                return Ok(false);
            };
            let Some(whiten) = inverse_factor(&self.certificate(x, level)) else {
                return Ok(false);
            };
            let barrier_factors: Option<Vec<CMatrix>> = self.barrier_matrices(x).iter().map(inverse_factor).collect();
            let Some(barrier_factors) = barrier_factors else {
                return Ok(false);
            };
            let size = whiten.nrows();
            let right = columns(&whiten);
            let left = columns(&(&whiten * linalg::adjoint(self.m)));
            let barrier_factors: Vec<Vec<Vec<c64>>> = barrier_factors.iter().map(columns).collect();
            let width = size * size + barriers.iter().map(|b| b.size * b.size).sum::<usize>();
            let mut rows = Matrix::zeros(width, n);
            let mut gradient = vec![0.0; n];
            for (k, p) in self.parameters.iter().enumerate() {
                let column = rows.column_mut(k);
                let (head, mut tail) = column.split_at_mut(size * size);
                gradient[k] -= write_hermitian(&certificate_terms(p, offsets[p.block], level, &left, &right), head);
                for (barrier, w) in barriers.iter().zip(&barrier_factors) {
                    let (own, rest) = tail.split_at_mut(barrier.size * barrier.size);
                    tail = rest;
                    let factor = if p.is_g { barrier.g } else { barrier.d };
                    if barrier.block == p.block && factor != 0.0 {
                        gradient[k] -= write_hermitian(&[parameter_dyad(p, factor, &w[p.row], &w[p.column])], own);
                    }
                }
            }
            let mut hessian = rows.gram();
            // Every G for which G M is Hermitian has no effect (one always exists); a small ridge regularises those directions.
            let ridge = 1e-10 * (0..n).map(|k| hessian[(k, k)]).sum::<f64>() / n as f64;
            (0..n).for_each(|k| hessian[(k, k)] += ridge);
            // KKT system of the Newton step with Σ trace D held.
            let kkt = Matrix::from_fn(n + 1, n + 1, |i, j| match (i < n, j < n) {
                (true, true) => hessian[(i, j)],
                (true, false) => trace[i],
                (false, true) => trace[j],
                (false, false) => 0.0,
            });
            let rhs = Matrix::from_fn(n + 1, 1, |i, _| if i < n { -gradient[i] } else { 0.0 });
            let Ok(step) = linalg::solve(&kkt, &rhs) else {
                return Ok(false);
            };
            let decrement: f64 = -(0..n).map(|i| gradient[i] * step[(i, 0)]).sum::<f64>();
            if decrement.is_nan() || decrement < 1e-6 {
                return Ok(!decrement.is_nan());
            }
            let mut t = 1.0;
            loop {
                let trial: Vec<f64> = (0..n).map(|i| x[i] + t * step[(i, 0)]).collect();
                if self
                    .potential(&trial, level)
                    .is_some_and(|p| p <= current - 0.1 * t * decrement)
                {
                    *x = trial;
                    break;
                }
                t *= 0.5;
                if t < 1e-10 {
                    // The resolution of the potential under rounding is reached.
                    return Ok(decrement < 1e-2);
                }
            }
        }
        Ok(false)
    }

    /// Duality gap: how far below `level` the least β² can lie; `x` must be the centre of that level. `None` outside the domain.
    ///
    /// At the centre the inverse Z of the certificate, with those of the barriers, is a multiplier: for the scalings x' of
    /// any level λ' it makes `(level − λ') Tr(Z D(x')) ≤ ν Tr D'`, with ν the sum of all sizes over the trace of D here. The
    /// least eigenvalue of the blocks of Z bounds the ratio of the traces whatever x' is.
    pub(super) fn gap(&self, x: &[f64], level: f64) -> Result<Option<f64>, LinalgError> {
        let Some(whiten) = inverse_factor(&self.certificate(x, level)) else {
            return Ok(None);
        };
        let z = linalg::adjoint(&whiten) * &whiten;
        let mut least = f64::INFINITY;
        for (block, r, _) in self.structure.blocks_with_offsets() {
            let rows = block.rows();
            least = least.min(match block {
                Block::Full { .. } => (0..rows).map(|i| z[(r + i, r + i)].re).sum(),
                _ => {
                    let part = CMatrix::from_fn(rows, rows, |i, j| z[(r + i, r + j)]);
                    linalg::hermitian_eigen(&part)?.0[0]
                }
            });
        }
        let trace: f64 = self.identity().iter().zip(x).map(|(unit, value)| unit * value).sum();
        let sizes = z.nrows() + self.barriers().iter().map(|b| b.size).sum::<usize>();
        Ok((least > 0.0).then(|| sizes as f64 / (trace * least)))
    }
}

/// A Hermitian matrix `f x yᴴ + f̄ y xᴴ`.
struct Dyad<'a> {
    factor: c64,
    x: &'a [c64],
    y: &'a [c64],
}

/// The unit of a parameter in entry (row, column) and its mirror, times `factor`, between columns x and y of the congruence.
fn parameter_dyad<'a>(p: &Parameter, factor: f64, x: &'a [c64], y: &'a [c64]) -> Dyad<'a> {
    let factor = if p.row == p.column { 0.5 * factor } else { factor };
    Dyad {
        factor: if p.real_part {
            c64::new(factor, 0.0)
        } else {
            c64::new(0.0, factor)
        },
        x,
        y,
    }
}

/// The derivative of the certificate along a parameter, in the congruence: `right` has the columns of W, `left` those of W Mᴴ.
fn certificate_terms<'a>(
    p: &Parameter,
    (block, r, c): (Block, usize, usize),
    level: f64,
    left: &'a [Vec<c64>],
    right: &'a [Vec<c64>],
) -> Vec<Dyad<'a>> {
    match block {
        Block::Full { rows, columns } => {
            let inputs = (0..rows).map(|i| parameter_dyad(p, level, &right[r + i], &right[r + i]));
            let outputs = (0..columns).map(|i| parameter_dyad(p, -1.0, &left[c + i], &left[c + i]));
            inputs.chain(outputs).collect()
        }
        _ if p.is_g => {
            // −j (G M − Mᴴ G): the image of an entry of G is −j times a dyad of a right and a left column, and its adjoint.
            let unit = if p.real_part {
                c64::new(1.0, 0.0)
            } else {
                c64::new(0.0, 1.0)
            };
            let minus_j = c64::new(0.0, -1.0);
            let mut terms = vec![Dyad {
                factor: minus_j * unit,
                x: &right[r + p.row],
                y: &left[c + p.column],
            }];
            if p.row != p.column {
                terms.push(Dyad {
                    factor: minus_j * unit.conj(),
                    x: &right[r + p.column],
                    y: &left[c + p.row],
                });
            }
            terms
        }
        _ => vec![
            parameter_dyad(p, level, &right[r + p.row], &right[r + p.column]),
            parameter_dyad(p, -1.0, &left[c + p.row], &left[c + p.column]),
        ],
    }
}

fn columns(m: &CMatrix) -> Vec<Vec<c64>> {
    (0..m.ncols())
        .map(|j| (0..m.nrows()).map(|i| m[(i, j)]).collect())
        .collect()
}

/// Writes a Hermitian matrix as a real vector of the same inner product; returns its trace.
fn write_hermitian(terms: &[Dyad<'_>], out: &mut [f64]) -> f64 {
    let n = terms.first().map_or(0, |t| t.x.len());
    let (mut at, mut trace) = (0, 0.0);
    for j in 0..n {
        for i in 0..=j {
            let mut sum = c64::new(0.0, 0.0);
            for Dyad { factor, x, y } in terms {
                sum += factor * x[i] * y[j].conj() + factor.conj() * y[i] * x[j].conj();
            }
            if i == j {
                trace += sum.re;
                out[at] = sum.re;
                at += 1;
            } else {
                out[at] = std::f64::consts::SQRT_2 * sum.re;
                out[at + 1] = std::f64::consts::SQRT_2 * sum.im;
                at += 2;
            }
        }
    }
    trace
}

fn log_det(m: &CMatrix) -> Option<f64> {
    let l = linalg::factor(m)?;
    let sum: f64 = (0..m.nrows()).map(|i| 2.0 * libm::log(l[(i, i)].re)).sum();
    sum.is_finite().then_some(sum)
}

/// `L⁻¹` for `m = L Lᴴ`.
fn inverse_factor(m: &CMatrix) -> Option<CMatrix> {
    let lower = linalg::factor(m)?;
    Some(linalg::solve_lower(&lower, &CMatrix::identity(m.nrows(), m.nrows())))
}
