//! Implicit step of the conditional integrator in saturation.
//!
//! `σ⁺ = σ + T (−G σ⁺ + K_P⁻¹ sat_F(K_I σ⁺ + K_P y))` with `G = K_P⁻¹ K_I`. With diagonal gains there is one solution, in closed form
//! per channel. With full gains a fixed-point iteration finds it where `T G` is small, and [pivoting](ImplicitStep::pivoted) wherever the
//! solution is unique.
//!
//! In terms of `w = K_I σ⁺ + K_P y` and its excess `d` over the bounds, the equation is `w + A d(w) = w₀` with `A = T K_I K_P⁻¹` and
//! `w₀ = K_I (σ + T y) + K_P y`: piecewise linear, with one piece for each set S of saturated channels. It has exactly one solution for
//! every `w₀` when `det(I + A_SS) > 0` for all S, because then all pieces have the same orientation. A diagonal `K_I` always satisfies
//! this: `det(I + A_SS) = det(I + T K_I,S (K_P⁻¹)_SS)` is a sum of products of entries of `T K_I ≥ 0` and of principal minors of `K_P⁻¹`,
//! which are positive because `K_P` is positive definite. A `K_I` with couplings may not; [`ImplicitStep::has_one_solution`] checks.

use crate::{DOF, Dof, Matrix13};

/// Fixed-point iterations. One iteration multiplies the error by about `T G / (1 + T G)`, 0.005 for the baseline; where `K_I` and `K_P`
/// do not commute and `T G` is large, the error may grow instead.
const ROUNDS_MAX: usize = 200;

/// Pieces that pivoting may cross: each channel may enter and leave its bounds several times. Guarantees termination despite rounding.
const PIECES_MAX: usize = 16 * DOF;

/// Solution of an implicit step.
pub(super) struct Solution {
    /// The integral at the end of the period.
    pub(super) sigma: Dof,
    /// `K_I σ⁺ + K_P y`, before the bound.
    pub(super) unbounded_force: Dof,
    /// Whether the solution converged to rounding accuracy.
    pub(super) converged: bool,
}

/// A matrix of the step that cannot be inverted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Singular {
    /// `K_P`.
    Kp,
    /// `I + T K_P⁻¹ K_I`.
    Ki,
}

/// Constants of the step: products of the gains and the period.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ImplicitStep {
    kp: Dof,
    ki: Matrix13,
    period_s: f64,
    kp_inverse: Matrix13,
    /// `(I + T G)⁻¹`.
    state_factor: Matrix13,
    /// `(I + T G)⁻¹ T K_P⁻¹`.
    input_factor: Matrix13,
}

impl ImplicitStep {
    /// Builds the step for regular gains; returns the singular matrix otherwise.
    pub(super) fn new(kp: &Matrix13, ki: &Matrix13, period_s: f64) -> Result<Self, Singular> {
        let kp_inverse = kp.try_inverse().ok_or(Singular::Kp)?;
        let state_factor = (Matrix13::identity() + kp_inverse * ki * period_s)
            .try_inverse()
            .ok_or(Singular::Ki)?;
        Ok(Self {
            kp: kp.diagonal(),
            ki: *ki,
            period_s,
            kp_inverse,
            state_factor,
            input_factor: state_factor * kp_inverse * period_s,
        })
    }

    pub(super) fn kp_inverse(&self) -> &Matrix13 {
        &self.kp_inverse
    }

    /// Diagonal gains: channel by channel, in closed form.
    pub(super) fn diagonal(&self, sigma: &Dof, error: &Dof, proportional: &Dof, bound: &Dof) -> Solution {
        let mut solution = Solution {
            sigma: *sigma,
            unbounded_force: *proportional,
            converged: true,
        };
        for channel in 0..13 {
            let (kp, ki) = (self.kp[channel], self.ki[(channel, channel)]);
            let candidate = sigma[channel] + self.period_s * error[channel];
            let unbounded_force = ki * candidate + proportional[channel];
            solution.sigma[channel] = if unbounded_force.abs() <= bound[channel] {
                candidate
            } else {
                (sigma[channel] + self.period_s * (bound[channel] / kp).copysign(unbounded_force))
                    / (1.0 + self.period_s * ki / kp)
            };
            solution.unbounded_force[channel] = ki * solution.sigma[channel] + proportional[channel];
        }
        solution
    }

    /// Whether the step of full gains has exactly one solution for every state and error: `det(I + A_SS) > 0` for all 2¹³ choices S of
    /// saturated channels. The determinant is affine in the share of each channel, so positivity at the corners suffices.
    pub(super) fn has_one_solution(&self) -> bool {
        let coupling = self.coupling();
        (0..1_u32 << DOF).all(|set| {
            let within = |channel: usize| set >> channel & 1 == 1;
            saturated_rows(&coupling, within).determinant() > 0.0
        })
    }

    /// `A = T K_I K_P⁻¹`.
    fn coupling(&self) -> Matrix13 {
        self.ki * self.kp_inverse * self.period_s
    }

    /// Full gains: fixed-point iteration and, where that does not converge, pivoting.
    pub(super) fn full(&self, sigma: &Dof, error: &Dof, proportional: &Dof, bound: &Dof) -> Solution {
        let carried = self.state_factor * sigma;
        let mut next = *sigma;
        for _ in 0..ROUNDS_MAX {
            let unbounded_force = self.ki * next + proportional;
            let force = unbounded_force.zip_map(bound, |value, bound| value.clamp(-bound, bound));
            let candidate = carried + self.input_factor * force;
            let settled = (candidate - next).amax() <= 4.0 * f64::EPSILON * candidate.amax();
            next = candidate;
            if settled {
                return Solution {
                    sigma: next,
                    unbounded_force: self.ki * next + proportional,
                    converged: true,
                };
            }
        }
        let unbounded = self.ki * (sigma + error * self.period_s) + proportional;
        let force = self.pivoted(&unbounded, bound);
        let next = carried + self.input_factor * force.unwrap_or(Dof::repeat(f64::NAN));
        Solution {
            sigma: next,
            unbounded_force: self.ki * next + proportional,
            converged: force.is_some(),
        }
    }

    /// The bounded force `sat_F(w)` for the solution of `w + A d(w) = w₀`.
    ///
    /// A homotopy in the bounds: they start at `F + p`, where nothing saturates, and decrease to `F`. On the way w follows straight
    /// segments, one per piece; at the end of a piece one channel enters or leaves its bound, and uniqueness of the solution for every
    /// bound means that the path never turns back. `p` differs from channel to channel so that no two reach their bounds at once, whatever
    /// symmetry the gains have. Stops at the first piece that holds at `F` itself: the returned value comes from one linear solve and
    /// carries no error from earlier pieces.
    fn pivoted(&self, unbounded: &Dof, bound: &Dof) -> Option<Dof> {
        let coupling = self.coupling();
        let margin = Dof::from_fn(|channel, _| (unbounded[channel].abs() + bound[channel]) * distinct_factor(channel));
        let mut side = [0.0_f64; DOF];
        for _ in 0..PIECES_MAX {
            let within = |channel: usize| side[channel] != 0.0;
            let signs = Dof::from(side);
            // d = at + λ along on this piece, with the bounds at F + λ p; zero in the unsaturated channels
            let piece = saturated_rows(&coupling, within).lu();
            let only = |value: Dof| Dof::from_fn(|channel, _| if within(channel) { value[channel] } else { 0.0 });
            let at = only(piece.solve(&only(unbounded - signs.component_mul(bound)))?);
            let along = only(piece.solve(&-signs.component_mul(&margin))?);
            let (coupled, coupled_along) = (coupling * at, coupling * along);
            let sum = coupling.abs() * at.abs();
            let mut next: Option<(f64, usize, f64)> = None;
            for (channel, &towards) in side.iter().enumerate() {
                let slack = 1e-13 * (unbounded[channel].abs() + bound[channel] + sum[channel]);
                // distance of the channel from the end of the piece, at λ = 0 and per λ, and its side beyond that end
                let segment_ends = if within(channel) {
                    [(at[channel] * towards, along[channel] * towards, 0.0); 2]
                } else {
                    let unbounded_force = unbounded[channel] - coupled[channel];
                    [1.0, -1.0].map(|to| {
                        let gap = bound[channel] - to * unbounded_force;
                        (gap, margin[channel] + to * coupled_along[channel], to)
                    })
                };
                for (gap, slope, to) in segment_ends {
                    let reached = -gap / slope;
                    if gap < -slack && next.is_none_or(|(best, ..)| reached > best) {
                        next = Some((reached, channel, to));
                    }
                }
            }
            match next {
                Some((_, channel, to)) => side[channel] = to,
                None => {
                    let force = signs.component_mul(bound);
                    let free = unbounded - coupled;
                    let force = Dof::from_fn(|channel, _| if within(channel) { force[channel] } else { free[channel] });
                    return force.iter().all(|value| value.is_finite()).then_some(force);
                }
            }
        }
        None
    }
}

/// `I + A` in the rows of the channels that saturate, and the identity in the others.
fn saturated_rows(coupling: &Matrix13, within: impl Fn(usize) -> bool) -> Matrix13 {
    Matrix13::from_fn(|row, column| {
        let own = if row == column { 1.0 } else { 0.0 };
        if within(row) {
            own + coupling[(row, column)]
        } else {
            own
        }
    })
}

/// A value between 1 and 2, different for every channel: multiples of the golden ratio modulo 1.
fn distinct_factor(channel: usize) -> f64 {
    1.0 + (channel as f64 * 0.618_033_988_749_894_9).fract()
}
