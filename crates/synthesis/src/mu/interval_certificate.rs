//! Proof of a margin: scalings that certify a level on frequency intervals, until the intervals cover all frequencies.

use super::options::MarginOptions;
use super::scalings::{Scalings, bound_until, certificate_holds};
use super::structure::{MuError, Structure};
use crate::balance;
use crate::linalg::{self, CMatrix, LinalgError, c64};
use crate::norm;
use crate::state_space::StateSpace;

/// Largest G of a certificate, in multiples of the level and D.
///
/// With real blocks alone mu over frequency can be a spike of zero width: a loop with a phase crossing at one frequency, independent
/// of the parameters, is singular there and nowhere else. Scalings with unlimited G prove a bound near zero directly beside the
/// spike, so intervals from both sides would meet within rounding and miss the spike. With G limited, the proved bound is continuous
/// in frequency: the flanks of a spike have a width of about the inverse of this number, and rounding errors are far smaller. At the
/// spike itself G has no effect, so the peak is unchanged. (The limit is equivalent to a complex part of half a per cent in a real
/// parameter.)
pub(super) const G_LIMIT: f64 = 100.0;

/// A level that mu exceeds at no frequency.
pub(super) struct CertifiedLevel {
    /// The level.
    pub level: f64,
    /// Frequency at which it was last raised, or the given frequency.
    pub critical: f64,
    /// Intervals used.
    pub intervals: usize,
}

/// Adds certified intervals until [0, ∞] is covered, at a level of at least `peak`, which was found at `critical`.
pub(super) fn certify_axis(
    m: &StateSpace,
    structure: &Structure,
    options: &MarginOptions,
    peak: f64,
    critical: f64,
) -> Result<CertifiedLevel, MuError> {
    let size = norm::level_set_iteration(m, 1e-3, &[0.0, f64::INFINITY])?.gain;
    // A loop that no perturbation can destabilise still needs some positive level to certify.
    let mut level = (peak * (1.0 + options.slack))
        .max(1e-6 * size)
        .max(f64::MIN_POSITIVE.sqrt());
    let mut critical = critical;
    // Remaining gaps, as pairs; the ends of the axis and the peak come first because they determine the level.
    let mut gaps = vec![(0.0, f64::INFINITY)];
    let mut priority = vec![f64::INFINITY, 0.0, critical];
    let mut used = 0;
    while let Some(&(a, b)) = gaps.last() {
        if used >= options.intervals {
            return Err(MuError::NotCovered {
                steps: used,
                from: a,
                to: b,
            });
        }
        let omega = priority.pop().unwrap_or_else(|| middle(a, b));
        used += 1;
        // The tested level is lower than the claimed one. Where mu reaches the claimed level the certificate is then violated by
        // half the slack, far more than rounding error.
        let tested = level / (1.0 + 0.5 * options.slack);
        let g_limit = Some(G_LIMIT * level);
        let bound = bound_until(&m.at(omega), structure, 0.05 * options.slack, tested, g_limit)?;
        if bound.value >= tested {
            level =
                self_consistent_level(&m.at(omega), structure, options, level, bound.value)? * (1.0 + options.slack);
            critical = omega;
            priority.push(omega);
            continue;
        }
        let (low, high) = valid_interval(m, &bound.scalings, tested, omega)?;
        let low = verified_end(m, &bound.scalings, tested, omega, low)?;
        let high = verified_end(m, &bound.scalings, tested, omega, high)?;
        if high - low <= 1e-9 * high && high.is_finite() || low == high {
            // Too narrow to help: a slightly higher level widens it.
            level *= 1.0 + options.slack;
            continue;
        }
        // The intervals are closed sets, the gaps between them open sets.
        let mut remaining_gaps = Vec::new();
        for (from, to) in gaps {
            if to <= low || from >= high {
                remaining_gaps.push((from, to));
                continue;
            }
            if from < low {
                remaining_gaps.push((from, low));
            }
            if to > high {
                remaining_gaps.push((high, to));
            }
        }
        gaps = remaining_gaps;
    }
    Ok(CertifiedLevel {
        level,
        critical,
        intervals: used,
    })
}

/// The level at one frequency that is proved with G limited by that level itself. It lies above `low`; the limit at `low` only
/// proves `high`: a level far too low forces G close to zero, and the bound is then that of complex parameters.
fn self_consistent_level(
    m: &CMatrix,
    structure: &Structure,
    options: &MarginOptions,
    low: f64,
    high: f64,
) -> Result<f64, MuError> {
    let (mut low, mut high) = (low, high.max(low));
    while high > low * (1.0 + options.slack) {
        let trial = (low * high).sqrt();
        let proved = bound_until(m, structure, 0.05 * options.slack, 0.0, Some(G_LIMIT * trial))?.value;
        // A larger limit of G proves a lower level: the proved level is above the answer if it is above the trial, and below it otherwise.
        if proved > trial {
            (low, high) = (trial, high.min(proved));
        } else {
            (low, high) = (low.max(proved), trial);
        }
    }
    Ok(high)
}

fn middle(a: f64, b: f64) -> f64 {
    match (a > 0.0, b.is_infinite()) {
        (true, true) => 4.0 * a,
        (false, true) => 1.0,
        (true, false) => (a * b).sqrt(),
        (false, false) => 0.5 * b,
    }
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
    let size = linalg::max_abs(&h);
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

/// The last test point between `omega` and an end of its interval up to which the certificate is verified: a few points in between,
/// and one within a millionth of the end, so that no end relies on the accuracy of an eigenvalue.
fn verified_end(m: &StateSpace, s: &Scalings, level: f64, omega: f64, end: f64) -> Result<f64, LinalgError> {
    let fractions = [0.1, 0.3, 0.5, 0.7, 0.9, 1.0 - 1e-6];
    let points = fractions.map(|part| match (omega.is_finite(), end.is_finite()) {
        (true, true) => omega + part * (end - omega),
        (true, false) => omega.max(1e-3) * libm::pow(1e6, part),
        (false, _) => end.max(1e-3) * libm::pow(1e6, 1.0 - part),
    });
    let mut last = omega;
    for point in points {
        if !certificate_holds(&m.at(point), s, level)? {
            return Ok(last);
        }
        last = point;
    }
    // Zero and infinity belong to the axis and are included.
    if (end == 0.0 || end.is_infinite()) && certificate_holds(&m.at(end), s, level)? {
        last = end;
    }
    Ok(last)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::delay::pade;
    use crate::interconnect::append;
    use crate::linalg::{Matrix, diagonal};
    use crate::mu::{Block, margin};

    /// Masses under delayed velocity feedback, `(M₀ + δ₁ S₁ + δ₂ S₂) v̇ = −K v(t − T)`, with the perturbation of `w = Δ z` and the
    /// exact margin. M and K are symmetric, so the loop decouples into scalar loops `λ e^(−jωT)/jω` with λ > 0: for any δ, an
    /// eigenvalue can reach the axis only at the one phase-crossover frequency. There mu is a spike of zero width.
    fn delayed_masses(k: [f64; 3]) -> (StateSpace, Structure, f64) {
        let n = 3;
        let square = |e: &Matrix| e * e.transpose();
        let factor = |rows: [[f64; 3]; 3]| Matrix::from_fn(n, n, |i, j| 0.1f64.sqrt() * rows[i][j]);
        let e = [
            factor([[1.0, 0.2, 0.0], [0.5, 1.5, -0.3], [-0.2, 0.1, 0.8]]),
            factor([[0.7, 0.0, 0.4], [-0.6, 0.9, 0.0], [0.3, -0.4, 1.1]]),
        ];
        let share = square(&e[0]) + square(&e[1]);
        // The nominal mass is ten times the uncertain shares plus a small remainder.
        let mass = &share * 10.0 + Matrix::identity(n, n) * 0.1;
        let gain = diagonal(&k);
        let delay = append(&vec![pade(0.025, 3).unwrap(); n]);
        let inverse = linalg::inverse(&mass).unwrap();
        // u = −K v, f = C x + D u; v̇ = M⁻¹ (f + E w), w = −δ z, z = Eᵀ v̇
        let u = Matrix::from_fn(n, n + delay.states(), |i, j| if j < n { -gain[(i, j)] } else { 0.0 });
        let mut force = &delay.d * &u;
        force.set_block(0, n, &delay.c);
        let mut waiting = &delay.b * &u;
        waiting.set_block(0, n, &delay.a);
        let e = linalg::blocks(&[&[&e[0], &e[1]]]);
        let entering = &inverse * &e * -1.0;
        let loop_ = StateSpace {
            a: linalg::blocks(&[&[&(&inverse * &force)], &[&waiting]]),
            b: linalg::blocks(&[&[&entering], &[&Matrix::zeros(delay.states(), e.ncols())]]),
            c: e.transpose() * &inverse * &force,
            d: e.transpose() * &entering,
        };
        // The worst perturbation of a given size makes all masses equally light: bisection on the size until λ reaches the crossover.
        let phase_crosses = bisect(30.0, 100.0, |w| pade(0.025, 3).unwrap().at(w)[(0, 0)].re < 0.0);
        let fastest = |size: f64| {
            let lighter = &mass - &share * size;
            let values = linalg::eigenvalues(&(linalg::inverse(&lighter).unwrap() * &gain)).unwrap();
            values.iter().map(|l| l.re).fold(0.0, f64::max)
        };
        let exact = bisect(0.0, 9.9, |size| fastest(size) > phase_crosses);
        (loop_, Structure::new(vec![Block::Real(n); 2]).unwrap(), exact)
    }

    fn bisect(mut low: f64, mut high: f64, beyond: impl Fn(f64) -> bool) -> f64 {
        assert!(!beyond(low) && beyond(high));
        for _ in 0..80 {
            let middle = 0.5 * (low + high);
            if beyond(middle) { high = middle } else { low = middle }
        }
        low
    }

    /// The proof finds a spike of zero width by itself: its initial peak is close to zero and at a frequency far away.
    #[test]
    fn spike_between_two_certificates_is_found() {
        for k in [
            [20.0, 20.0, 20.0],
            [30.0, 12.0, 9.0],
            [11.0, 35.0, 25.0],
            [8.0, 6.0, 28.0],
        ] {
            let (m, structure, exact) = delayed_masses(k);
            let options = MarginOptions::default();
            for critical in [1.0, 50.0] {
                let certified = certify_axis(&m, &structure, &options, 1e-6, critical).unwrap();
                let proved = 1.0 / certified.level;
                assert!(proved < exact, "from {critical}: {proved} against {exact}");
                assert!(proved > 0.98 * exact, "from {critical}: {proved} against {exact}");
            }
            let both = margin(&m, &structure, &options).unwrap();
            assert!(
                (0.998 * exact..exact).contains(&both.guaranteed),
                "{both:?} against {exact}"
            );
            assert!(
                (both.destabilising - exact).abs() < 1e-6 * exact,
                "{both:?} against {exact}"
            );
        }
    }
}
