//! The implicit step of the conditional integrator while it saturates.
//!
//! `σ⁺ = σ + T (−G σ⁺ + K_P⁻¹ sat_F(K_I σ⁺ + K_P y))` with `G = K_P⁻¹ K_I`. The right-hand side is monotone in `σ⁺`, so with diagonal gains
//! there is one solution, and it has a closed form a channel.

use crate::{Dof, Matrix13};

/// Rounds of the fixed point before it counts as not converged. One round shrinks the error by `T G / (1 + T G)`, 0.005 for the baseline.
const ROUNDS_MAX: usize = 200;

/// What an implicit step found.
pub(super) struct Solution {
    /// The integral at the end of the period.
    pub(super) sigma: Dof,
    /// `K_I σ⁺ + K_P y`, before the bound.
    pub(super) wanted: Dof,
    /// Whether the fixed point settled to rounding.
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

/// Everything of the step that does not change: products of the gains and the period.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ImplicitStep {
    kp: Dof,
    ki: Matrix13,
    period_s: f64,
    kp_inverse: Matrix13,
    /// `(I + T G)⁻¹`.
    carry: Matrix13,
    /// `(I + T G)⁻¹ T K_P⁻¹`.
    drive: Matrix13,
}

impl ImplicitStep {
    /// For regular gains; says which is not.
    pub(super) fn new(kp: &Matrix13, ki: &Matrix13, period_s: f64) -> Result<Self, Singular> {
        let kp_inverse = kp.try_inverse().ok_or(Singular::Kp)?;
        let carry = (Matrix13::identity() + kp_inverse * ki * period_s)
            .try_inverse()
            .ok_or(Singular::Ki)?;
        Ok(Self {
            kp: kp.diagonal(),
            ki: *ki,
            period_s,
            kp_inverse,
            carry,
            drive: carry * kp_inverse * period_s,
        })
    }

    pub(super) fn kp_inverse(&self) -> &Matrix13 {
        &self.kp_inverse
    }

    /// Diagonal gains: channel by channel, in closed form.
    pub(super) fn diagonal(&self, sigma: &Dof, error: &Dof, proportional: &Dof, bound: &Dof) -> Solution {
        let mut solution = Solution {
            sigma: *sigma,
            wanted: *proportional,
            converged: true,
        };
        for channel in 0..13 {
            let (kp, ki) = (self.kp[channel], self.ki[(channel, channel)]);
            let candidate = sigma[channel] + self.period_s * error[channel];
            let wanted = ki * candidate + proportional[channel];
            solution.sigma[channel] = if wanted.abs() <= bound[channel] {
                candidate
            } else {
                (sigma[channel] + self.period_s * (bound[channel] / kp).copysign(wanted))
                    / (1.0 + self.period_s * ki / kp)
            };
            solution.wanted[channel] = ki * solution.sigma[channel] + proportional[channel];
        }
        solution
    }

    /// Full gains: the same step as a fixed point.
    pub(super) fn full(&self, sigma: &Dof, proportional: &Dof, bound: &Dof) -> Solution {
        let carried = self.carry * sigma;
        let mut next = *sigma;
        let mut converged = false;
        for _ in 0..ROUNDS_MAX {
            let wanted = self.ki * next + proportional;
            let force = wanted.zip_map(bound, |value, bound| value.clamp(-bound, bound));
            let candidate = carried + self.drive * force;
            converged = (candidate - next).amax() <= 4.0 * f64::EPSILON * candidate.amax();
            next = candidate;
            if converged {
                break;
            }
        }
        Solution {
            sigma: next,
            wanted: self.ki * next + proportional,
            converged,
        }
    }
}
