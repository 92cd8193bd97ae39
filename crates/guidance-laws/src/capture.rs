//! The capture guidance: a trajectory of the end effector from its start pose to the grasp point of the moving target.
//!
//! Position: a quintic blend from the start position `p_E0` to the grasp point `p_G(t)`, which may move,
//! `p_d = (1 − s_p) p_E0 + s_p p_G`. Attitude: the geodesic from the start attitude to the grasp frame,
//! `R_d = R_E0 exp(s_r log(R_E0ᵀ R_G))`, which is complete earlier, at the pointing instant. Both velocities are the exact time
//! derivatives, including the target's motion, so a controller can feed them forward. After the last instant the set-point
//! coincides with the grasp frame.
//!
//! Source: P. Bruschi, *A Hierarchical Control Architecture for Space Robots in On-Orbit Servicing Operations* (2025), whose three
//! instants these are; the time law and the analytic rate are ours.
//!
//! Limits: collision with the target is not considered; the relative rotation must stay below one full turn until the pointing
//! instant (half a turn for a law that has just been started).

use crate::profile::{TimeScaling, quintic};
use crate::{ParameterError, Pose, SetPoint, TargetState, so3};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

/// The three instants of an approach, s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Schedule {
    /// The end effector starts to move.
    pub start_s: f64,
    /// The attitude of the grasp frame is reached.
    pub point_s: f64,
    /// The position of the grasp frame is reached.
    pub grasp_s: f64,
}

impl Schedule {
    /// The instants 1, 20 and 30 s of the paper's close capture.
    pub const CLOSE: Self = Self {
        start_s: 1.0,
        point_s: 20.0,
        grasp_s: 30.0,
    };
    /// The instants 1, 45 and 55 s of the paper's far capture.
    pub const FAR: Self = Self {
        start_s: 1.0,
        point_s: 45.0,
        grasp_s: 55.0,
    };

    /// Rejects instants that are not in order.
    ///
    /// # Errors
    ///
    /// Names the instant that is not finite or not after the one before.
    pub fn validated(self) -> Result<Self, ParameterError> {
        let Self {
            start_s,
            point_s,
            grasp_s,
        } = self;
        ParameterError::non_negative("schedule.start_s", start_s)?;
        ParameterError::positive("schedule.point_s", point_s)?;
        ParameterError::positive("schedule.grasp_s", grasp_s)?;
        if point_s <= start_s {
            let remedy = "must be after schedule.start_s";
            return Err(ParameterError::new("schedule.point_s", point_s, remedy));
        }
        if grasp_s < point_s {
            let remedy = "must not be before schedule.point_s";
            return Err(ParameterError::new("schedule.grasp_s", grasp_s, remedy));
        }
        Ok(self)
    }

    /// Phase of the approach at `time_s`.
    pub fn phase(&self, time_s: f64) -> Phase {
        if time_s < self.start_s {
            Phase::Waiting
        } else if time_s < self.point_s {
            Phase::Pointing
        } else if time_s < self.grasp_s {
            Phase::Closing
        } else {
            Phase::Tracking
        }
    }
}

/// Phase of the guidance.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Phase {
    /// Before the start: the set-point is the start pose, at rest.
    Waiting = 0,
    /// Position and attitude move.
    Pointing = 1,
    /// The attitude is that of the grasp frame, the position still closes in.
    Closing = 2,
    /// The set-point is the grasp frame.
    Tracking = 3,
}

/// User parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameters {
    /// The three instants.
    pub schedule: Schedule,
    /// Pose of the grasp frame `G` in the target body frame `T`.
    pub grasp: Pose,
}

/// Inputs of the guidance at an instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Input {
    /// Simulated time, s.
    pub time_s: f64,
    /// Measured pose of the end effector; `None` before the first one is received. The first is the start pose; later ones are ignored.
    pub end_effector: Option<Pose>,
    /// Motion of the target; `None` before the first one is received.
    pub target: Option<TargetState>,
}

/// Outputs of the guidance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Output {
    /// The set-point; `None` until the first pose of the end effector is received.
    pub set_point: Option<SetPoint>,
    /// Phase of the approach.
    pub phase: Phase,
    /// Progress of the position.
    pub position: TimeScaling,
    /// Progress of the attitude.
    pub attitude: TimeScaling,
}

/// Complete state of the guidance, as plain numbers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// Whether the start pose is known.
    pub started: bool,
    /// Start position `p_E0`, m.
    pub start_position: [f64; 3],
    /// Start attitude `q_E0`, scalar first.
    pub start_attitude: [f64; 4],
    /// Rotation vector from the start attitude to the grasp frame at the last sample, rad.
    pub rotation: [f64; 3],
}

/// The capture guidance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CaptureGuidance {
    parameters: Parameters,
    start: Option<Pose>,
    rotation: Vector3<f64>,
}

impl CaptureGuidance {
    /// A guidance in its initial state.
    ///
    /// # Errors
    ///
    /// If the instants are not in order or the grasp pose is not finite.
    pub fn new(parameters: Parameters) -> Result<Self, ParameterError> {
        parameters.schedule.validated()?;
        ParameterError::finite("grasp.position", parameters.grasp.position.as_slice())?;
        ParameterError::finite("grasp.attitude", parameters.grasp.attitude.coords.as_slice())?;
        Ok(Self {
            parameters,
            start: None,
            rotation: Vector3::zeros(),
        })
    }

    /// A guidance that continues from `state`, bit for bit.
    ///
    /// # Errors
    ///
    /// As [`Self::new`].
    pub fn from_state(parameters: Parameters, state: &State) -> Result<Self, ParameterError> {
        let [w, x, y, z] = state.start_attitude;
        Ok(Self {
            start: state.started.then(|| Pose {
                position: state.start_position.into(),
                // unchanged, not normalised again: a restored run must be bit-identical
                attitude: UnitQuaternion::new_unchecked(Quaternion::new(w, x, y, z)),
            }),
            rotation: state.rotation.into(),
            ..Self::new(parameters)?
        })
    }

    /// Complete state of the guidance.
    pub fn state(&self) -> State {
        State {
            started: self.start.is_some(),
            start_position: self.start.map_or([0.0; 3], |pose| pose.position.into()),
            start_attitude: self.start.map_or([0.0; 4], |pose| so3::to_wxyz(&pose.attitude)),
            rotation: self.rotation.into(),
        }
    }

    /// The parameters it was built with.
    pub fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    /// The set-point at `input.time_s`. It is the start pose at rest until the first target state is received.
    pub fn step(&mut self, input: &Input) -> Output {
        let Schedule {
            start_s,
            point_s,
            grasp_s,
        } = self.parameters.schedule;
        if self.start.is_none() {
            self.start = input.end_effector;
        }
        let position = quintic(input.time_s, start_s, grasp_s);
        let attitude = quintic(input.time_s, start_s, point_s);
        let set_point = self.start.map(|start| match &input.target {
            None => SetPoint::at_rest(start),
            Some(target) => self.blend(&start, &target.frame(&self.parameters.grasp), position, attitude),
        });
        Output {
            set_point,
            phase: self.parameters.schedule.phase(input.time_s),
            position,
            attitude,
        }
    }

    fn blend(&mut self, start: &Pose, grasp: &SetPoint, position: TimeScaling, attitude: TimeScaling) -> SetPoint {
        let p_G = grasp.pose.position;
        // the pose equals the grasp frame, bit for bit, once a blend is complete
        let p_d = if position.value < 1.0 {
            start.position * (1.0 - position.value) + p_G * position.value
        } else {
            p_G
        };
        let v_d = grasp.velocity * position.value + (p_G - start.position) * position.rate;

        self.rotation = so3::log_near(&(start.attitude.inverse() * grasp.pose.attitude), &self.rotation);
        if attitude.value >= 1.0 {
            return SetPoint {
                pose: Pose {
                    position: p_d,
                    attitude: grasp.pose.attitude,
                },
                velocity: v_d,
                rate: grasp.rate,
            };
        }
        let phi = self.rotation;
        let part = phi * attitude.value;
        // w_d = J_r(s φ) (ṡ φ + s φ̇), with φ̇ = J_r⁻¹(φ) w_G, and J_r(s φ) φ = φ
        let rate = phi * attitude.rate
            + so3::right_jacobian(&part) * (so3::right_jacobian_inverse(&phi) * grasp.rate) * attitude.value;
        SetPoint {
            pose: Pose {
                position: p_d,
                attitude: start.attitude * so3::exp(&part),
            },
            velocity: v_d,
            rate,
        }
    }
}
