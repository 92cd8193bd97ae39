//! Robust stability margins of a closed loop, with bounds that hold for all frequencies.
//!
//! Upper bound of μ over the axis: a scaling found at one frequency proves its bound on a whole interval, whose ends are
//! imaginary eigenvalues of a Hamiltonian matrix (the frequencies at which the certificate becomes singular). Intervals are
//! added until they cover [0, ∞]; nothing between the points of a grid is left to luck (Lawrence, Tits and van Dooren 2000;
//! Biannic and Ferreres 2005 use the same idea).
//!
//! Lower bound: a perturbation that puts an eigenvalue of the closed loop on the imaginary axis, found by ascent on the
//! spectral abscissa or on μ at the peak, and returned, so that anybody can apply it.

use super::lower::{lower_bound, mix, random_delta};
use super::scalings::{Scalings, bound_until};
use super::structure::{MuError, Structure};
use crate::balance;
use crate::linalg::{self, CMatrix, LinalgError, c64};
use crate::norm;
use crate::rng::Rng;
use crate::state_space::StateSpace;

/// How to compute a margin.
#[derive(Debug, Clone, PartialEq)]
pub struct MarginOptions {
    /// Relative slack between the proved bound and the largest bound found on the grid: smaller needs more intervals.
    pub slack: f64,
    /// Most certified intervals before giving up.
    pub intervals: usize,
    /// Starts of the search for destabilising perturbations.
    pub starts: usize,
    /// Seed of that search.
    pub seed: u64,
}

impl Default for MarginOptions {
    fn default() -> Self {
        Self {
            slack: 1e-3,
            intervals: 3000,
            starts: 12,
            seed: 1,
        }
    }
}

/// A perturbation that makes the closed loop marginally stable.
#[derive(Debug, Clone)]
pub struct Destabilising {
    /// The perturbation Δ, closed as `w = Δ z`.
    pub delta: CMatrix,
    /// Its size: the largest norm of a block.
    pub size: f64,
    /// The frequency of the eigenvalue on the axis, rad/s.
    pub omega: f64,
}

/// A stability margin: multiples of the stated uncertainty that are tolerated.
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
    let m = balance::balanced_system(&crate::reduce::on_path(m));
    let poles = m.poles()?;
    let abscissa = poles.iter().map(|p| p.re).fold(f64::NEG_INFINITY, f64::max);
    if abscissa >= 0.0 {
        return Err(MuError::Unstable(abscissa));
    }
    let mut grid = vec![0.0, f64::INFINITY];
    let large = structure.scalings() > 100;
    grid.extend(frequency_grid(&poles, if large { 12 } else { 40 }));
    let mut curve = Vec::new();
    // With many free scalings the whole curve would cost minutes. What counts is the peak: elsewhere any proof below the
    // largest value so far will do, and the curve then shows that proof.
    let mut highest = f64::NEG_INFINITY;
    if large {
        // Where the plain gain is largest the peak is likely, and everything after it is quick.
        let mut order = grid
            .iter()
            .map(|&w| Ok((norm::gain_at(&m, w)?, w)))
            .collect::<Result<Vec<_>, LinalgError>>()?;
        order.sort_by(|a, b| b.0.total_cmp(&a.0));
        grid = order.into_iter().map(|x| x.1).collect();
    }
    for &omega in &grid {
        let enough = if large { 0.98 * highest } else { f64::NEG_INFINITY };
        let value = bound_until(&m.at(omega), structure, 1e-3, enough, None)?.value;
        highest = highest.max(value);
        curve.push((omega, value));
    }
    curve.sort_by(|a, b| a.0.total_cmp(&b.0));
    refine_peak(&m, structure, &mut curve, if large { 3 } else { 16 })?;
    let (mut critical, peak) = top(&curve);
    let (target, intervals) = cover(&m, structure, options, peak, &mut critical)?;
    let perturbation = destabilise(&m, structure, options, critical, target)?;
    let destabilising = perturbation.as_ref().map_or(f64::INFINITY, |p| p.size);
    let proved = if target > 0.0 { 1.0 / target } else { f64::INFINITY };
    Ok(Margin {
        // A perturbation in hand is worth more than a proof whose eigenvalues carry rounding errors.
        guaranteed: proved.min(destabilising),
        destabilising,
        perturbation,
        critical,
        curve,
        intervals,
    })
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
        .map(|i| low * (high / low).powf(f64::from(i) / f64::from(points - 1)))
        .collect();
    // With few points asked for, equal weights of many poles need not be visited one by one either.
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
            curve.push((
                omega,
                bound_until(&m.at(omega), structure, 1e-4, f64::NEG_INFINITY, None)?.value,
            ));
            added = true;
        }
        curve.sort_by(|a, b| a.0.total_cmp(&b.0));
        if !added {
            break;
        }
    }
    Ok(())
}

/// Certified intervals until [0, ∞] is covered. Returns the bound that holds everywhere and the number of intervals.
fn cover(
    m: &StateSpace,
    structure: &Structure,
    options: &MarginOptions,
    peak: f64,
    critical: &mut f64,
) -> Result<(f64, usize), MuError> {
    let size = norm::climb(m, 1e-3, &[0.0, f64::INFINITY])?.gain;
    // A loop that no perturbation can destabilise still needs some positive level to certify.
    let mut target = (peak * (1.0 + options.slack))
        .max(1e-6 * size)
        .max(f64::MIN_POSITIVE.sqrt());
    // Gaps still open, as pairs; the ends of the axis and the peak come first because they decide the level.
    let mut open = vec![(0.0, f64::INFINITY)];
    let mut first = vec![f64::INFINITY, 0.0, *critical];
    let mut used = 0;
    while let Some(&(a, b)) = open.last() {
        if used >= options.intervals {
            return Err(MuError::NotCovered {
                steps: used,
                from: a,
                to: b,
            });
        }
        let omega = first.pop().unwrap_or_else(|| {
            if b.is_infinite() {
                if a > 0.0 { 4.0 * a } else { 1.0 }
            } else if a > 0.0 {
                (a * b).sqrt()
            } else {
                0.5 * b
            }
        });
        used += 1;
        let bound = bound_until(&m.at(omega), structure, 0.05 * options.slack, target, None)?;
        if bound.value >= target {
            target = bound.value * (1.0 + options.slack);
            *critical = omega;
            first.push(omega);
            continue;
        }
        let (low, high) = valid_interval(m, &bound.scalings, target, omega)?;
        let (low, high) = spot_checked(m, &bound.scalings, target, omega, low, high)?;
        // The certificate is strict inside; overlap by a hair so that no end point is left open.
        let shrink = 1e-9;
        let (low, high) = (
            if low > 0.0 { low * (1.0 + shrink) } else { -1.0 },
            high * (1.0 - shrink),
        );
        if high <= low || !(low < omega || omega == 0.0) || (omega.is_finite() && high <= omega) {
            // Too thin to help: the peak itself. A slightly higher level opens it.
            target *= 1.0 + options.slack;
            continue;
        }
        let mut rest = Vec::new();
        for (from, to) in open {
            if to <= low || from >= high {
                rest.push((from, to));
                continue;
            }
            if from < low {
                rest.push((from, low));
            }
            if to > high {
                rest.push((high, to));
            }
        }
        open = rest;
    }
    Ok((target, used))
}

/// The interval around `omega` on which the scalings prove `level`: up to the nearest frequencies at which
/// `level² D − Mᴴ D M − j (G M − Mᴴ G)` becomes singular. Every eigenvalue that might be imaginary counts as one, which can
/// only shorten the interval.
fn valid_interval(m: &StateSpace, s: &Scalings, level: f64, omega: f64) -> Result<(f64, f64), LinalgError> {
    let n = m.states();
    if n == 0 {
        return Ok((0.0, f64::INFINITY));
    }
    let complex = linalg::to_complex;
    let (a, b, c, d) = (complex(&m.a), complex(&m.b), complex(&m.c), complex(&m.d));
    let j = c64::new(0.0, 1.0);
    let times = |x: &CMatrix, f: c64| CMatrix::from_fn(x.nrows(), x.ncols(), |i, k| x[(i, k)] * f);
    let dc = &s.d_left * &c;
    let dd = &s.d_left * &d;
    let q = linalg::adjoint(&c) * &dc;
    // With X = (jω − A)⁻¹ B the certificate is −(Xᴴ Q X + Xᴴ S + Sᴴ X + R), S = Cᴴ D_l D − j (G C)ᴴ.
    let cross = linalg::adjoint(&c) * &dd + times(&linalg::adjoint(&(&s.g * &c)), -j);
    let gd = &s.g * &d;
    let r = linalg::adjoint(&d) * &dd
        + times(&gd, j)
        + times(&linalg::adjoint(&gd), -j)
        + times(&s.d_right, c64::new(-level * level, 0.0));
    let r_cross = linalg::solve_complex(&r, &linalg::adjoint(&cross));
    let r_b = linalg::solve_complex(&r, &linalg::adjoint(&b));
    let upper_left = &a - &b * &r_cross;
    let upper_right = times(&(&b * &r_b), c64::new(-1.0, 0.0));
    let lower_left = times(&(&q - &cross * &r_cross), c64::new(-1.0, 0.0));
    let lower_right = times(&linalg::adjoint(&upper_left), c64::new(-1.0, 0.0));
    let h = CMatrix::from_fn(2 * n, 2 * n, |i, k| match (i < n, k < n) {
        (true, true) => upper_left[(i, k)],
        (true, false) => upper_right[(i, k - n)],
        (false, true) => lower_left[(i - n, k)],
        (false, false) => lower_right[(i - n, k - n)],
    });
    let h = balance::balanced_complex(&h);
    let size = (0..2 * n)
        .flat_map(|i| (0..2 * n).map(move |k| (i, k)))
        .fold(0.0f64, |x, (i, k)| x.max(h[(i, k)].norm()));
    let (mut low, mut high) = (0.0f64, f64::INFINITY);
    for l in linalg::eigenvalues_complex(&h)? {
        if l.re.abs() > 1e-5 * l.im.abs() + 1e-8 * size {
            continue;
        }
        if l.im <= omega {
            low = low.max(l.im);
        }
        if l.im >= omega {
            high = high.min(l.im);
        }
    }
    Ok((low, high))
}

/// The interval cut at the first point, of a few on each side of `omega`, at which the certificate does not hold after all:
/// insurance against an eigenvalue that rounding moved further from the axis than the tolerance allows for.
fn spot_checked(
    m: &StateSpace,
    s: &Scalings,
    level: f64,
    omega: f64,
    low: f64,
    high: f64,
) -> Result<(f64, f64), LinalgError> {
    let (mut low, mut high) = (low, high);
    let top = if high.is_finite() {
        high
    } else {
        1e4 * omega.min(1e12).max(low).max(1.0)
    };
    let centre = if omega.is_finite() { omega } else { top };
    for i in 1..=6 {
        let part = f64::from(i) / 6.5;
        let (down, up) = (centre - part * (centre - low), centre + part * (top - centre));
        if low < down && !super::scalings::holds(&m.at(down), s, level)? {
            low = down;
        }
        if up < high && !super::scalings::holds(&m.at(up), s, level)? {
            high = up;
        }
    }
    Ok((low, high))
}

/// The closed loop's state matrix with `w = Δ z`, and what gradients need.
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
    let right = linalg::solve_complex(
        &(eye(m.inputs()) - &scaled * &d).transpose().to_owned(),
        &b.transpose().to_owned(),
    );
    let a = linalg::to_complex(&m.a) + &b * (&scaled * &left);
    (a, right.transpose().to_owned(), left)
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
    // Stability at `low` is what the proof says; it costs one look to see, and a few steps to find out how far it is wrong.
    let mut below = low;
    while rightmost(m, delta, below)?.re >= 0.0 {
        below *= 0.9;
        if below < 1e-3 * low {
            return Ok(None);
        }
    }
    for i in 0..=steps {
        let k = low * (high / low).powf(f64::from(i) / f64::from(steps));
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

fn destabilise(
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
    // No perturbation smaller than this destabilises: the search along a ray can begin here.
    let low = if bound > 0.0 { 0.999 / bound } else { 1.0 };
    for mut delta in seeds {
        let reach = best.as_ref().map_or(30.0 * low, |b| b.size * (1.0 - 1e-9));
        let mut k = 1.2 * low;
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
    let mut here = rightmost(m, delta, k)?.re;
    for _ in 0..30 {
        let (a, b, c) = closed(m, delta, k);
        let n = a.nrows();
        let (values, right) = linalg::eigen_complex(&a)?;
        let Some(at) = (0..n).max_by(|&i, &j| values[i].re.total_cmp(&values[j].re)) else {
            return Ok(());
        };
        let unit = CMatrix::from_fn(n, 1, |i, _| c64::new(f64::from(u8::from(i == at)), 0.0));
        let left = linalg::solve_complex(&right.transpose().to_owned(), &unit);
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
        let towards = structure.aligned(&row, &column);
        let mut moved = false;
        for t in [1.0, 0.5, 0.2, 0.05] {
            let trial = mix(delta, &towards, t);
            let value = rightmost(m, &trial, k)?.re;
            if value > here + 1e-9 * here.abs() {
                (*delta, here, moved) = (trial, value, true);
                break;
            }
        }
        if !moved {
            return Ok(());
        }
    }
    Ok(())
}
