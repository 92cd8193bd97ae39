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
    /// D on the inputs of M (rows of Δ): the same numbers, repeated according to the block's shape.
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
pub(super) struct Parameter {
    pub(super) block: usize,
    pub(super) real_part: bool,
    pub(super) row: usize,
    pub(super) column: usize,
    pub(super) is_g: bool,
}

/// The convex problem at one matrix, in the free numbers of D and G.
pub(super) struct ScalingProblem<'a> {
    pub(super) structure: &'a Structure,
    pub(super) m: &'a CMatrix,
    pub(super) parameters: Vec<Parameter>,
    /// Size of the D of every block.
    sizes: Vec<usize>,
    /// If given, G is kept between ± this many times D.
    g_limit: Option<f64>,
}

/// One positive definite matrix of a block that the barrier keeps so: `d D + g G`.
pub(super) struct Barrier {
    pub(super) block: usize,
    pub(super) size: usize,
    pub(super) d: f64,
    pub(super) g: f64,
}

impl<'a> ScalingProblem<'a> {
    pub(super) fn new(structure: &'a Structure, m: &'a CMatrix, g_limit: Option<f64>) -> Self {
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
            g_limit,
        }
    }

    /// Matrices that must stay positive definite besides the certificate: D of every block or, where G is limited, both distances
    /// of G from its limit (which implies D).
    pub(super) fn barriers(&self) -> Vec<Barrier> {
        let mut out = Vec::new();
        for (block, (b, &size)) in self.structure.blocks().iter().zip(&self.sizes).enumerate() {
            match self.g_limit {
                Some(limit) if matches!(b, Block::Real(_)) => {
                    out.extend([1.0, -1.0].map(|g| Barrier {
                        block,
                        size,
                        d: limit,
                        g,
                    }));
                }
                _ => out.push(Barrier {
                    block,
                    size,
                    d: 1.0,
                    g: 0.0,
                }),
            }
        }
        out
    }

    /// D = I, G = 0.
    pub(super) fn identity(&self) -> Vec<f64> {
        self.parameters
            .iter()
            .map(|p| f64::from(u8::from(!p.is_g && p.row == p.column)))
            .collect()
    }

    /// The small Hermitian matrices (D, G) of every block.
    pub(super) fn block_scalings(&self, x: &[f64]) -> Vec<(CMatrix, CMatrix)> {
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

    pub(super) fn scalings(&self, x: &[f64]) -> Scalings {
        let (rows, columns) = (self.structure.rows(), self.structure.columns());
        let mut s = Scalings {
            d_left: CMatrix::zeros(columns, columns),
            d_right: CMatrix::zeros(rows, rows),
            g: CMatrix::zeros(rows, columns),
        };
        for ((block, r, c), (d, g)) in self.structure.blocks_with_offsets().zip(self.block_scalings(x)) {
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
    pub(super) fn image(&self, s: &Scalings) -> CMatrix {
        let gm = &s.g * self.m;
        let dm = linalg::adjoint(self.m) * (&s.d_left * self.m);
        CMatrix::from_fn(dm.nrows(), dm.ncols(), |i, j| {
            dm[(i, j)] + c64::new(0.0, 1.0) * (gm[(i, j)] - gm[(j, i)].conj())
        })
    }

    /// The least β² that the scalings at `x` prove; may be negative, and then no Δ of any size is singular here.
    pub(super) fn proved_level(&self, x: &[f64]) -> Result<f64, LinalgError> {
        let s = self.scalings(x);
        let image = self.image(&s);
        // Generalised eigenvalue: with D = L Lᴴ, the largest eigenvalue of L⁻¹ image L⁻ᴴ.
        let lower = linalg::factor(&s.d_right).ok_or(LinalgError::NotPositiveDefinite {
            size: image.nrows(),
            least: 0.0,
        })?;
        let half = linalg::solve_lower(&lower, &image);
        let both = linalg::solve_lower(&lower, &linalg::adjoint(&half));
        Ok(*linalg::hermitian_eigen(&both)?.0.last().unwrap_or(&0.0))
    }

    /// The certificate `β² D − image` at `x`, positive definite inside the domain.
    pub(super) fn certificate(&self, x: &[f64], level: f64) -> CMatrix {
        let s = self.scalings(x);
        let image = self.image(&s);
        CMatrix::from_fn(image.nrows(), image.ncols(), |i, j| {
            s.d_right[(i, j)] * level - image[(i, j)]
        })
    }
}

/// Whether `level² D − Mᴴ D M − j (G M − Mᴴ G)` is positive definite at this matrix.
pub(super) fn certificate_holds(m: &CMatrix, s: &Scalings, level: f64) -> Result<bool, LinalgError> {
    let gm = &s.g * m;
    let dm = linalg::adjoint(m) * (&s.d_left * m);
    let f = CMatrix::from_fn(dm.nrows(), dm.ncols(), |i, k| {
        s.d_right[(i, k)] * (level * level) - dm[(i, k)] - c64::new(0.0, 1.0) * (gm[(i, k)] - gm[(k, i)].conj())
    });
    Ok(linalg::hermitian_eigen(&f)?.0.first().is_none_or(|least| *least > 0.0))
}

/// Largest number of centring steps for one bound; a centred step leaves one fifth of the remaining distance.
const ROUNDS: usize = 120;

/// Upper bound of μ at one matrix, to the relative accuracy `tolerance` of the convex problem (1e-6 is comfortable).
///
/// M has as many rows as Δ has columns and the other way round.
///
/// # Errors
/// Blocks that do not fit the matrix, an eigenvalue iteration that does not converge.
pub fn upper_bound(m: &CMatrix, structure: &Structure, tolerance: f64) -> Result<UpperBound, MuError> {
    let mut bound = bound_until(m, structure, tolerance, f64::NEG_INFINITY, None)?;
    // At the least value the certificate is singular, and its sign is decided by rounding. The returned value is one at which the
    // certificate, as evaluated, holds.
    let mut raised = 1e-12;
    while bound.value > 0.0 && raised < 1e-7 && !certificate_holds(m, &bound.scalings, bound.value)? {
        bound.value *= 1.0 + raised;
        raised *= 2.0;
    }
    Ok(bound)
}

/// As [`upper_bound`], but any proof of `enough` or less suffices, which is also the level at which the returned scalings are then
/// centred; `g_limit` keeps G between ± that many times D.
pub(super) fn bound_until(
    m: &CMatrix,
    structure: &Structure,
    tolerance: f64,
    enough: f64,
    g_limit: Option<f64>,
) -> Result<UpperBound, MuError> {
    structure.check(m.nrows(), m.ncols())?;
    let size = linalg::singular_values(m)?[0];
    let problem = ScalingProblem::new(structure, m, g_limit);
    let mut x = problem.identity();
    if size == 0.0 {
        return Ok(UpperBound {
            value: 0.0,
            scalings: problem.scalings(&x),
        });
    }
    let floor = (1e-9 * size).powi(2);
    let mut proved = problem.proved_level(&x)?;
    let mut best = (proved, x.clone());
    let mut level = proved.max(floor) * 1.5;
    let target = if enough > 0.0 {
        enough * enough
    } else {
        f64::NEG_INFINITY
    };
    // Every centre proves less than its level, so it lies in the domain of the next level, between the two. An intermediate point
    // may have proved an even lower level, but this centre need not lie in the domain of that level.
    let certain = m.nrows().max(m.ncols()) as f64;
    for _ in 0..ROUNDS {
        if best.0 < target {
            // `enough` is proved. The centre for that level has the most slack, which an interval needs.
            x.clone_from(&best.1);
            problem.centre(&mut x, target, 30)?;
            let value = problem.proved_level(&x)?;
            if value < target {
                best = (value, x);
            }
            break;
        }
        let centred = problem.centre(&mut x, level, 20)?;
        let before = proved;
        proved = problem.proved_level(&x)?;
        if proved < best.0 {
            best = (proved, x.clone());
        }
        if best.0 <= floor {
            break;
        }
        if centred {
            let enough = tolerance * best.0;
            let gap = problem.gap(&x, level)?.unwrap_or(f64::INFINITY);
            // Blocks that do not matter at the optimum leave the dual bound loose; there the slack itself is the measure.
            if best.0 - (level - gap) <= enough || level - proved <= 0.1 * enough / certain {
                break;
            }
        } else if before - proved <= 1e-3 * tolerance * proved && level - proved <= tolerance * proved {
            // Rounding prevents the centre from being reached, and the remaining gap is below the requested accuracy.
            break;
        }
        let resolved = level - proved > 4.0 * f64::EPSILON * level;
        if !resolved {
            break;
        }
        level = proved + if centred { 0.2 } else { 0.8 } * (level - proved);
    }
    let value = if best.0 <= floor { 0.0 } else { best.0.sqrt() };
    Ok(UpperBound {
        value,
        scalings: problem.scalings(&best.1),
    })
}
