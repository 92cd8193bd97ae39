//! The two objectives, with their gradients: the spectral abscissa and the largest channel norm.
//!
//! Gradients of the norm: at a peak ω with singular vectors u, v of the closed loop T(jω), `dσ = Re(uᴴ dT v)` and
//! `dT = G₁₂ dK G₂₁`, where G₂₁ leads from w to y and G₁₂ from a disturbance added to u to z, both in closed loop
//! (Apkarian and Noll 2006, section III). Gradients of the abscissa: `dλ = yᴴ dA x / yᴴ x` (Burke, Lewis and Overton 2006).

use std::sync::atomic::{AtomicBool, Ordering};

use super::problem::{Model, ValidatedProblem};
use crate::linalg::{self, CMatrix, LinalgError, Matrix, c64};
use crate::norm;
use crate::parallel;
use crate::state_space::{StateSpace, shifted};

/// A smooth piece of the objective near a point: its value there and its gradient.
#[derive(Debug, Clone)]
pub(crate) struct Piece {
    pub(crate) value: f64,
    pub(crate) gradient: Vec<f64>,
}

impl Piece {
    /// The same piece of the logarithm of the objective.
    pub(crate) fn logarithm(&self) -> Self {
        Self {
            value: libm::log(self.value),
            gradient: self.gradient.iter().map(|g| g / self.value).collect(),
        }
    }
}

/// The closed loop of one model with the data that gradients need.
pub(super) struct ClosedLoop<'a> {
    model: &'a Model,
    /// Closed loop from w to z.
    system: StateSpace,
    /// From an addition to u to the states and to z.
    b_u: Matrix,
    d_u: Matrix,
    /// From the states and from w to y.
    c_y: Matrix,
    d_y: Matrix,
    pub(super) poles: Vec<c64>,
}

impl ClosedLoop<'_> {
    fn abscissa(&self) -> f64 {
        self.poles.iter().map(|p| p.re).fold(f64::NEG_INFINITY, f64::max)
    }
}

/// Norm of a channel and the frequency of its peak.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ChannelNorm {
    pub(crate) gain: f64,
    pub(crate) omega: f64,
}

/// The value of the objective at a point.
#[derive(Debug, Clone)]
pub(crate) struct ObjectiveValue {
    /// The largest spectral abscissa of the models.
    pub(crate) abscissa: f64,
    /// The largest channel norm; infinite when a model is unstable.
    pub(crate) gamma: f64,
    /// Norm and peak per model and channel; empty when unstable.
    pub(crate) channels: Vec<Vec<ChannelNorm>>,
}

/// Evaluates objectives and stores the recent peak frequencies of each channel: the next evaluation, at a point nearby,
/// starts from them and usually needs a single Hamiltonian test as proof.
pub(crate) struct Objective<'a> {
    pub(crate) problem: &'a ValidatedProblem,
    recent_peaks: Vec<Vec<Vec<f64>>>,
    tolerance: f64,
    /// Channels with all stored peaks below this fraction of the largest one are not tested further; 0 tests all.
    pub(super) screen: f64,
    /// Threads that share the models; has no influence on the result.
    threads: usize,
    /// Evaluations of the norm so far.
    pub(crate) evaluations: usize,
}

/// One closed loop during the evaluation of its norms.
pub(super) struct LoopNorms<'a> {
    pub(super) closed: ClosedLoop<'a>,
    /// The channels.
    pub(super) parts: Vec<StateSpace>,
    /// The largest gain of each at the stored frequencies.
    norms: Vec<ChannelNorm>,
}

/// Minimum distance of a closed loop from the axis, relative to the fastest pole with or without feedback, to count as stable.
/// Nearer, neither its stability nor its norm can be distinguished from rounding.
const MARGIN: f64 = 1e-9;

impl<'a> Objective<'a> {
    pub(crate) fn new(problem: &'a ValidatedProblem, tolerance: f64, threads: usize) -> Self {
        let recent_peaks = problem
            .models
            .iter()
            .map(|m| vec![Vec::new(); m.channels.len()])
            .collect();
        Self {
            problem,
            recent_peaks,
            tolerance,
            screen: 0.0,
            threads,
            evaluations: 0,
        }
    }

    /// The same, skipping channels far below the largest: for a search, which ends with an evaluation that skips none.
    pub(crate) fn screened(mut self, screen: f64) -> Self {
        self.screen = screen;
        self
    }

    fn close(&self, model: &'a Model, k: &Matrix) -> Result<Option<ClosedLoop<'a>>, LinalgError> {
        let p = &model.plant;
        let (n, nu, ny) = (p.states(), model.controls, model.measurements);
        let (nw, nz) = (p.inputs() - nu, p.outputs() - ny);
        let d22 = p.d.block(nz, nw, ny, nu);
        let (b1, b2) = (p.b.block(0, 0, n, nw), p.b.block(0, nw, n, nu));
        let (c1, c2) = (p.c.block(0, 0, nz, n), p.c.block(nz, 0, ny, n));
        let (d11, d12) = (p.d.block(0, 0, nz, nw), p.d.block(0, nw, nz, nu));
        let d21 = p.d.block(nz, 0, ny, nw);
        let (e, f) = if linalg::max_abs(&d22) == 0.0 {
            (Matrix::identity(nu, nu), Matrix::identity(ny, ny))
        } else {
            let e = Matrix::identity(nu, nu) - k * &d22;
            if linalg::reciprocal_condition(&e)? < 1e-12 {
                return Ok(None);
            }
            (
                linalg::inverse(&e)?,
                linalg::inverse(&(Matrix::identity(ny, ny) - &d22 * k))?,
            )
        };
        let (b_u, d_u) = (&b2 * &e, &d12 * &e);
        let (c_y, d_y) = (&f * &c2, &f * &d21);
        let (kc, kd) = (k * &c_y, k * &d_y);
        let system = StateSpace {
            a: &p.a + &b2 * &kc,
            b: b1 + &b2 * &kd,
            c: c1 + &d12 * &kc,
            d: d11 + &d12 * &kd,
        };
        let poles = system.poles()?;
        Ok(Some(ClosedLoop {
            model,
            system,
            b_u,
            d_u,
            c_y,
            d_y,
            poles,
        }))
    }

    /// The largest spectral abscissa over the models, and its gradient.
    pub(crate) fn abscissa(&self, x: &[f64]) -> Result<Option<(f64, Vec<f64>)>, LinalgError> {
        let blocks = self.problem.blocks(x);
        let mut worst: Option<(f64, ClosedLoop<'a>)> = None;
        for model in &self.problem.models {
            let Some(closed) = self.close(model, &self.problem.gain(model, &blocks))? else {
                return Ok(None);
            };
            let abscissa = closed.abscissa();
            if worst.as_ref().is_none_or(|(a, _)| abscissa > *a) {
                worst = Some((abscissa, closed));
            }
        }
        let Some((abscissa, closed)) = worst else {
            return Ok(None);
        };
        let (values, right) = linalg::eigen(&closed.system.a)?;
        let n = values.len();
        let at = (0..n)
            .max_by(|&i, &j| values[i].re.total_cmp(&values[j].re))
            .unwrap_or(0);
        // Row `at` of the inverse of the eigenvector matrix is the left eigenvector with yᴴ x = 1.
        let unit = CMatrix::from_fn(n, 1, |i, _| c64::new(f64::from(u8::from(i == at)), 0.0));
        let left = linalg::solve_complex(&right.transpose(), &unit);
        let row = linalg::to_complex(&closed.b_u.transpose()) * &left;
        let column = linalg::to_complex(&closed.c_y) * CMatrix::from_fn(n, 1, |i, _| right[(i, at)]);
        let mut in_k = Matrix::from_fn(row.nrows(), column.nrows(), |i, j| (row[(i, 0)] * column[(j, 0)]).re);
        if linalg::check_finite(&in_k).is_err() {
            // A defective eigenvalue: no gradient exists. A zero gradient ends the descent there; another start continues.
            in_k = Matrix::zeros(row.nrows(), column.nrows());
        }
        Ok(Some((abscissa, self.problem.pull_back(closed.model, x, &in_k))))
    }

    /// The largest channel norm and its gradient. Stops as soon as the norm is known to exceed `ceiling`: the value is then
    /// infinite and the gradient empty.
    pub(crate) fn norm(&mut self, x: &[f64], ceiling: f64) -> Result<(ObjectiveValue, Vec<f64>), LinalgError> {
        let (value, loops) = self.loop_norms(x, ceiling)?;
        if value.gamma.is_infinite() {
            return Ok((value, Vec::new()));
        }
        let mut worst = (0, 0);
        for (m, norms) in value.channels.iter().enumerate() {
            for (c, norm) in norms.iter().enumerate() {
                if norm.gain > value.channels[worst.0][worst.1].gain {
                    worst = (m, c);
                }
            }
        }
        let (m, c) = worst;
        let pieces = self.pieces_at(&loops[m].closed, c, value.channels[m][c].omega, x, 1)?;
        Ok((value, pieces.into_iter().next().map(|p| p.gradient).unwrap_or_default()))
    }

    /// The norms, and the closed loops they belong to; none of these when a loop is unstable or the ceiling exceeded.
    pub(super) fn loop_norms(
        &mut self,
        x: &[f64],
        ceiling: f64,
    ) -> Result<(ObjectiveValue, Vec<LoopNorms<'a>>), LinalgError> {
        self.evaluations += 1;
        let blocks = self.problem.blocks(x);
        let count = self.problem.models.len();
        // The cheap tests first, over all models: stability, and the gain at the stored frequencies. The first model found above the
        // ceiling ends the evaluation of all; which model that is depends on the threads, but whether there is one does not.
        let above = AtomicBool::new(false);
        let first = parallel::map(count, self.threads, |m| {
            if above.load(Ordering::Relaxed) {
                return Ok(None);
            }
            let found = self.screen_loop(m, &blocks, ceiling)?;
            if found.as_ref().is_none_or(|entry| entry.norms.is_empty()) {
                above.store(true, Ordering::Relaxed);
            }
            Ok(found)
        });
        let mut value = ObjectiveValue {
            abscissa: f64::NEG_INFINITY,
            gamma: 0.0,
            channels: Vec::new(),
        };
        let mut loops = Vec::new();
        for found in first {
            if let Some(entry) = found? {
                value.abscissa = value.abscissa.max(entry.closed.abscissa());
                loops.push(entry);
            }
        }
        if above.into_inner() {
            value.gamma = f64::INFINITY;
            return Ok((value, Vec::new()));
        }
        let floor = self.screen * loops.iter().flat_map(|l| &l.norms).map(|n| n.gain).fold(0.0, f64::max);
        let norms = parallel::map(count, self.threads, |m| -> Result<Vec<ChannelNorm>, LinalgError> {
            let entry = &loops[m];
            let certain = |(part, seen): (&StateSpace, &ChannelNorm)| {
                if seen.gain < floor {
                    return Ok(*seen);
                }
                let found = norm::level_set_iteration(part, self.tolerance, &[seen.omega])?;
                Ok(ChannelNorm {
                    gain: found.gain,
                    omega: found.omega,
                })
            };
            entry.parts.iter().zip(&entry.norms).map(certain).collect()
        });
        for (m, found) in norms.into_iter().enumerate() {
            let found = found?;
            for (c, norm) in found.iter().enumerate() {
                value.gamma = value.gamma.max(norm.gain);
                store_peak(&mut self.recent_peaks[m][c], norm.omega);
            }
            value.channels.push(found);
        }
        Ok((value, loops))
    }

    /// One model: `None` when the loop cannot be closed, no norms when it is unstable or above the ceiling.
    fn screen_loop(&self, m: usize, blocks: &[Matrix], ceiling: f64) -> Result<Option<LoopNorms<'a>>, LinalgError> {
        let model = &self.problem.models[m];
        let Some(closed) = self.close(model, &self.problem.gain(model, blocks))? else {
            return Ok(None);
        };
        let mut entry = LoopNorms {
            parts: Vec::new(),
            norms: Vec::new(),
            closed,
        };
        let sizes = entry.closed.poles.iter().map(|p| p.norm());
        let fastest = sizes.fold(self.problem.fastest[m], f64::max);
        if entry.closed.abscissa() >= -MARGIN * fastest {
            return Ok(Some(entry));
        }
        let mut norms = Vec::new();
        for (c, channel) in model.channels.iter().enumerate() {
            let part = channel_system(&entry.closed.system, channel);
            let recent_peaks = &self.recent_peaks[m][c];
            let mut frequencies = recent_peaks.clone();
            if recent_peaks.is_empty() {
                frequencies.extend(norm::peak_guesses(&entry.closed.poles));
            }
            frequencies.extend([0.0, f64::INFINITY]);
            let mut best = ChannelNorm { gain: -1.0, omega: 0.0 };
            for omega in frequencies {
                let gain = norm::gain_at(&part, omega)?;
                if gain > best.gain {
                    best = ChannelNorm { gain, omega };
                }
                if gain > ceiling {
                    return Ok(Some(entry));
                }
            }
            norms.push(best);
            entry.parts.push(part);
        }
        entry.norms = norms;
        Ok(Some(entry))
    }

    /// The smooth pieces within a factor `depth` (below one) of the largest norm: every local peak of every channel, with
    /// up to three singular values at each. Skips no channel.
    pub(crate) fn pieces(&mut self, x: &[f64], depth: f64) -> Result<(ObjectiveValue, Vec<Piece>), LinalgError> {
        let screen = std::mem::replace(&mut self.screen, 0.0);
        let result = self.loop_norms(x, f64::INFINITY);
        self.screen = screen;
        let (value, loops) = result?;
        if value.gamma.is_infinite() {
            return Ok((value, Vec::new()));
        }
        let floor = depth * value.gamma;
        type Found = Result<(Vec<(usize, f64)>, Vec<Piece>), LinalgError>;
        let found = parallel::map(loops.len(), self.threads, |m| -> Found {
            let entry = &loops[m];
            let (mut peaks, mut pieces) = (Vec::new(), Vec::new());
            for (c, part) in entry.parts.iter().enumerate() {
                let top = value.channels[m][c];
                if top.gain < floor {
                    continue;
                }
                for omega in local_peaks(part, top, floor)?.into_iter().take(12) {
                    let near = self.pieces_at(&entry.closed, c, omega, x, 3)?;
                    pieces.extend(near.into_iter().filter(|p| p.value >= floor));
                    peaks.push((c, omega));
                }
            }
            Ok((peaks, pieces))
        });
        let mut pieces = Vec::new();
        for (m, found) in found.into_iter().enumerate() {
            let (peaks, mut some) = found?;
            pieces.append(&mut some);
            // The highest last, so that it is kept longest.
            for (c, omega) in peaks.into_iter().rev() {
                store_peak(&mut self.recent_peaks[m][c], omega);
            }
        }
        Ok((value, pieces))
    }

    /// Pieces from the `count` largest singular values of one channel at one frequency.
    fn pieces_at(
        &self,
        closed: &ClosedLoop<'_>,
        channel: usize,
        omega: f64,
        x: &[f64],
        count: usize,
    ) -> Result<Vec<Piece>, LinalgError> {
        let channel = &closed.model.channels[channel];
        let s = &closed.system;
        let n = s.states();
        let (nw, nz) = (channel.inputs.len(), channel.outputs.len());
        let b = linalg::to_complex(&s.b.block(0, channel.inputs.start, n, nw));
        let c = linalg::to_complex(&s.c.block(channel.outputs.start, 0, nz, n));
        let d = linalg::to_complex(&s.d.block(channel.outputs.start, channel.inputs.start, nz, nw));
        let d_y = linalg::to_complex(&closed.d_y.block(0, channel.inputs.start, closed.d_y.nrows(), nw));
        let d_u = linalg::to_complex(&closed.d_u.block(channel.outputs.start, 0, nz, closed.d_u.ncols()));
        let (b_u, c_y) = (linalg::to_complex(&closed.b_u), linalg::to_complex(&closed.c_y));
        // States per input, and outputs per state, at this frequency; at infinite frequency there are none.
        let (states, co_states) = if omega.is_infinite() {
            (CMatrix::zeros(n, nw), CMatrix::zeros(nz, n))
        } else {
            let pencil = shifted(&s.a, c64::new(0.0, omega));
            let co = linalg::solve_complex(&pencil.transpose(), &c.transpose());
            (linalg::solve_complex(&pencil, &b), co.transpose())
        };
        let t = &c * &states + d;
        let (u, sigma, v) = linalg::svd(&t)?;
        let to_y = &c_y * &states + d_y;
        let from_u = &co_states * &b_u + d_u;
        let mut out = Vec::new();
        for k in 0..count.min(sigma.len()) {
            if sigma[k] <= 0.0 {
                break;
            }
            let vk = CMatrix::from_fn(nw, 1, |i, _| v[(i, k)]);
            let uk = CMatrix::from_fn(1, nz, |_, i| u[(i, k)].conj());
            let (y, row) = (&to_y * &vk, &uk * &from_u);
            let in_k = Matrix::from_fn(row.ncols(), y.nrows(), |i, j| (row[(0, i)] * y[(j, 0)]).re);
            out.push(Piece {
                value: sigma[k],
                gradient: self.problem.pull_back(closed.model, x, &in_k),
            });
        }
        Ok(out)
    }
}

/// The closed loop of one channel with only the states that lie on a path from its inputs to its outputs, balanced.
fn channel_system(closed: &StateSpace, channel: &super::problem::Channel) -> StateSpace {
    crate::reduce::without_unconnected_states(&closed.select(channel.outputs.clone(), channel.inputs.clone()))
        .balanced()
}

/// Keeps the last few distinct peak frequencies.
fn store_peak(recent_peaks: &mut Vec<f64>, omega: f64) {
    recent_peaks.retain(|w| (w - omega).abs() > 1e-3 * omega && !(w.is_infinite() && omega.is_infinite()));
    recent_peaks.insert(0, omega);
    recent_peaks.truncate(6);
}

/// Frequencies of local maxima of the gain above `floor`, the highest first: every interval above it, by level crossings, and in each
/// the maxima of a few points, refined by golden-section search. Extra pieces only help the search, so a missed one does no harm.
fn local_peaks(g: &StateSpace, top: ChannelNorm, floor: f64) -> Result<Vec<f64>, LinalgError> {
    const POINTS: usize = 6;
    const GOLDEN: f64 = 0.381_966_011_250_105;
    let mut peaks = vec![(top.gain, top.omega)];
    let mut edges = vec![0.0];
    edges.extend(norm::level_crossings(g, floor)?.into_iter().filter(|w| *w > 0.0));
    edges.dedup_by(|a, b| (*a - *b).abs() <= 1e-6 * b.abs());
    for pair in edges.windows(2) {
        let (low, high) = (pair[0].max(1e-3 * pair[1]), pair[1]);
        let at = |i: usize| low * libm::pow(high / low, i as f64 / (POINTS + 1) as f64);
        let gains = (1..=POINTS)
            .map(|i| norm::gain_at(g, at(i)))
            .collect::<Result<Vec<_>, _>>()?;
        for i in 0..POINTS {
            let (left, right) = (
                i.checked_sub(1).map_or(floor, |k| gains[k]),
                *gains.get(i + 1).unwrap_or(&floor),
            );
            if gains[i] < floor || gains[i] < left || gains[i] < right {
                continue;
            }
            let (mut a, mut b) = (at(i), at(i + 2));
            let (mut best, mut peak) = (gains[i], at(i + 1));
            if (a..=b).contains(&top.omega) {
                continue;
            }
            while b - a > 1e-5 * b {
                let left = peak - a > b - peak;
                let trial = if left {
                    peak - GOLDEN * (peak - a)
                } else {
                    peak + GOLDEN * (b - peak)
                };
                let gain = norm::gain_at(g, trial)?;
                match (gain > best, left) {
                    (true, true) => (b, best, peak) = (peak, gain, trial),
                    (true, false) => (a, best, peak) = (peak, gain, trial),
                    (false, true) => a = trial,
                    (false, false) => b = trial,
                }
            }
            if peaks.iter().all(|(_, w)| (w - peak).abs() > 1e-3 * peak) {
                peaks.push((best, peak));
            }
        }
    }
    peaks.sort_by(|a, b| b.0.total_cmp(&a.0));
    Ok(peaks.into_iter().map(|p| p.1).collect())
}
