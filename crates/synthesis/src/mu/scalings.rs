//! The convex upper bound at one matrix: D and G scalings by the method of centres.
//!
//! μ(M) ≤ β whenever scalings D = Dᴴ ≻ 0 and G = Gᴴ, commuting with Δ (G only on real blocks), satisfy
//! `Mᴴ D M + j (G M − Mᴴ G) − β² D ⪯ 0` (Fan, Tits and Doyle 1991). The least such β² is the minimum of a generalised
//! eigenvalue over a convex set; the method of centres (Boyd and El Ghaoui 1993) finds it: take the analytic centre for a
//! feasible β, lower β towards what that centre proves, repeat. The centre itself is the scaling with the most slack on all
//! sides, which is what makes one scaling valid over a wide interval of frequencies.

use super::structure::{Block, MuError, Structure};
use crate::linalg::{self, CMatrix, LinalgError, c64};

/// Scalings that prove an upper bound.
#[derive(Debug, Clone)]
pub struct Scalings {
    /// D on the outputs of M (columns of Δ), block diagonal, Hermitian positive definite.
    pub d_left: CMatrix,
    /// D on the inputs of M (rows of Δ): the same numbers, repeated as the block's shape asks.
    pub d_right: CMatrix,
    /// G, Hermitian, zero outside real blocks; rows of Δ × columns of Δ.
    pub g: CMatrix,
}

/// An upper bound with its proof.
#[derive(Debug, Clone)]
pub struct UpperBound {
    /// μ ≤ this.
    pub value: f64,
    /// The scalings that prove it.
    pub scalings: Scalings,
}

/// One free real number of the scalings: a Hermitian matrix inside block `block`.
struct Parameter {
    block: usize,
    real_part: bool,
    row: usize,
    column: usize,
    is_g: bool,
}

pub(crate) struct Centres<'a> {
    structure: &'a Structure,
    m: &'a CMatrix,
    parameters: Vec<Parameter>,
    /// Size of the D of every block.
    sizes: Vec<usize>,
}

impl<'a> Centres<'a> {
    pub(crate) fn new(structure: &'a Structure, m: &'a CMatrix) -> Self {
        let mut parameters = Vec::new();
        let mut sizes = Vec::new();
        for (block, b) in structure.blocks().iter().enumerate() {
            let n = match *b {
                Block::Real(n) | Block::Complex(n) => n,
                Block::Full { .. } => 1,
            };
            sizes.push(n);
            for is_g in [false, true] {
                if is_g && !matches!(b, Block::Real(_)) {
                    continue;
                }
                for row in 0..n {
                    for column in 0..=row {
                        parameters.push(Parameter {
                            block,
                            real_part: true,
                            row,
                            column,
                            is_g,
                        });
                        if row != column {
                            parameters.push(Parameter {
                                block,
                                real_part: false,
                                row,
                                column,
                                is_g,
                            });
                        }
                    }
                }
            }
        }
        Self {
            structure,
            m,
            parameters,
            sizes,
        }
    }

    /// D = I, G = 0.
    pub(crate) fn neutral(&self) -> Vec<f64> {
        self.parameters
            .iter()
            .map(|p| f64::from(u8::from(!p.is_g && p.row == p.column)))
            .collect()
    }

    /// The small Hermitian matrices (D, G) of every block.
    fn small(&self, x: &[f64]) -> Vec<(CMatrix, CMatrix)> {
        let mut out: Vec<_> = self
            .sizes
            .iter()
            .map(|&n| (CMatrix::zeros(n, n), CMatrix::zeros(n, n)))
            .collect();
        for (p, &value) in self.parameters.iter().zip(x) {
            let target = if p.is_g {
                &mut out[p.block].1
            } else {
                &mut out[p.block].0
            };
            let unit = if p.real_part {
                c64::new(value, 0.0)
            } else {
                c64::new(0.0, value)
            };
            target[(p.row, p.column)] += unit;
            if p.row != p.column {
                target[(p.column, p.row)] += unit.conj();
            }
        }
        out
    }

    pub(crate) fn scalings(&self, x: &[f64]) -> Scalings {
        let (rows, columns) = (self.structure.rows(), self.structure.columns());
        let mut s = Scalings {
            d_left: CMatrix::zeros(columns, columns),
            d_right: CMatrix::zeros(rows, rows),
            g: CMatrix::zeros(rows, columns),
        };
        for ((block, r, c), (d, g)) in self.structure.placed().zip(self.small(x)) {
            match block {
                Block::Real(n) | Block::Complex(n) => {
                    for i in 0..n {
                        for j in 0..n {
                            s.d_left[(c + i, c + j)] = d[(i, j)];
                            s.d_right[(r + i, r + j)] = d[(i, j)];
                            s.g[(r + i, c + j)] = g[(i, j)];
                        }
                    }
                }
                Block::Full { rows, columns } => {
                    (0..columns).for_each(|i| s.d_left[(c + i, c + i)] = d[(0, 0)]);
                    (0..rows).for_each(|i| s.d_right[(r + i, r + i)] = d[(0, 0)]);
                }
            }
        }
        s
    }

    /// `Mᴴ D M + j (G M − Mᴴ G)`.
    fn image(&self, s: &Scalings) -> CMatrix {
        let gm = &s.g * self.m;
        let dm = linalg::adjoint(self.m) * (&s.d_left * self.m);
        CMatrix::from_fn(dm.nrows(), dm.ncols(), |i, j| {
            dm[(i, j)] + c64::new(0.0, 1.0) * (gm[(i, j)] - gm[(j, i)].conj())
        })
    }

    /// The least β² that the scalings at `x` prove; may be negative, and then no Δ of any size is singular here.
    pub(crate) fn proved(&self, x: &[f64]) -> Result<f64, LinalgError> {
        let s = self.scalings(x);
        let image = self.image(&s);
        // Generalised eigenvalue: with D = L Lᴴ, the largest eigenvalue of L⁻¹ image L⁻ᴴ.
        let l = s
            .d_right
            .llt(faer::Side::Lower)
            .map_err(|_| LinalgError::NotPositiveDefinite {
                size: image.nrows(),
                least: 0.0,
            })?;
        let lower = l.L().to_owned();
        let half = linalg::solve_complex(&lower, &image);
        let both = linalg::solve_complex(&lower, &linalg::adjoint(&half));
        Ok(*linalg::hermitian_eigen(&both)?.0.last().unwrap_or(&0.0))
    }

    /// Potential `−log det(β² D − image) − log det D` at `x`; `None` outside the domain.
    fn potential(&self, x: &[f64], level: f64) -> Option<f64> {
        let s = self.scalings(x);
        let image = self.image(&s);
        let f = CMatrix::from_fn(image.nrows(), image.ncols(), |i, j| {
            s.d_right[(i, j)] * level - image[(i, j)]
        });
        let mut sum = log_det(&f)?;
        for (d, _) in self.small(x) {
            sum += log_det(&d)?;
        }
        Some(-sum)
    }

    /// Newton's method for the analytic centre at level β², on the slice of constant trace of D.
    pub(crate) fn centre(&self, x: &mut Vec<f64>, level: f64, newton_steps: usize) -> Result<(), LinalgError> {
        let n = self.parameters.len();
        let trace: Vec<f64> = self.neutral();
        for _ in 0..newton_steps {
            let Some(here) = self.potential(x, level) else {
                return Ok(());
            };
            let s = self.scalings(x);
            let image = self.image(&s);
            let f = CMatrix::from_fn(image.nrows(), image.ncols(), |i, j| {
                s.d_right[(i, j)] * level - image[(i, j)]
            });
            let small = self.small(x);
            let size = f.nrows();
            // In the congruence that makes F (and every D) the identity, the derivative of the potential along a parameter is a
            // trace and its Hessian a Gram matrix of real vectors: one real product does the bulk of the work.
            let Some(whiten) = inverse_factor(&f) else {
                return Ok(());
            };
            let little: Option<Vec<CMatrix>> = small.iter().map(|(d, _)| inverse_factor(d)).collect();
            let Some(little) = little else { return Ok(()) };
            let offsets: Vec<usize> = self
                .sizes
                .iter()
                .scan(size * size, |at, n| {
                    let here = *at;
                    *at += n * n;
                    Some(here)
                })
                .collect();
            let width = size * size + self.sizes.iter().map(|n| n * n).sum::<usize>();
            let mut rows = crate::linalg::Matrix::zeros(width, n);
            let mut gradient = vec![0.0; n];
            let mut unit = vec![0.0; n];
            for k in 0..n {
                unit[k] = 1.0;
                let e = self.scalings(&unit);
                let image = self.image(&e);
                let slope = CMatrix::from_fn(size, size, |i, j| e.d_right[(i, j)] * level - image[(i, j)]);
                gradient[k] -= store(&(&whiten * slope * linalg::adjoint(&whiten)), &mut rows, 0, k);
                let p = &self.parameters[k];
                if !p.is_g {
                    let w = &little[p.block];
                    let own = w * &self.small(&unit)[p.block].0 * linalg::adjoint(w);
                    gradient[k] -= store(&own, &mut rows, offsets[p.block], k);
                }
                unit[k] = 0.0;
            }
            let mut hessian = rows.transpose() * &rows;
            // Every G for which G M is Hermitian changes nothing (one always exists); a little ridge pins those directions.
            let ridge = 1e-10 * (0..n).map(|k| hessian[(k, k)]).sum::<f64>() / n as f64;
            (0..n).for_each(|k| hessian[(k, k)] += ridge);
            // KKT system of the Newton step with Σ trace D held.
            let kkt = crate::linalg::Matrix::from_fn(n + 1, n + 1, |i, j| match (i < n, j < n) {
                (true, true) => hessian[(i, j)],
                (true, false) => trace[i],
                (false, true) => trace[j],
                (false, false) => 0.0,
            });
            let rhs = crate::linalg::Matrix::from_fn(n + 1, 1, |i, _| if i < n { -gradient[i] } else { 0.0 });
            let Ok(step) = linalg::solve(&kkt, &rhs) else {
                return Ok(());
            };
            let decrement: f64 = -(0..n).map(|i| gradient[i] * step[(i, 0)]).sum::<f64>();
            if decrement.is_nan() || decrement < 1e-6 {
                return Ok(());
            }
            let mut t = 1.0;
            loop {
                let trial: Vec<f64> = (0..n).map(|i| x[i] + t * step[(i, 0)]).collect();
                if self
                    .potential(&trial, level)
                    .is_some_and(|p| p <= here - 0.1 * t * decrement)
                {
                    *x = trial;
                    break;
                }
                t *= 0.5;
                if t < 1e-10 {
                    return Ok(());
                }
            }
        }
        Ok(())
    }
}

fn log_det(m: &CMatrix) -> Option<f64> {
    let factor = m.llt(faer::Side::Lower).ok()?;
    let l = factor.L();
    let sum: f64 = (0..m.nrows()).map(|i| 2.0 * l[(i, i)].re.ln()).sum();
    sum.is_finite().then_some(sum)
}

/// `L⁻¹` for `m = L Lᴴ`.
fn inverse_factor(m: &CMatrix) -> Option<CMatrix> {
    let lower = m.llt(faer::Side::Lower).ok()?.L().to_owned();
    Some(linalg::solve_complex(&lower, &CMatrix::identity(m.nrows(), m.nrows())))
}

/// Writes a Hermitian matrix as a real vector of the same inner product into column k, from row `at` on; returns its trace.
fn store(h: &CMatrix, rows: &mut crate::linalg::Matrix, at: usize, k: usize) -> f64 {
    let mut row = at;
    let mut trace = 0.0;
    for j in 0..h.nrows() {
        for i in 0..h.nrows() {
            rows[(row, k)] = if i == j {
                trace += h[(i, i)].re;
                h[(i, i)].re
            } else if i < j {
                std::f64::consts::SQRT_2 * h[(i, j)].re
            } else {
                std::f64::consts::SQRT_2 * h[(i, j)].im
            };
            row += 1;
        }
    }
    trace
}

/// Whether `level² D − Mᴴ D M − j (G M − Mᴴ G)` is positive definite at this matrix.
pub(crate) fn holds(m: &CMatrix, s: &Scalings, level: f64) -> Result<bool, LinalgError> {
    let gm = &s.g * m;
    let dm = linalg::adjoint(m) * (&s.d_left * m);
    let f = CMatrix::from_fn(dm.nrows(), dm.ncols(), |i, k| {
        s.d_right[(i, k)] * (level * level) - dm[(i, k)] - c64::new(0.0, 1.0) * (gm[(i, k)] - gm[(k, i)].conj())
    });
    Ok(linalg::hermitian_eigen(&f)?.0.first().is_none_or(|least| *least > 0.0))
}

/// Upper bound of μ at one matrix, to the relative accuracy `tolerance` of the convex problem (1e-6 is comfortable).
///
/// M has as many rows as Δ has columns and the other way round.
///
/// # Errors
/// Blocks that do not fit the matrix, an eigenvalue iteration that does not converge.
pub fn upper_bound(m: &CMatrix, structure: &Structure, tolerance: f64) -> Result<UpperBound, MuError> {
    bound_until(m, structure, tolerance, f64::NEG_INFINITY, None)
}

/// As [`upper_bound`], but content with any proof of `enough` or less; `enough` is also the level at which the scalings
/// returned are then centred.
pub(crate) fn bound_until(
    m: &CMatrix,
    structure: &Structure,
    tolerance: f64,
    enough: f64,
    start: Option<&[f64]>,
) -> Result<UpperBound, MuError> {
    structure.check(m.nrows(), m.ncols())?;
    let size = linalg::singular_values(m)?[0];
    let centres = Centres::new(structure, m);
    let mut x = start.map_or_else(|| centres.neutral(), <[f64]>::to_vec);
    if size == 0.0 {
        return Ok(UpperBound {
            value: 0.0,
            scalings: centres.scalings(&x),
        });
    }
    let floor = (1e-9 * size).powi(2);
    let mut best = (centres.proved(&x)?, x.clone());
    let mut level = best.0.max(floor) * 1.5;
    let target = if enough > 0.0 {
        enough * enough
    } else {
        f64::NEG_INFINITY
    };
    // What a centre proves falls by a constant factor of the distance to the optimum; a stall ends the loop.
    let mut stalled = 0;
    for _ in 0..80 {
        if best.0 < target {
            // Enough is proved. The centre for that level has the most slack, which is what an interval needs.
            x.clone_from(&best.1);
            centres.centre(&mut x, target, 30)?;
            let value = centres.proved(&x)?;
            if value < target {
                best = (value, x);
            }
            break;
        }
        centres.centre(&mut x, level, 20)?;
        let proved = centres.proved(&x)?;
        let before = best.0;
        if proved < best.0 {
            best = (proved, x.clone());
        }
        if best.0 <= floor {
            break;
        }
        let gap = level - best.0;
        if gap <= tolerance * best.0.abs() {
            break;
        }
        stalled = if before - best.0 <= 0.01 * tolerance * before.abs() {
            stalled + 1
        } else {
            0
        };
        if stalled >= 6 {
            break;
        }
        level = best.0 + 0.2 * gap;
    }
    let value = if best.0 <= floor { 0.0 } else { best.0.sqrt() };
    Ok(UpperBound {
        value,
        scalings: centres.scalings(&best.1),
    })
}
