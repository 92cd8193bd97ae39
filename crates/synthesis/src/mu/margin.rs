//! Robust stability margins of a closed loop, with bounds that hold for all frequencies.
//!
//! Upper bound of μ over the axis: a scaling found at one frequency proves its bound on a whole interval, with ends at
//! imaginary eigenvalues of a Hamiltonian matrix (the frequencies at which the certificate becomes singular). Intervals are
//! added until they cover [0, ∞], so the bound also holds between grid points (Lawrence, Tits and van Dooren 2000; Biannic and
//! Ferreres 2005 use the same idea).
//!
//! Lower bound: a perturbation that places an eigenvalue of the closed loop on the imaginary axis, found by ascent on the
//! spectral abscissa or on μ at the peak, and returned so that the caller can verify it.

use super::destabilise::destabilise;
use super::interval_certificate::{G_LIMIT, certify_axis};
use super::options::{Destabilising, MarginOptions};
use super::scalings::bound_until;
use super::structure::{MuError, Structure};
use crate::linalg::{LinalgError, c64};
use crate::norm;
use crate::state_space::StateSpace;

/// A stability margin: tolerated multiples of the stated uncertainty.
#[derive(Debug, Clone)]
pub struct Margin {
    /// Every Δ in the set scaled by less than this leaves the loop stable: guaranteed for all frequencies.
    pub guaranteed: f64,
    /// The size of the destabilising perturbation found; infinite when none was found.
    pub destabilising: f64,
    /// That perturbation.
    pub perturbation: Option<Destabilising>,
    /// The frequency at which the upper bound of μ peaks, rad/s.
    pub critical: f64,
    /// Points (ω, upper bound of μ) of the grid, ascending, for a plot.
    pub curve: Vec<(f64, f64)>,
    /// Certified intervals used to cover the axis.
    pub intervals: usize,
}

/// The margin of the loop `z = M w`, `w = Δ z` for Δ in `structure`, M stable. Sizes are multiples of the unit ball.
///
/// # Errors
/// An unstable M, blocks that do not fit, an axis that could not be covered within the limit.
pub fn margin(m: &StateSpace, structure: &Structure, options: &MarginOptions) -> Result<Margin, MuError> {
    structure.check(m.outputs(), m.inputs())?;
    let m = crate::reduce::without_unconnected_states(m).balanced();
    let poles = m.poles()?;
    let abscissa = poles.iter().map(|p| p.re).fold(f64::NEG_INFINITY, f64::max);
    if abscissa >= 0.0 {
        return Err(MuError::Unstable(abscissa));
    }
    let mut grid = vec![0.0, f64::INFINITY];
    let large = structure.scalings() > 100;
    grid.extend(frequency_grid(&poles, if large { 12 } else { 40 }));
    let mut curve = Vec::new();
    // With many free scalings the exact curve would take minutes. Only the peak matters: elsewhere any proof below the
    // largest value so far suffices, and the curve then shows that proof.
    let mut highest = f64::NEG_INFINITY;
    if large {
        // The peak is likely where the unstructured gain is largest, and all later frequencies are then fast.
        let mut order = grid
            .iter()
            .map(|&w| Ok((norm::gain_at(&m, w)?, w)))
            .collect::<Result<Vec<_>, LinalgError>>()?;
        order.sort_by(|a, b| b.0.total_cmp(&a.0));
        grid = order.into_iter().map(|x| x.1).collect();
    }
    for &omega in &grid {
        let enough = if large { 0.98 * highest } else { f64::NEG_INFINITY };
        let value = bound_at(&m, structure, omega, 1e-3, enough)?;
        highest = highest.max(value);
        curve.push((omega, value));
    }
    curve.sort_by(|a, b| a.0.total_cmp(&b.0));
    refine_peak(&m, structure, &mut curve, if large { 3 } else { 16 })?;
    let (mut critical, mut peak) = top(&curve);
    // The destabilising perturbation locates the peak: with real blocks it can be too narrow for any grid.
    let mut perturbation = destabilise(&m, structure, options, critical, peak)?;
    if let Some(p) = perturbation.as_ref().filter(|p| p.size * peak < 1.0) {
        let value = bound_at(&m, structure, p.omega, 1e-4, f64::NEG_INFINITY)?;
        (critical, peak) = (p.omega, value.max(1.0 / p.size));
        curve.push((p.omega, value));
        curve.sort_by(|a, b| a.0.total_cmp(&b.0));
    }
    let certified = certify_axis(&m, structure, options, peak, critical)?;
    if certified.critical != critical && perturbation.as_ref().is_none_or(|p| p.size * certified.level > 1.03) {
        let again = destabilise(&m, structure, options, certified.critical, certified.level)?;
        if again.as_ref().map_or(f64::INFINITY, |p| p.size) < perturbation.as_ref().map_or(f64::INFINITY, |p| p.size) {
            perturbation = again;
        }
    }
    let destabilising = perturbation.as_ref().map_or(f64::INFINITY, |p| p.size);
    let guaranteed = if certified.level > 0.0 {
        1.0 / certified.level
    } else {
        f64::INFINITY
    };
    if destabilising < guaranteed {
        return Err(MuError::Contradiction {
            guaranteed,
            destabilising,
        });
    }
    Ok(Margin {
        guaranteed,
        destabilising,
        perturbation,
        critical: certified.critical,
        curve,
        intervals: certified.intervals,
    })
}

/// The upper bound at one frequency, with G limited as in the certificates, so that the curve shows spikes with their flanks.
fn bound_at(m: &StateSpace, structure: &Structure, omega: f64, tolerance: f64, enough: f64) -> Result<f64, MuError> {
    let g_limit = G_LIMIT * norm::gain_at(m, omega)?.max(f64::MIN_POSITIVE);
    Ok(bound_until(&m.at(omega), structure, tolerance, enough, Some(g_limit))?.value)
}

fn top(curve: &[(f64, f64)]) -> (f64, f64) {
    curve
        .iter()
        .copied()
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .unwrap_or((0.0, 0.0))
}

/// Logarithmic points over the span of the poles with the poles' own frequencies among them.
fn frequency_grid(poles: &[c64], points: u32) -> Vec<f64> {
    let guesses = norm::peak_guesses(poles);
    let (Some(&low), Some(&high)) = (guesses.first(), guesses.last()) else {
        return vec![1.0];
    };
    let (low, high) = (low.max(1e-6 * high) / 10.0, high * 10.0);
    let mut grid: Vec<f64> = (0..points)
        .map(|i| low * libm::pow(high / low, f64::from(i) / f64::from(points - 1)))
        .collect();
    // When few points are requested, the many equal poles of the weights need not all be visited either.
    let stride = if points < 40 { 1 + guesses.len() / 12 } else { 1 };
    grid.extend(guesses.into_iter().step_by(stride));
    grid.sort_by(f64::total_cmp);
    grid.dedup_by(|a, b| *a - *b <= 0.02 * *b);
    grid
}

/// A few golden-section steps around the largest point.
fn refine_peak(
    m: &StateSpace,
    structure: &Structure,
    curve: &mut Vec<(f64, f64)>,
    rounds: usize,
) -> Result<(), MuError> {
    for _ in 0..rounds {
        let Some(at) = (0..curve.len()).max_by(|&i, &j| curve[i].1.total_cmp(&curve[j].1)) else {
            return Ok(());
        };
        let mut added = false;
        let between = |a: f64, b: f64| if a > 0.0 { (a * b).sqrt() } else { 0.5 * b };
        let mut fresh = Vec::new();
        for (a, b) in [(at.wrapping_sub(1), at), (at, at + 1)] {
            if let (Some(a), Some(b)) = (curve.get(a), curve.get(b))
                && b.0.is_finite()
                && b.0 - a.0 > 1e-4 * b.0
            {
                fresh.push(between(a.0, b.0));
            }
        }
        for omega in fresh {
            curve.push((omega, bound_at(m, structure, omega, 1e-4, f64::NEG_INFINITY)?));
            added = true;
        }
        curve.sort_by(|a, b| a.0.total_cmp(&b.0));
        if !added {
            break;
        }
    }
    Ok(())
}
