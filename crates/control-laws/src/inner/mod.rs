//! The inner loop: from the error of the generalised velocity to a feedback force (Eq 6 to 8).

mod gains;
mod solve;

pub use gains::Gains;

use crate::{Dof, Matrix13, ParameterError};
use solve::{ImplicitStep, Singular};

/// Feedback law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FeedbackLaw {
    /// Eq 7: proportional plus integral inside a saturation that the integrator takes into account (anti-windup).
    ConditionalIntegrator {
        /// Saturation bound of the feedback force.
        bound: Bound,
        /// Discretisation of the integrator.
        discretisation: Discretisation,
    },
    /// Eq 6: proportional plus integral, not bounded.
    ProportionalIntegral,
    /// Proportional, not bounded.
    Proportional,
}

/// Bound `F` of the feedback force.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Bound {
    /// One bound per channel, N m and N: with the limits of the actuators the feedback alone never exceeds them.
    PerChannel(Dof),
    /// The paper's `‖K_S‖ I`: one number for both N and N m.
    Scalar(f64),
}

/// Discretisation of the conditional integrator.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Discretisation {
    /// One implicit step: exact below saturation, and `|K_I σ| ≤ F` for every period (diagonal gains).
    #[default]
    Exact,
    /// Forward Euler, for comparison: `σ` may leave its bound when the period is long compared with `K_P / K_I`.
    Euler,
}

/// The feedback at an instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Feedback {
    /// Feedback force `u_CI`: `[m_b; f_b; τ]`, N m, N, N m.
    pub force: Dof,
    /// Which channels saturate.
    pub saturated: [bool; 13],
    /// Whether the implicit step was solved; otherwise the force is NaN and the integral is unchanged. For gains accepted by
    /// [`InnerLoop::new`] a solution always exists, and it is found for every finite state and error.
    pub converged: bool,
}

/// The inner loop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InnerLoop {
    gains: Gains,
    /// Current `K_P`: constant, or that of the last mass matrix.
    kp: Matrix13,
    bound: Option<Dof>,
    integrates: bool,
    discretisation: Discretisation,
    period_s: f64,
    implicit: ImplicitStep,
    sigma: Dof,
}

impl InnerLoop {
    /// An inner loop with zero integral, stepped every `period_s`.
    ///
    /// # Errors
    ///
    /// If `K_P` is not positive definite, `K_I` is not positive semidefinite, or a bound is not above zero, or if couplings in `K_I`
    /// leave the implicit step in saturation without a solution or with several.
    pub fn new(gains: Gains, law: &FeedbackLaw, period_s: f64) -> Result<Self, ParameterError> {
        ParameterError::positive("period_s", period_s)?;
        gains.validate()?;
        let implicit = ImplicitStep::new(gains.kp(), gains.ki(), period_s).map_err(|singular| {
            let (field, matrix) = match singular {
                Singular::Kp => ("inner.kp", gains.kp()),
                Singular::Ki => ("inner.ki", gains.ki()),
            };
            ParameterError::new(field, matrix.diagonal().as_slice(), "must be regular")
        })?;
        let (bound, discretisation) = match *law {
            FeedbackLaw::ConditionalIntegrator {
                bound: Bound::PerChannel(bound),
                discretisation,
            } => (Some(bound), discretisation),
            FeedbackLaw::ConditionalIntegrator {
                bound: Bound::Scalar(bound),
                discretisation,
            } => (Some(Dof::repeat(bound)), discretisation),
            FeedbackLaw::ProportionalIntegral | FeedbackLaw::Proportional => (None, Discretisation::Exact),
        };
        for value in bound.iter().flat_map(Dof::iter) {
            ParameterError::positive("inner.bound", *value)?;
        }
        let solved = bound.is_some() && discretisation == Discretisation::Exact;
        if solved && !gains.has_diagonal_ki() && !implicit.has_one_solution() {
            let remedy = "its couplings, against those of K_P, leave the saturated step without a solution or with several; make K_I \
                          diagonal, or its couplings smaller";
            return Err(ParameterError::new(
                "inner.ki",
                gains.ki().diagonal().as_slice(),
                remedy,
            ));
        }
        Ok(Self {
            gains,
            kp: *gains.kp(),
            bound,
            integrates: *law != FeedbackLaw::Proportional,
            discretisation,
            period_s,
            implicit,
            sigma: Dof::zeros(),
        })
    }

    /// Integral of the velocity error `σ`, rad and m.
    pub fn sigma(&self) -> &Dof {
        &self.sigma
    }

    /// Continues from an integral, bit for bit.
    pub fn restore(&mut self, sigma: &[f64; 13]) {
        self.sigma = (*sigma).into();
    }

    /// Whether [`Self::schedule`] must be called with the mass matrix before every step.
    pub fn is_scheduled(&self) -> bool {
        self.gains.is_scheduled()
    }

    /// Updates scheduled gains from the mass matrix. No state is carried from step to step.
    pub fn schedule(&mut self, mass: &Matrix13) {
        self.kp = self.gains.kp_at(mass);
    }

    /// The implicit step for the current gains. Scheduled gains are inverted only when needed: while the feedback saturates.
    fn implicit(&self) -> Option<ImplicitStep> {
        if self.is_scheduled() {
            ImplicitStep::new(&self.kp, self.gains.ki(), self.period_s).ok()
        } else {
            Some(self.implicit)
        }
    }

    /// Computes the feedback for the velocity error `y = ṽ_v − ṽ` and advances the integral by one period.
    pub fn step(&mut self, error: &Dof) -> Feedback {
        let proportional = self.kp * error;
        if !self.integrates {
            return Feedback::unbounded(proportional);
        }
        let candidate = self.sigma + error * self.period_s;
        let Some(bound) = self.bound else {
            self.sigma = candidate; // Eq 6
            return Feedback::unbounded(self.gains.ki() * self.sigma + proportional);
        };
        match self.discretisation {
            Discretisation::Euler => self.euler(&proportional, &bound),
            Discretisation::Exact => {
                let unbounded_force = self.gains.ki() * candidate + proportional;
                if !exceeds(&unbounded_force, &bound).contains(&true) {
                    // below saturation Eq 7 is Eq 6
                    self.sigma = candidate;
                    return Feedback::unbounded(unbounded_force);
                }
                let solution = if self.gains.is_diagonal() {
                    self.implicit.diagonal(&self.sigma, error, &proportional, &bound)
                } else if let Some(implicit) = self.implicit() {
                    implicit.full(&self.sigma, error, &proportional, &bound)
                } else {
                    return Feedback::not_a_number();
                };
                if !solution.converged {
                    return Feedback::not_a_number();
                }
                self.sigma = solution.sigma;
                Feedback::bounded(&solution.unbounded_force, &bound)
            }
        }
    }

    fn euler(&mut self, proportional: &Dof, bound: &Dof) -> Feedback {
        // H⁻¹(G σ + y) = F⁻¹(K_I σ + K_P y)
        let unbounded_force = self.gains.ki() * self.sigma + proportional;
        let feedback = Feedback::bounded(&unbounded_force, bound);
        // σ̇ = −G σ + H sat₁(·), with G = K_P⁻¹ K_I and H sat₁ = K_P⁻¹ u_CI
        let Some(implicit) = self.implicit() else {
            return Feedback::not_a_number();
        };
        self.sigma += implicit.kp_inverse() * (feedback.force - self.gains.ki() * self.sigma) * self.period_s;
        feedback
    }
}

impl Feedback {
    /// Result for gains that are not finite.
    fn not_a_number() -> Self {
        Self {
            converged: false,
            ..Self::unbounded(Dof::repeat(f64::NAN))
        }
    }

    fn unbounded(force: Dof) -> Self {
        Self {
            force,
            saturated: [false; 13],
            converged: true,
        }
    }

    fn bounded(unbounded_force: &Dof, bound: &Dof) -> Self {
        Self {
            force: unbounded_force.zip_map(bound, |value, bound| value.clamp(-bound, bound)),
            saturated: exceeds(unbounded_force, bound),
            converged: true,
        }
    }
}

fn exceeds(unbounded_force: &Dof, bound: &Dof) -> [bool; 13] {
    std::array::from_fn(|channel| unbounded_force[channel].abs() > bound[channel])
}
