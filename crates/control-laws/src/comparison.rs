//! The comparison law: combined control of base and arm, with a separate set-point for each.
//!
//! A **stand-in** for an unpublished design, and to be named as such wherever it appears: the paper compares with the combined base and
//! arm control of Pavanello et al. (2021), but that design's numbers are not public. The base follows its set-point (position gain
//! 0.3 1/s, attitude gain as the end effector's); the arm provides the remaining twist of the end effector by damped least squares.
//! Shaping filter, inner loop and model are those of the hierarchical law, so that only the sharing between base and arm differs.
//!
//! Result: with the base's set-point tied to a nominal start, a servicer that starts elsewhere receives a step command. The line of action
//! of the resulting force does not pass through the centre of mass of the servicer, so the wheels must compensate a torque, and saturate.
//! With a path planned from the true start they do not. The cause is the stale set-point, not the sharing.

use crate::allocation::{Allocation, AllocationParameters};
use crate::model::ControlModel;
use crate::outer::{AttitudeError, AttitudeLaw, AttitudeState, OuterParameters};
use crate::tracker::{Tracker, TrackerParameters, TrackerState};
use crate::{DOF, Dof, JOINTS, Jacobian, Measured, ParameterError, Twist};
use guidance_laws::{InterSample, Pose, SetPoint};
use nalgebra::{Matrix6, SMatrix, SVector, Vector3};
use serde::{Deserialize, Serialize};

/// User parameters, except the control model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameters {
    /// Definition of both attitude errors.
    pub attitude: AttitudeLaw,
    /// Diagonal of the attitude gain of the end effector and of the base, 1/s.
    pub attitude_gain: Vector3<f64>,
    /// Diagonal of the position gain of the end effector, 1/s.
    pub position_gain: Vector3<f64>,
    /// Diagonal of the position gain of the base, 1/s.
    pub base_position_gain: Vector3<f64>,
    /// Damping of the least squares, in the unit of a twist per joint rate.
    pub least_squares_damping: f64,
    /// Shaping filter and inner loop.
    pub tracker: TrackerParameters,
    /// Set-point handling between two samples of the guidance.
    pub inter_sample: InterSample,
    /// Allocation of the base torque to wheels and thrusters; `None` as in the paper.
    pub allocation: Option<AllocationParameters>,
}

impl Parameters {
    /// Gains of the end effector as in the hierarchical law, 0.3 1/s for the base's position, and a damping of 0.01 that only matters
    /// near a singularity (chosen).
    pub fn new(tracker: TrackerParameters) -> Self {
        let OuterParameters {
            attitude,
            attitude_gain,
            position_gain,
            ..
        } = OuterParameters::default();
        Self {
            attitude,
            attitude_gain,
            position_gain,
            base_position_gain: Vector3::repeat(0.3),
            least_squares_damping: 0.01,
            tracker,
            inter_sample: InterSample::default(),
            allocation: None,
        }
    }
}

/// Inputs of the law at an instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Input {
    /// Measured state; `None` before the first one is received: the law then commands nothing.
    pub measured: Option<Measured>,
    /// Set-point of the end effector; `None` before the first one is received: the end effector then holds its pose.
    pub end_effector: Option<SetPoint>,
    /// Set-point of the base; `None` before the first one is received: the base then holds its pose.
    pub base: Option<SetPoint>,
    /// Time since the set-points were computed, s.
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
    /// Pose of the end effector by the control model.
    pub end_effector: Pose,
    /// Position error of the end effector, world axes, m.
    pub position_error: Vector3<f64>,
    /// Attitude error of the end effector.
    pub attitude_error: AttitudeError,
    /// Position error of the base, world axes, m.
    pub base_position_error: Vector3<f64>,
    /// Attitude error of the base.
    pub base_attitude_error: AttitudeError,
    /// Virtual velocity `ṽ_v`.
    pub virtual_velocity: Dof,
    /// Virtual acceleration `v̇_v`.
    pub virtual_acceleration: Dof,
    /// Velocity error `y`.
    pub velocity_error: Dof,
    /// Feedback force `u_CI`.
    pub feedback: Dof,
    /// Which channels of the feedback saturate.
    pub saturated: [bool; DOF],
    /// Integral `σ` of the velocity error.
    pub sigma: Dof,
}

/// Complete state of the law, as plain numbers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// State of the end effector's attitude error.
    pub end_effector: AttitudeState,
    /// State of the base's attitude error.
    pub base: AttitudeState,
    /// Shaping filter and integral.
    pub tracker: TrackerState,
}

/// The comparison law.
#[derive(Debug, Clone)]
pub struct ComparisonLaw {
    parameters: Parameters,
    end_effector: AttitudeState,
    base: AttitudeState,
    tracker: Tracker,
}

/// Errors of a frame and the corrective twist, in the frame's axes.
struct FrameTracking {
    position_error: Vector3<f64>,
    attitude_error: AttitudeError,
    twist: Twist,
}

impl ComparisonLaw {
    /// A law in its initial state.
    ///
    /// # Errors
    ///
    /// Names the parameter that is out of range, its value and the allowed range.
    pub fn new(model: ControlModel, parameters: Parameters) -> Result<Self, ParameterError> {
        parameters.attitude.validate()?;
        for axis in 0..3 {
            ParameterError::positive("attitude_gain", parameters.attitude_gain[axis])?;
            ParameterError::positive("position_gain", parameters.position_gain[axis])?;
            ParameterError::positive("base_position_gain", parameters.base_position_gain[axis])?;
        }
        ParameterError::positive("least_squares_damping", parameters.least_squares_damping)?;
        if let Some(allocation) = &parameters.allocation {
            allocation.validate()?;
        }
        Ok(Self {
            parameters,
            end_effector: AttitudeState::START,
            base: AttitudeState::START,
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
            end_effector: self.end_effector,
            base: self.base,
            tracker: self.tracker.state(),
        }
    }

    /// Continues from `state`, bit for bit.
    pub fn restore(&mut self, state: &State) {
        self.end_effector = state.end_effector;
        self.base = state.base;
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

    /// The command at this instant. `None` while there is no measurement.
    pub fn step(&mut self, input: &Input) -> Option<Output> {
        let measured = input.measured.as_ref()?;
        let kinematics = self.tracker.model().end_effector(measured);
        let parameters = &self.parameters;
        let now = |set_point: SetPoint| parameters.inter_sample.apply(&set_point, input.set_point_age_s);
        let base = track_frame(
            &mut self.base,
            parameters,
            &parameters.base_position_gain,
            &measured.base,
            input.base.map(now),
        );
        let end_effector = track_frame(
            &mut self.end_effector,
            parameters,
            &parameters.position_gain,
            &kinematics.pose,
            input.end_effector.map(now),
        );
        let remaining_twist = end_effector.twist - kinematics.jacobian.fixed_columns::<6>(0) * base.twist;
        let joints = damped_least_squares(&kinematics.jacobian, &remaining_twist, parameters.least_squares_damping);
        let virtual_velocity = Dof::from_fn(|row, _| if row < 6 { base.twist[row] } else { joints[row - 6] });

        let tracking = self.tracker.step(measured, &virtual_velocity);
        Some(Output {
            force: tracking.force,
            allocation: Allocation::of(parameters.allocation.as_ref(), &tracking.force, &input.wheel_momentum),
            telemetry: Telemetry {
                end_effector: kinematics.pose,
                position_error: end_effector.position_error,
                attitude_error: end_effector.attitude_error,
                base_position_error: base.position_error,
                base_attitude_error: base.attitude_error,
                virtual_velocity,
                virtual_acceleration: tracking.acceleration,
                velocity_error: tracking.error,
                feedback: tracking.feedback.force,
                saturated: tracking.feedback.saturated,
                sigma: *self.tracker.sigma(),
            },
        })
    }
}

fn track_frame(
    state: &mut AttitudeState,
    parameters: &Parameters,
    position_gain: &Vector3<f64>,
    pose: &Pose,
    set_point: Option<SetPoint>,
) -> FrameTracking {
    let Some(set_point) = set_point else {
        return FrameTracking {
            position_error: Vector3::zeros(),
            attitude_error: state.unchanged(),
            twist: Twist::zeros(),
        };
    };
    let p_e = pose.position - set_point.pose.position;
    let q_e = set_point.pose.attitude.inverse() * pose.attitude;
    let error = state.update(&parameters.attitude, &q_e);
    let w = q_e.inverse() * set_point.rate - parameters.attitude_gain.component_mul(&error.vector);
    let v = pose.attitude.inverse() * (set_point.velocity - position_gain.component_mul(&p_e));
    FrameTracking {
        position_error: p_e,
        attitude_error: error,
        twist: Twist::new(w.x, w.y, w.z, v.x, v.y, v.z),
    }
}

/// Joint rates `J_aᵀ (J_a J_aᵀ + λ² I)⁻¹ t`: the closest twist that the arm attains with rates that stay bounded at a singularity.
fn damped_least_squares(jacobian: &Jacobian, twist: &Twist, damping: f64) -> SVector<f64, JOINTS> {
    let arm: SMatrix<f64, 6, JOINTS> = jacobian.fixed_columns::<JOINTS>(6).into_owned();
    let gram: Matrix6<f64> = arm * arm.transpose() + Matrix6::identity() * (damping * damping);
    match gram.cholesky() {
        Some(factor) => arm.transpose() * factor.solve(twist),
        None => SVector::repeat(f64::NAN), // only a Jacobian that is not finite gets here: the result says so
    }
}
