//! The comparison guidance: fixed instants, and a trajectory imposed on the base as well as on the end effector.
//!
//! A **stand-in**: the design it stands for (the combined base and arm control of Pavanello et al., 2021) did not publish its
//! numbers. The end effector follows the same blend as in [`crate::capture`]; the differences are that the instants are fixed, whatever
//! the distance, and that the base has a separate set-point. That set-point is decisive: tied to the nominal closing pose it acts as a
//! step when the servicer starts anywhere else; re-planned from the true start it does not. Report both variants when comparing.

use crate::capture::{self, CaptureGuidance, Schedule};
use crate::profile::quintic;
use crate::{ParameterError, Pose, SetPoint, TargetState, so3};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

/// Path of the base to its closing pose.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum BasePath {
    /// The base holds its pose until the schedule's start; from then on the closing pose is commanded: no motion from the nominal
    /// start, a step from anywhere else.
    #[default]
    NominalPose,
    /// A quintic from the pose at the first sample, from the schedule's start to its pointing instant: the base is at rest while the
    /// end effector closes in.
    Replanned,
}

/// User parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameters {
    /// The instants, the same ones whatever the distance.
    pub schedule: Schedule,
    /// Pose of the grasp frame `G` in the target body frame `T`.
    pub grasp: Pose,
    /// Closing pose of the base `B` in the world.
    pub closing_pose: Pose,
    /// Path of the base to the closing pose.
    pub base_path: BasePath,
}

/// Inputs of the guidance at an instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Input {
    /// Simulated time, s.
    pub time_s: f64,
    /// Measured pose of the base; `None` before the first one is received.
    pub base: Option<Pose>,
    /// Measured pose of the end effector; `None` before the first one is received.
    pub end_effector: Option<Pose>,
    /// Motion of the target; `None` before the first one is received.
    pub target: Option<TargetState>,
}

/// Outputs of the guidance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Output {
    /// Set-point of the end effector, and the phase.
    pub end_effector: capture::Output,
    /// Set-point of the base; `None` until the first pose of the base is received.
    pub base: Option<SetPoint>,
}

/// Complete state of the guidance, as plain numbers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// State of the end effector's part.
    pub end_effector: capture::State,
    /// Whether the start pose of the base is known.
    pub base_started: bool,
    /// Start position of the base, m.
    pub base_position: [f64; 3],
    /// Start attitude of the base, scalar first.
    pub base_attitude: [f64; 4],
}

/// The comparison guidance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ComparisonGuidance {
    parameters: Parameters,
    end_effector: CaptureGuidance,
    base_start: Option<Pose>,
}

fn arm_part(parameters: &Parameters) -> capture::Parameters {
    capture::Parameters {
        schedule: parameters.schedule,
        grasp: parameters.grasp,
    }
}

impl ComparisonGuidance {
    /// A guidance in its initial state.
    ///
    /// # Errors
    ///
    /// If the instants are not in order or a pose is not finite.
    pub fn new(parameters: Parameters) -> Result<Self, ParameterError> {
        ParameterError::finite("closing_pose.position", parameters.closing_pose.position.as_slice())?;
        ParameterError::finite(
            "closing_pose.attitude",
            parameters.closing_pose.attitude.coords.as_slice(),
        )?;
        Ok(Self {
            parameters,
            end_effector: CaptureGuidance::new(arm_part(&parameters))?,
            base_start: None,
        })
    }

    /// A guidance that continues from `state`, bit for bit.
    ///
    /// # Errors
    ///
    /// As [`Self::new`].
    pub fn from_state(parameters: Parameters, state: &State) -> Result<Self, ParameterError> {
        let [w, x, y, z] = state.base_attitude;
        Ok(Self {
            end_effector: CaptureGuidance::from_state(arm_part(&parameters), &state.end_effector)?,
            base_start: state.base_started.then(|| Pose {
                position: state.base_position.into(),
                attitude: UnitQuaternion::new_unchecked(Quaternion::new(w, x, y, z)),
            }),
            ..Self::new(parameters)?
        })
    }

    /// Complete state of the guidance.
    pub fn state(&self) -> State {
        State {
            end_effector: self.end_effector.state(),
            base_started: self.base_start.is_some(),
            base_position: self.base_start.map_or([0.0; 3], |pose| pose.position.into()),
            base_attitude: self.base_start.map_or([0.0; 4], |pose| so3::to_wxyz(&pose.attitude)),
        }
    }

    /// The parameters it was built with.
    pub fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    /// The set-points at `input.time_s`.
    pub fn step(&mut self, input: &Input) -> Output {
        let end_effector = self.end_effector.step(&capture::Input {
            time_s: input.time_s,
            end_effector: input.end_effector,
            target: input.target,
        });
        if self.base_start.is_none() {
            self.base_start = input.base;
        }
        let closing = self.parameters.closing_pose;
        let base = self.base_start.map(|start| match self.parameters.base_path {
            BasePath::NominalPose if input.time_s < self.parameters.schedule.start_s => SetPoint::at_rest(start),
            BasePath::NominalPose => SetPoint::at_rest(closing),
            BasePath::Replanned => self.base_between(&start, &closing, input.time_s),
        });
        Output { end_effector, base }
    }

    fn base_between(&self, start: &Pose, closing: &Pose, time_s: f64) -> SetPoint {
        let Schedule { start_s, point_s, .. } = self.parameters.schedule;
        let progress = quintic(time_s, start_s, point_s);
        let phi: Vector3<f64> = so3::log(&(start.attitude.inverse() * closing.attitude));
        SetPoint {
            pose: Pose {
                position: start.position * (1.0 - progress.value) + closing.position * progress.value,
                attitude: start.attitude * so3::exp(&(phi * progress.value)),
            },
            velocity: (closing.position - start.position) * progress.rate,
            rate: phi * progress.rate,
        }
    }
}
