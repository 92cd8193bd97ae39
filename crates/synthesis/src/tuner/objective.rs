//! The two functions that are minimised, with their gradients: the spectral abscissa and the largest channel norm.
//!
//! Gradients of the norm: at a peak ω with singular vectors u, v of the closed loop T(jω), `dσ = Re(uᴴ dT v)` and
//! `dT = G₁₂ dK G₂₁`, where G₂₁ leads from w to y and G₁₂ from a disturbance added to u to z, both in closed loop
//! (Apkarian and Noll 2006, section III). Gradients of the abscissa: `dλ = yᴴ dA x / yᴴ x` (Burke, Lewis and Overton 2006).

use super::problem::{Checked, Model};
use crate::balance;
use crate::linalg::{self, CMatrix, LinalgError, Matrix, c64};
use crate::norm;
use crate::state_space::{StateSpace, shifted};

/// A smooth piece of the objective near a point: its value there and its gradient.
#[derive(Debug, Clone)]
pub(crate) struct Piece {
    pub(crate) value: f64,
    pub(crate) gradient: Vec<f64>,
}

/// The closed loop of one model with what gradients need.
struct Closed<'a> {
    model: &'a Model,
    /// Closed loop from w to z.
    system: StateSpace,
    /// From an addition to u to the states and to z.
    b_u: Matrix,
    d_u: Matrix,
    /// From the states and from w to y.
    c_y: Matrix,
    d_y: Matrix,
    poles: Vec<c64>,
}

impl Closed<'_> {
    fn abscissa(&self) -> f64 {
        self.poles.iter().map(|p| p.re).fold(f64::NEG_INFINITY, f64::max)
    }
}

/// Where a channel peaked.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ChannelNorm {
    pub(crate) gain: f64,
    pub(crate) omega: f64,
}

/// The value of the objective at a point.
#[derive(Debug, Clone)]
pub(crate) struct Value {
    /// The largest spectral abscissa of the models.
    pub(crate) abscissa: f64,
    /// The largest channel norm; infinite when a model is unstable.
    pub(crate) gamma: f64,
    /// Norm and peak per model and channel; empty when unstable.
    pub(crate) channels: Vec<Vec<ChannelNorm>>,
}

/// Evaluates objectives and remembers the frequencies at which each channel peaked lately: the next evaluation, at a
/// point nearby, starts from them and usually needs a single Hamiltonian test to be certain.
pub(crate) struct Objective<'a> {
    pub(crate) problem: &'a Checked,
    memory: Vec<Vec<Vec<f64>>>,
    tolerance: f64,
    /// Evaluations of the norm so far.
    pub(crate) evaluations: usize,
}

/// A closed loop must be at least this far from the axis, relative to its fastest pole, to count as stable.
const MARGIN: f64 = 1e-13;

impl<'a> Objective<'a> {
    pub(crate) fn new(problem: &'a Checked, tolerance: f64) -> Self {
        let memory = problem
            .models
            .iter()
            .map(|m| vec![Vec::new(); m.channels.len()])
            .collect();
        Self {
            problem,
            memory,
            tolerance,
            evaluations: 0,
        }
    }

    fn close(&self, model: &'a Model, k: &Matrix) -> Result<Option<Closed<'a>>, LinalgError> {
        let p = &model.plant;
        let (n, nu, ny) = (p.states(), model.controls, model.measurements);
        let (nw, nz) = (p.inputs() - nu, p.outputs() - ny);
        let d22 = linalg::sub(&p.d, nz, nw, ny, nu);
        let (b1, b2) = (linalg::sub(&p.b, 0, 0, n, nw), linalg::sub(&p.b, 0, nw, n, nu));
        let (c1, c2) = (linalg::sub(&p.c, 0, 0, nz, n), linalg::sub(&p.c, nz, 0, ny, n));
        let (d11, d12) = (linalg::sub(&p.d, 0, 0, nz, nw), linalg::sub(&p.d, 0, nw, nz, nu));
        let d21 = linalg::sub(&p.d, nz, 0, ny, nw);
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
        Ok(Some(Closed {
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
        let mut worst: Option<(f64, Closed<'a>)> = None;
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
        let left = linalg::solve_complex(&right.transpose().to_owned(), &unit);
        let row = linalg::to_complex(&closed.b_u.transpose().to_owned()) * &left;
        let column = linalg::to_complex(&closed.c_y) * CMatrix::from_fn(n, 1, |i, _| right[(i, at)]);
        let mut in_k = Matrix::from_fn(row.nrows(), column.nrows(), |i, j| (row[(i, 0)] * column[(j, 0)]).re);
        if linalg::check_finite(&in_k).is_err() {
            // A defective eigenvalue: no gradient exists. A zero one ends the descent there, another start goes on.
            in_k = Matrix::zeros(row.nrows(), column.nrows());
        }
        Ok(Some((abscissa, self.problem.pull_back(closed.model, x, &in_k))))
    }

    /// The largest channel norm and its gradient. Gives up as soon as the norm is known to exceed `ceiling`: the value
    /// is then a lower bound and the gradient is empty.
    pub(crate) fn norm(&mut self, x: &[f64], ceiling: f64) -> Result<(Value, Vec<f64>), LinalgError> {
        self.evaluations += 1;
        let blocks = self.problem.blocks(x);
        let mut value = Value {
            abscissa: f64::NEG_INFINITY,
            gamma: 0.0,
            channels: Vec::new(),
        };
        let mut loops = Vec::new();
        for model in &self.problem.models {
            match self.close(model, &self.problem.gain(model, &blocks))? {
                Some(closed) => {
                    value.abscissa = value.abscissa.max(closed.abscissa());
                    let fastest = closed.poles.iter().map(|p| p.norm()).fold(0.0, f64::max);
                    if closed.abscissa() >= -MARGIN * fastest {
                        value.gamma = f64::INFINITY;
                    }
                    loops.push(closed);
                }
                None => value.gamma = f64::INFINITY,
            }
        }
        if value.gamma.is_infinite() {
            return Ok((value, Vec::new()));
        }
        let parts: Vec<Vec<StateSpace>> = loops
            .iter()
            .map(|c| {
                c.model
                    .channels
                    .iter()
                    .map(|ch| channel_system(&c.system, ch))
                    .collect()
            })
            .collect();
        // The cheap test first, over all channels: the gain at the frequencies that mattered lately.
        let mut quick = 0.0f64;
        if ceiling.is_finite() {
            for (part, memory) in parts.iter().flatten().zip(self.memory.iter().flatten()) {
                for &omega in memory {
                    quick = quick.max(norm::gain_at(part, omega)?);
                    if quick > ceiling {
                        value.gamma = quick;
                        return Ok((value, Vec::new()));
                    }
                }
            }
        }
        let mut worst = (0, 0, ChannelNorm { gain: -1.0, omega: 0.0 });
        for (m, closed) in loops.iter().enumerate() {
            let mut norms = Vec::new();
            for (c, part) in parts[m].iter().enumerate() {
                let mut start = vec![0.0, f64::INFINITY];
                if self.memory[m][c].is_empty() {
                    start.extend(norm::peak_guesses(&closed.poles));
                } else {
                    start.extend(&self.memory[m][c]);
                }
                let found = norm::climb(part, self.tolerance, &start)?;
                let here = ChannelNorm {
                    gain: found.gain,
                    omega: found.omega,
                };
                remember(&mut self.memory[m][c], found.omega);
                if here.gain > worst.2.gain {
                    worst = (m, c, here);
                }
                norms.push(here);
            }
            value.channels.push(norms);
        }
        value.gamma = worst.2.gain;
        let (m, c, peak) = worst;
        let pieces = self.pieces_at(&loops[m], c, peak.omega, x, 1)?;
        Ok((value, pieces.into_iter().next().map(|p| p.gradient).unwrap_or_default()))
    }

    /// The smooth pieces within a factor `depth` (below one) of the largest norm: every local peak of every channel, with
    /// up to three singular values at each.
    pub(crate) fn pieces(&mut self, x: &[f64], depth: f64) -> Result<(Value, Vec<Piece>), LinalgError> {
        let (value, _) = self.norm(x, f64::INFINITY)?;
        let mut pieces = Vec::new();
        if value.gamma.is_infinite() {
            return Ok((value, pieces));
        }
        let blocks = self.problem.blocks(x);
        for (m, model) in self.problem.models.iter().enumerate() {
            let Some(closed) = self.close(model, &self.problem.gain(model, &blocks))? else {
                continue;
            };
            for c in 0..model.channels.len() {
                let top = value.channels[m][c];
                if top.gain < depth * value.gamma {
                    continue;
                }
                let part = channel_system(&closed.system, &model.channels[c]);
                let mut peaks = local_peaks(&part, &closed.poles, top, depth * value.gamma)?;
                peaks.truncate(12);
                for omega in peaks {
                    let near = self.pieces_at(&closed, c, omega, x, 3)?;
                    pieces.extend(near.into_iter().filter(|p| p.value >= depth * value.gamma));
                    remember(&mut self.memory[m][c], omega);
                }
            }
        }
        Ok((value, pieces))
    }

    /// Pieces from the `count` largest singular values of one channel at one frequency.
    fn pieces_at(
        &self,
        closed: &Closed<'_>,
        channel: usize,
        omega: f64,
        x: &[f64],
        count: usize,
    ) -> Result<Vec<Piece>, LinalgError> {
        let channel = &closed.model.channels[channel];
        let s = &closed.system;
        let n = s.states();
        let (nw, nz) = (channel.inputs.len(), channel.outputs.len());
        let b = linalg::to_complex(&linalg::sub(&s.b, 0, channel.inputs.start, n, nw));
        let c = linalg::to_complex(&linalg::sub(&s.c, channel.outputs.start, 0, nz, n));
        let d = linalg::to_complex(&linalg::sub(&s.d, channel.outputs.start, channel.inputs.start, nz, nw));
        let d_y = linalg::to_complex(&linalg::sub(
            &closed.d_y,
            0,
            channel.inputs.start,
            closed.d_y.nrows(),
            nw,
        ));
        let d_u = linalg::to_complex(&linalg::sub(
            &closed.d_u,
            channel.outputs.start,
            0,
            nz,
            closed.d_u.ncols(),
        ));
        let (b_u, c_y) = (linalg::to_complex(&closed.b_u), linalg::to_complex(&closed.c_y));
        // States per input, and outputs per state, at this frequency; at infinite frequency there are none.
        let (states, co_states) = if omega.is_infinite() {
            (CMatrix::zeros(n, nw), CMatrix::zeros(nz, n))
        } else {
            let pencil = shifted(&s.a, c64::new(0.0, omega));
            let co = linalg::solve_complex(&pencil.transpose().to_owned(), &c.transpose().to_owned());
            (linalg::solve_complex(&pencil, &b), co.transpose().to_owned())
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
    balance::balanced_system(&crate::reduce::on_path(
        &closed.select(channel.outputs.clone(), channel.inputs.clone()),
    ))
}

/// Keeps the last few distinct peak frequencies.
fn remember(memory: &mut Vec<f64>, omega: f64) {
    memory.retain(|w| (w - omega).abs() > 1e-3 * omega && !(w.is_infinite() && omega.is_infinite()));
    memory.insert(0, omega);
    memory.truncate(6);
}

/// Frequencies of local maxima of the gain above `floor`: the known peak, and what a grid through the poles shows,
/// refined by golden sections. Extra pieces only help the search, so a peak missed here does no harm.
fn local_peaks(g: &StateSpace, poles: &[c64], top: ChannelNorm, floor: f64) -> Result<Vec<f64>, LinalgError> {
    let mut grid = norm::peak_guesses(poles);
    if top.omega.is_finite() {
        grid.push(top.omega);
    }
    grid.push(0.0);
    grid.sort_by(f64::total_cmp);
    grid.dedup_by(|a, b| (*a - *b).abs() <= 1e-3 * b.abs());
    let middle: Vec<f64> = grid
        .windows(2)
        .map(|w| if w[0] > 0.0 { (w[0] * w[1]).sqrt() } else { 0.5 * w[1] })
        .collect();
    grid.extend(middle);
    grid.sort_by(f64::total_cmp);
    let gains = grid
        .iter()
        .map(|&w| norm::gain_at(g, w))
        .collect::<Result<Vec<_>, _>>()?;
    let mut peaks = vec![(top.gain, top.omega)];
    for i in 0..grid.len() {
        let left = if i > 0 { gains[i - 1] } else { f64::NEG_INFINITY };
        let right = if i + 1 < grid.len() {
            gains[i + 1]
        } else {
            f64::NEG_INFINITY
        };
        if gains[i] < left || gains[i] < right || gains[i] < 0.8 * floor {
            continue;
        }
        let (mut a, mut b) = (
            if i > 0 { grid[i - 1] } else { grid[i] },
            if i + 1 < grid.len() { grid[i + 1] } else { grid[i] },
        );
        let (mut best, mut at) = (gains[i], grid[i]);
        const GOLDEN: f64 = 0.381_966_011_250_105;
        for _ in 0..24 {
            if b - a <= 1e-6 * b {
                break;
            }
            let trial = if at - a > b - at {
                at - GOLDEN * (at - a)
            } else {
                at + GOLDEN * (b - at)
            };
            let gain = norm::gain_at(g, trial)?;
            let (inner, outer) = (trial.min(at), trial.max(at));
            if gain > best {
                if trial > at {
                    a = inner
                } else {
                    b = outer
                }
                (best, at) = (gain, trial);
            } else if trial > at {
                b = outer;
            } else {
                a = inner;
            }
        }
        if best >= floor && peaks.iter().all(|(_, w)| (w - at).abs() > 1e-3 * at) {
            peaks.push((best, at));
        }
    }
    peaks.sort_by(|a, b| b.0.total_cmp(&a.0));
    Ok(peaks.into_iter().map(|p| p.1).collect())
}
