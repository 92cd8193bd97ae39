//! The hierarchical law: outer loop, shaping filter, inner loop and model feed-forward (Eq 5 to 17).

use crate::allocation::{Allocation, AllocationParameters};
use crate::avoidance::AvoidanceParameters;
use crate::model::ControlModel;
use crate::outer::{AttitudeError, AttitudeState, OuterInput, OuterLoop, OuterParameters};
use crate::tracker::{Tracker, TrackerParameters, TrackerState};
use crate::{DOF, Dof, JOINTS, Measured, ParameterError};
use guidance_laws::{InterSample, Pose, SetPoint};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// User parameters, except the control model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameters {
    /// The outer loop.
    pub outer: OuterParameters,
    /// Shaping filter and inner loop.
    pub tracker: TrackerParameters,
    /// Set-point handling between two samples of the guidance.
    pub inter_sample: InterSample,
    /// Avoidance of joint limits and of the straight elbow; `None` as in the paper.
    pub avoidance: Option<AvoidanceParameters>,
    /// Allocation of the base torque to wheels and thrusters; `None` as in the paper.
    pub allocation: Option<AllocationParameters>,
}

impl Parameters {
    /// The paper's outer loop, set-points propagated between guidance samples, and nothing beyond the paper.
    pub fn new(tracker: TrackerParameters) -> Self {
        Self {
            outer: OuterParameters::default(),
            tracker,
            inter_sample: InterSample::default(),
            avoidance: None,
            allocation: None,
        }
    }
}

/// Inputs of the law at an instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Input {
    /// Measured state; `None` before the first one is received: the law then commands nothing.
    pub measured: Option<Measured>,
    /// Set-point of the end effector; `None` before the first one is received: the law then holds the end effector at its pose.
    pub set_point: Option<SetPoint>,
    /// Time since the set-point was computed, s.
    pub set_point_age_s: f64,
    /// Momentum stored in the wheels, base axes, N m s. Read only with an allocation.
    pub wheel_momentum: Vector3<f64>,
}

/// Outputs of the law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Output {
    /// Generalised force: `[m_b; f_b; τ]`, N m, N, N m.
    pub force: Dof,
    /// Allocation of the base's part to wheels and thrusters.
    pub allocation: Allocation,
    /// Internal signals of the law.
    pub telemetry: Telemetry,
}

/// Internal signals of the law at an instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Telemetry {
    /// Whether there was a set-point to follow.
    pub tracking: bool,
    /// Pose of the end effector by the control model.
    pub end_effector: Pose,
    /// Position error `p_e = p_E − p_d`, world axes, m.
    pub position_error: Vector3<f64>,
    /// Attitude error `η_e` and the sign `h`.
    pub attitude_error: AttitudeError,
    /// Weight ε of the arm.
    pub epsilon: f64,
    /// Whether ε was held at zero.
    pub epsilon_clamped: bool,
    /// Virtual velocity `ṽ_v`, avoidance included.
    pub virtual_velocity: Dof,
    /// Part of it due to the avoidance of joint limits and of the straight elbow.
    pub avoidance: Dof,
    /// Virtual acceleration `v̇_v`.
    pub virtual_acceleration: Dof,
    /// Velocity error `y`.
    pub velocity_error: Dof,
    /// Feedback force `u_CI`.
    pub feedback: Dof,
    /// Which channels of the feedback saturate.
    pub saturated: [bool; DOF],
    /// Whether the inner loop's implicit step converged.
    pub converged: bool,
    /// Integral `σ` of the velocity error.
    pub sigma: Dof,
}

/// Complete state of the law, as plain numbers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// The attitude error's sign and continuity.
    pub attitude: AttitudeState,
    /// Shaping filter and integral.
    pub tracker: TrackerState,
}

/// The hierarchical law.
#[derive(Debug, Clone)]
pub struct HierarchicalLaw {
    parameters: Parameters,
    outer: OuterLoop,
    tracker: Tracker,
}

impl HierarchicalLaw {
    /// A law in its initial state.
    ///
    /// # Errors
    ///
    /// Names the parameter that is out of range, its value and the allowed range.
    pub fn new(model: ControlModel, parameters: Parameters) -> Result<Self, ParameterError> {
        if let Some(avoidance) = &parameters.avoidance {
            avoidance.validate()?;
        }
        if let Some(allocation) = &parameters.allocation {
            allocation.validate()?;
        }
        Ok(Self {
            parameters,
            outer: OuterLoop::new(parameters.outer)?,
            tracker: Tracker::new(model, &parameters.tracker)?,
        })
    }

    /// A law that continues from `state`, bit for bit.
    ///
    /// # Errors
    ///
    /// As [`Self::new`].
    pub fn from_state(model: ControlModel, parameters: Parameters, state: &State) -> Result<Self, ParameterError> {
        let mut law = Self::new(model, parameters)?;
        law.restore(state);
        Ok(law)
    }

    /// Complete state of the law.
    pub fn state(&self) -> State {
        State {
            attitude: *self.outer.state(),
            tracker: self.tracker.state(),
        }
    }

    /// Continues from `state`, bit for bit.
    pub fn restore(&mut self, state: &State) {
        self.outer.restore(&state.attitude);
        self.tracker.restore(&state.tracker);
    }

    /// The parameters it was built with.
    pub fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    /// The model it was built with.
    pub fn model(&self) -> &ControlModel {
        self.tracker.model()
    }

    /// The command at this instant. `None` while there is no measurement: then nothing may be commanded and the state does not change.
    pub fn step(&mut self, input: &Input) -> Option<Output> {
        let measured = input.measured.as_ref()?;
        let end_effector = self.tracker.model().end_effector(measured);
        let set_point = input
            .set_point
            .map(|set_point| self.parameters.inter_sample.apply(&set_point, input.set_point_age_s));
        let joint_factor = match &self.parameters.avoidance {
            None => [1.0; JOINTS],
            Some(avoidance) => avoidance.weight_factors(&measured.joints),
        };
        let outer = self.outer.step(&OuterInput {
            end_effector: &end_effector.pose,
            base_distance_m: measured.base.position.norm(),
            jacobian: &end_effector.jacobian,
            joint_factor: &joint_factor,
            set_point: set_point.as_ref(),
        });
        let avoidance = self.parameters.avoidance.map_or(Dof::zeros(), |avoidance| {
            outer
                .inverse
                .null_space(&avoidance.avoidance_velocity(&measured.joints))
        });
        let virtual_velocity = outer.velocity + avoidance;
        let tracking = self.tracker.step(measured, &virtual_velocity);
        Some(Output {
            force: tracking.force,
            allocation: Allocation::of(
                self.parameters.allocation.as_ref(),
                &tracking.force,
                &input.wheel_momentum,
            ),
            telemetry: Telemetry {
                tracking: set_point.is_some(),
                end_effector: end_effector.pose,
                position_error: outer.position_error,
                attitude_error: outer.attitude_error,
                epsilon: outer.weight.epsilon,
                epsilon_clamped: outer.weight.clamped,
                virtual_velocity,
                avoidance,
                virtual_acceleration: tracking.acceleration,
                velocity_error: tracking.error,
                feedback: tracking.feedback.force,
                saturated: tracking.feedback.saturated,
                converged: tracking.feedback.converged,
                sigma: *self.tracker.sigma(),
            },
        })
    }
}
