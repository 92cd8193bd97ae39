//! Velocity tracker common to all laws: from a virtual velocity to a force (Eq 5 to 8).

use crate::filter::{FilterParameters, FilterState, ShapingFilter};
use crate::inner::{Feedback, FeedbackLaw, Gains, InnerLoop};
use crate::model::ControlModel;
use crate::{DOF, Dof, Measured, ParameterError};
use serde::{Deserialize, Serialize};

/// User parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrackerParameters {
    /// Time between two steps, s.
    pub period_s: f64,
    /// The command-shaping filter.
    pub filter: FilterParameters,
    /// Velocity that is fed back and enters `C ṽ`.
    pub followed: TrackedVelocity,
    /// Gains of the inner loop.
    pub gains: Gains,
    /// Feedback law.
    pub feedback: FeedbackLaw,
}

/// Velocity that the inner loop follows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum TrackedVelocity {
    /// The virtual velocity from the outer loop, as in the paper.
    #[default]
    Raw,
    /// The filter's velocity, of which the virtual acceleration is the derivative.
    Filtered,
}

/// State of a velocity tracker, as plain numbers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TrackerState {
    /// State of the shaping filter.
    pub filter: FilterState,
    /// Integral of the velocity error `σ`, rad and m.
    pub sigma: [f64; DOF],
}

/// A force and its components.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tracking {
    /// Generalised force `u = u_CI + M v̇_v + C ṽ_v`: `[m_b; f_b; τ]`, N m, N, N m.
    pub force: Dof,
    /// The feedback part.
    pub feedback: Feedback,
    /// Virtual acceleration `v̇_v`.
    pub acceleration: Dof,
    /// Velocity error `y = ṽ_v − ṽ`.
    pub error: Dof,
}

/// Shaping filter, inner loop and model feed-forward.
#[derive(Debug, Clone)]
pub(crate) struct Tracker {
    model: ControlModel,
    filter: ShapingFilter,
    followed: TrackedVelocity,
    inner: InnerLoop,
}

impl Tracker {
    pub(crate) fn new(model: ControlModel, parameters: &TrackerParameters) -> Result<Self, ParameterError> {
        Ok(Self {
            model,
            filter: ShapingFilter::new(&parameters.filter, parameters.period_s)?,
            followed: parameters.followed,
            inner: InnerLoop::new(parameters.gains, &parameters.feedback, parameters.period_s)?,
        })
    }

    pub(crate) fn model(&self) -> &ControlModel {
        &self.model
    }

    pub(crate) fn sigma(&self) -> &Dof {
        self.inner.sigma()
    }

    pub(crate) fn state(&self) -> TrackerState {
        TrackerState {
            filter: *self.filter.state(),
            sigma: (*self.inner.sigma()).into(),
        }
    }

    pub(crate) fn restore(&mut self, state: &TrackerState) {
        self.filter.restore(&state.filter);
        self.inner.restore(&state.sigma);
    }

    /// The force that makes the servicer follow `velocity`.
    pub(crate) fn step(&mut self, measured: &Measured, velocity: &Dof) -> Tracking {
        let filtered = self.filter.step(velocity);
        let followed = match self.followed {
            TrackedVelocity::Raw => velocity,
            TrackedVelocity::Filtered => &filtered.velocity,
        };
        let error = followed - measured.velocity;
        if self.inner.is_scheduled() {
            self.inner.schedule(&self.model.mass(measured));
        }
        let feedback = self.inner.step(&error);
        // Eq 5: u = u_CI + M v̇_v + C ṽ_v
        let feed_forward = self.model.force(measured, followed, &filtered.acceleration);
        Tracking {
            force: feedback.force + feed_forward,
            feedback,
            acceleration: filtered.acceleration,
            error,
        }
    }
}
