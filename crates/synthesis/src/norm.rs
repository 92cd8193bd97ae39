//! The H-infinity norm, by Hamiltonian level sets.
//!
//! `‖G‖∞ = sup_ω σ_max(G(jω))`. For a level γ above the gain at infinite frequency, γ is a singular value of G(jω)
//! exactly when jω is an eigenvalue of a Hamiltonian matrix (Boyd, Balakrishnan and Kabamba 1989). The two-step iteration
//! of Bruinsma and Steinbuch 1990 raises a lower bound to the gain at the midpoints of the frequencies found and ends when
//! no eigenvalue is left on the imaginary axis.
//!
//! Deciding whether a computed eigenvalue "is" imaginary is the weak point of the method. Here the tolerance is wide, and
//! every candidate is verified by evaluating the gain there: a false one costs one evaluation and causes no error. A true
//! crossing is lost only if rounding moves its eigenvalue out of the tolerance. Just above the gain at infinite frequency the
//! Hamiltonian does this: it contains the inverse of R = γ² I − DᵀD, which is nearly singular there. There the eigenvalues of a
//! larger pencil without an inverse are used as well.

use crate::balance;
use crate::linalg::{self, LinalgError, Matrix, c64};
use crate::state_space::StateSpace;

/// Errors of computing a norm.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum NormError {
    /// The norm is infinite.
    #[error("the system is not stable (spectral abscissa {0:.6e})")]
    Unstable(f64),
    /// A matrix computation failed.
    #[error(transparent)]
    Linalg(#[from] LinalgError),
}

/// The result of [`hinf_norm`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HinfNorm {
    /// The largest gain found; attained at `omega`.
    pub gain: f64,
    /// The frequency of the peak, rad per unit of time; may be zero or infinite.
    pub omega: f64,
    /// No frequency has a gain above this level: `gain · (1 + tolerance)`.
    pub upper: f64,
}

/// Largest singular value of G(jω).
///
/// # Errors
/// No convergence of the singular-value iteration.
pub fn gain_at(g: &StateSpace, omega: f64) -> Result<f64, LinalgError> {
    Ok(linalg::singular_values(&g.at(omega))?[0])
}

/// `‖G‖∞` to the relative accuracy `tolerance` (1e-7 is a good choice; below 1e-10 rounding decides).
///
/// # Errors
/// [`NormError::Unstable`] when a pole is not in the open left half-plane.
pub fn hinf_norm(g: &StateSpace, tolerance: f64) -> Result<HinfNorm, NormError> {
    let g = g.balanced();
    let poles = g.poles()?;
    let abscissa = poles.iter().map(|p| p.re).fold(f64::NEG_INFINITY, f64::max);
    if abscissa >= 0.0 {
        return Err(NormError::Unstable(abscissa));
    }
    let mut start = vec![0.0, f64::INFINITY];
    start.extend(peak_guesses(&poles));
    Ok(level_set_iteration(&g, tolerance, &start)?)
}

/// Frequencies at which a system with these poles may peak, sorted and thinned.
pub(crate) fn peak_guesses(poles: &[c64]) -> Vec<f64> {
    let mut guesses: Vec<f64> = Vec::new();
    for p in poles.iter().filter(|p| p.im >= 0.0) {
        let size = p.norm();
        if p.im > 0.0 {
            // The resonance of a second-order pair, and the damped frequency itself.
            guesses.push((size * size - 2.0 * p.re * p.re).max(0.25 * size * size).sqrt());
            guesses.push(p.im);
        } else if size > 0.0 {
            guesses.push(size);
        }
    }
    guesses.sort_by(f64::total_cmp);
    guesses.dedup_by(|a, b| (*a - *b).abs() <= 1e-9 * b.abs());
    guesses
}

/// The level-set iteration on a stable, balanced system from a set of starting frequencies.
pub(crate) fn level_set_iteration(g: &StateSpace, tolerance: f64, start: &[f64]) -> Result<HinfNorm, LinalgError> {
    let mut best = HinfNorm {
        gain: 0.0,
        omega: 0.0,
        upper: 0.0,
    };
    for &omega in start {
        update_peak(g, omega, &mut best)?;
    }
    let tiny = f64::MIN_POSITIVE.sqrt();
    // Convergence is quadratic: the bound is only there for degenerate rounding.
    for _ in 0..60 {
        let level = (best.gain * (1.0 + tolerance)).max(tiny);
        let crossings = level_crossings(g, level)?;
        let before = best.gain;
        for pair in crossings.windows(2) {
            update_peak(g, 0.5 * (pair[0] + pair[1]), &mut best)?;
        }
        for &omega in &crossings {
            update_peak(g, omega, &mut best)?;
        }
        if best.gain <= before * (1.0 + 0.5 * tolerance) {
            break;
        }
    }
    climb(g, tolerance, &mut best)?;
    best.upper = best.gain * (1.0 + tolerance);
    Ok(best)
}

/// Raises the peak to the local maximum of the gain itself, where rounding error of the eigenvalues has left it beside that.
///
/// Just below a peak two crossings nearly coincide, and rounding moves them by its root: in loops of large gains that nearly cancel,
/// by a tenth of their frequency. Two evaluations where there is nothing to gain.
fn climb(g: &StateSpace, tolerance: f64, best: &mut HinfNorm) -> Result<(), LinalgError> {
    if best.omega <= 0.0 || best.omega.is_infinite() {
        return Ok(());
    }
    let mut step = 3e-3;
    while step > 1e-5 {
        let start = best.gain;
        for direction in [1.0, -1.0] {
            let mut length = step;
            loop {
                let before = best.gain;
                update_peak(g, best.omega * (1.0 + direction * length), best)?;
                if best.gain <= before * (1.0 + 0.5 * tolerance) {
                    break;
                }
                // Steps grow while they lead upwards, and end before zero.
                length = (2.0 * length).min(0.5);
            }
        }
        if best.gain <= start * (1.0 + 0.5 * tolerance) {
            break;
        }
        step *= 0.5;
    }
    Ok(())
}

fn update_peak(g: &StateSpace, omega: f64, best: &mut HinfNorm) -> Result<(), LinalgError> {
    let gain = gain_at(g, omega)?;
    if gain > best.gain {
        best.gain = gain;
        best.omega = omega;
    }
    Ok(())
}

/// Candidates for the frequencies ω ≥ 0 at which some singular value of G(jω) equals `level`, ascending.
///
/// Every such frequency is in the list (to the accuracy of the eigenvalues); some in the list may not be one.
pub(crate) fn level_crossings(g: &StateSpace, level: f64) -> Result<Vec<f64>, LinalgError> {
    let n = g.states();
    if n == 0 {
        return Ok(Vec::new());
    }
    // With B and C divided by √γ and D by γ the level is one, and both off-diagonal blocks are of similar size.
    let root = level.sqrt();
    let g = StateSpace {
        a: g.a.clone(),
        b: &g.b * (1.0 / root),
        c: &g.c * (1.0 / root),
        d: &g.d * (1.0 / level),
    };
    let direct = linalg::singular_values(&linalg::to_complex(&g.d))?;
    let mut out = if direct.iter().any(|sigma| (sigma - 1.0).abs() < NEAR_DIRECT) {
        // The Hamiltonian alone may be wrong here, but does no harm.
        let mut both = hamiltonian_crossings(&g).unwrap_or_default();
        both.extend(shifted_crossings(&g)?);
        both
    } else {
        hamiltonian_crossings(&g)?
    };
    out.sort_by(f64::total_cmp);
    out.dedup();
    Ok(out)
}

/// A level this near to a singular value of D, relative to it, leaves R = I − DᵀD nearly singular.
const NEAR_DIRECT: f64 = 1e-3;

/// Crossings of level one, from the eigenvalues of the Hamiltonian matrix.
fn hamiltonian_crossings(g: &StateSpace) -> Result<Vec<f64>, LinalgError> {
    let StateSpace { a, b, c, d } = g;
    let r = Matrix::identity(d.ncols(), d.ncols()) - d.transpose() * d;
    let s = Matrix::identity(d.nrows(), d.nrows()) - d * d.transpose();
    let r_dt_c = linalg::solve(&r, &(d.transpose() * c))?;
    let r_bt = linalg::solve(&r, &b.transpose())?;
    let s_c = linalg::solve(&s, c)?;
    let a = a + b * &r_dt_c;
    let minus_at = a.transpose() * -1.0;
    let q = c.transpose() * &s_c * -1.0;
    let h = balance::balanced(&linalg::blocks(&[&[&a, &(b * &r_bt)], &[&q, &minus_at]]));
    let size = linalg::max_abs(&h);
    Ok(linalg::eigenvalues(&h)?
        .iter()
        .filter(|l| l.im >= 0.0 && l.re.abs() <= 1e-5 * l.im + 1e-8 * size)
        .map(|l| l.im)
        .collect())
}

/// Crossings of level one without the inverse of R and S: with the input w and the output v as unknowns besides the states x and
/// those of the adjoint system, p,
///
/// ```text
/// s x = A x + B w        v = C x + D w
/// s p = −Aᵀ p − Cᵀ v     w = Bᵀ p + Dᵀ v
/// ```
///
/// is a pencil M − s N, which is well conditioned at a real s = α even where R is singular. The eigenvalues of its inverse there,
/// restricted to x and p, are 1/(s − α); an s that has moved to infinity becomes a zero.
fn shifted_crossings(g: &StateSpace) -> Result<Vec<f64>, LinalgError> {
    let StateSpace { a, b, c, d } = g;
    let (n, m, p) = (g.states(), g.inputs(), g.outputs());
    // In the middle of the dynamics: the accuracy falls with the distance from α, in decades, on both sides.
    let sizes = g
        .poles()?
        .into_iter()
        .map(|pole| pole.norm())
        .filter(|size| *size > 0.0);
    let (sum, count) = sizes.fold((0.0, 0), |(sum, count), size| (sum + libm::log(size), count + 1));
    let alpha = libm::exp(sum / f64::from(count.max(1)));
    let shift = Matrix::identity(n, n) * alpha;
    let minus = |x: &Matrix| x * -1.0;
    let zeros = Matrix::zeros;
    let pencil = linalg::blocks(&[
        &[&(a - &shift), &zeros(n, n), b, &zeros(n, p)],
        &[
            &zeros(n, n),
            &minus(&(a.transpose() + &shift)),
            &zeros(n, m),
            &minus(&c.transpose()),
        ],
        &[c, &zeros(p, n), d, &minus(&Matrix::identity(p, p))],
        &[
            &zeros(m, n),
            &b.transpose(),
            &minus(&Matrix::identity(m, m)),
            &d.transpose(),
        ],
    ]);
    let states = Matrix::from_fn(pencil.nrows(), 2 * n, |i, j| f64::from(u8::from(i == j)));
    let Ok(inverse) = linalg::solve(&pencil, &states) else {
        // The level is a gain at every frequency.
        return Ok(Vec::new());
    };
    let one = c64::new(1.0, 0.0);
    Ok(
        linalg::eigenvalues(&balance::balanced(&inverse.block(0, 0, 2 * n, 2 * n)))?
            .into_iter()
            .filter(|theta| theta.norm() > 0.0)
            .map(|theta| one / theta + alpha)
            .filter(|s| s.im > 0.0 && s.re.abs() <= 1e-2 * s.im)
            .map(|s| s.im)
            .collect(),
    )
}
