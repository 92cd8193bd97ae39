//! Navigation filter: estimates the target's motion from noisy, delayed camera poses.
//!
//! A multiplicative error-state Kalman filter with the rigid body as its process model: position and velocity of the centre of mass,
//! attitude and angular velocity by Euler's equation, and the camera's slowly drifting (not white) errors. The estimate refers to the
//! stamp of the newest camera pose; a step predicts it over the latency to the present with the target's dynamics, and so gives a smooth
//! set-point at any rate.
//!
//! Camera model: `p_m = p_NT + b_p + n_p` (world axes) and `q_m = q_NT ⊗ exp(b_θ + n_θ)` (target axes), where `b` is a first-order
//! Gauss-Markov process of a known standard deviation and time constant and `n` is white.
//!
//! Assumptions and limits: the inertia of the target is known up to a factor; no torque acts on it and no force beyond the accelerations
//! named in the parameters; poses arrive in the order of their stamps (an older one is ignored); between two poses the target turns by less
//! than half a turn.

mod error_state;
mod parameters;

pub use parameters::{Parameters, PositionAttitude};

use crate::{ParameterError, Pose, TargetState, so3};
use error_state::{Covariance, ErrorState, STATES, transition};
use nalgebra::{Quaternion, SMatrix, SVector, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

/// A pose of the target measured by the camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraPose {
    /// Time at which the image was taken, s.
    pub stamp_s: f64,
    /// Measured pose of the target body frame in the world.
    pub pose: Pose,
}

/// Output of the filter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// Motion of the target at the requested time.
    pub target: TargetState,
    /// Standard deviation of the position at the stamp of the newest pose, root sum square over the three axes, m.
    pub position_sigma_m: f64,
    /// The same for the attitude, rad.
    pub attitude_sigma_rad: f64,
    /// Age of the newest accepted pose, s: the prediction interval.
    pub age_s: f64,
    /// Outcome for the pose of this step.
    pub update: Update,
}

/// Outcome for a camera pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Update {
    /// There was no pose, or one that had already been processed.
    None,
    /// It initialised the filter.
    Started,
    /// It was accepted.
    Accepted {
        /// Normalised innovation squared: 6 on average when the filter is consistent.
        nis: f64,
    },
    /// It was rejected.
    Rejected {
        /// Normalised innovation squared.
        nis: f64,
    },
}

/// Complete state of the filter, as plain numbers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// Whether a pose has been accepted; before that the other fields are meaningless.
    pub started: bool,
    /// Stamp of the newest pose received, s.
    pub stamp_s: f64,
    /// Stamp of the estimate, s.
    pub estimate_s: f64,
    /// Consecutive rejected poses.
    pub rejections: u32,
    /// Position, m.
    pub position: [f64; 3],
    /// Attitude, scalar first.
    pub attitude: [f64; 4],
    /// Velocity, m/s.
    pub velocity: [f64; 3],
    /// Angular velocity, rad/s.
    pub rate: [f64; 3],
    /// Slow camera error of the position, m.
    pub position_drift: [f64; 3],
    /// Slow camera error of the attitude, rad.
    pub attitude_drift: [f64; 3],
    /// Covariance of the error state, column by column; SI units.
    pub covariance: [[f64; STATES]; STATES],
}

/// The navigation filter.
#[derive(Debug, Clone, PartialEq)]
pub struct NavigationFilter {
    parameters: Parameters,
    filter: Option<FilterState>,
}

/// The estimate at a stamp.
#[derive(Debug, Clone, PartialEq)]
struct FilterState {
    newest_s: f64,
    estimate_s: f64,
    rejections: u32,
    target: TargetState,
    position_drift: Vector3<f64>,
    attitude_drift: Vector3<f64>,
    covariance: Covariance,
}

impl NavigationFilter {
    /// A filter in its initial state.
    ///
    /// # Errors
    ///
    /// Names the parameter that is out of range.
    pub fn new(parameters: Parameters) -> Result<Self, ParameterError> {
        for (field, pair) in [
            ("white_sigma", parameters.white_sigma),
            ("initial_rate_sigma", parameters.initial_rate_sigma),
        ] {
            ParameterError::positive(field, pair.position)?;
            ParameterError::positive(field, pair.attitude)?;
        }
        for (field, pair) in [
            ("drift_sigma", parameters.drift_sigma),
            ("acceleration_density", parameters.acceleration_density),
        ] {
            ParameterError::non_negative(field, pair.position)?;
            ParameterError::non_negative(field, pair.attitude)?;
        }
        ParameterError::positive("drift_time_s", parameters.drift_time_s)?;
        if parameters.gate.is_nan() || parameters.gate <= 0.0 {
            let remedy = "must be above zero; infinity refuses nothing";
            return Err(ParameterError::new("gate", parameters.gate, remedy));
        }
        Ok(Self {
            parameters,
            filter: None,
        })
    }

    /// A filter that continues from `state`, bit for bit.
    ///
    /// # Errors
    ///
    /// As [`Self::new`].
    pub fn from_state(parameters: Parameters, state: &State) -> Result<Self, ParameterError> {
        let [w, x, y, z] = state.attitude;
        let filter = state.started.then(|| FilterState {
            newest_s: state.stamp_s,
            estimate_s: state.estimate_s,
            rejections: state.rejections,
            target: TargetState {
                pose: Pose {
                    position: state.position.into(),
                    attitude: UnitQuaternion::new_unchecked(Quaternion::new(w, x, y, z)),
                },
                velocity: state.velocity.into(),
                rate: state.rate.into(),
            },
            position_drift: state.position_drift.into(),
            attitude_drift: state.attitude_drift.into(),
            covariance: state.covariance.into(),
        });
        Ok(Self {
            filter,
            ..Self::new(parameters)?
        })
    }

    /// Complete state of the filter.
    pub fn state(&self) -> State {
        match &self.filter {
            None => State {
                started: false,
                stamp_s: 0.0,
                estimate_s: 0.0,
                rejections: 0,
                position: [0.0; 3],
                attitude: [0.0; 4],
                velocity: [0.0; 3],
                rate: [0.0; 3],
                position_drift: [0.0; 3],
                attitude_drift: [0.0; 3],
                covariance: [[0.0; STATES]; STATES],
            },
            Some(filter) => State {
                started: true,
                stamp_s: filter.newest_s,
                estimate_s: filter.estimate_s,
                rejections: filter.rejections,
                position: filter.target.pose.position.into(),
                attitude: so3::to_wxyz(&filter.target.pose.attitude),
                velocity: filter.target.velocity.into(),
                rate: filter.target.rate.into(),
                position_drift: filter.position_drift.into(),
                attitude_drift: filter.attitude_drift.into(),
                covariance: filter.covariance.into(),
            },
        }
    }

    /// Processes a camera pose, if there is a new one, and returns the target's motion at `time_s`. `None` before the first pose.
    pub fn step(&mut self, time_s: f64, camera: Option<&CameraPose>) -> Option<Estimate> {
        let update = match camera {
            None => Update::None,
            Some(camera) => self.process_pose(camera),
        };
        let filter = self.filter.as_ref()?;
        let age_s = time_s - filter.estimate_s;
        let sigma = |first: usize| {
            (first..first + 3)
                .map(|i| filter.covariance[(i, i)])
                .sum::<f64>()
                .sqrt()
        };
        Some(Estimate {
            target: self.parameters.target.predicted(&filter.target, age_s),
            position_sigma_m: sigma(error_state::POSITION),
            attitude_sigma_rad: sigma(error_state::ATTITUDE),
            age_s,
            update,
        })
    }

    /// Covariance of the error state at the stamp of the estimate: position (world, m), velocity (world, m/s), attitude (target axes,
    /// rad), angular velocity (target axes, rad/s), slow camera errors of position (m) and attitude (rad), three numbers each.
    pub fn covariance(&self) -> Option<&SMatrix<f64, 18, 18>> {
        self.filter.as_ref().map(|filter| &filter.covariance)
    }

    fn process_pose(&mut self, camera: &CameraPose) -> Update {
        let parameters = &self.parameters;
        match &mut self.filter {
            None => {
                self.filter = Some(FilterState::started(parameters, camera));
                Update::Started
            }
            Some(filter) if camera.stamp_s <= filter.newest_s => Update::None,
            Some(filter) => {
                filter.newest_s = camera.stamp_s;
                filter.predict(parameters, camera.stamp_s);
                let nis = filter.update(parameters, &camera.pose);
                if nis <= parameters.gate {
                    filter.rejections = 0;
                    return Update::Accepted { nis };
                }
                filter.rejections += 1;
                if filter.rejections > parameters.rejections_max {
                    *filter = FilterState::started(parameters, camera);
                    return Update::Started;
                }
                Update::Rejected { nis }
            }
        }
    }
}

impl FilterState {
    fn started(parameters: &Parameters, camera: &CameraPose) -> Self {
        Self {
            newest_s: camera.stamp_s,
            estimate_s: camera.stamp_s,
            rejections: 0,
            target: TargetState {
                pose: camera.pose,
                velocity: Vector3::zeros(),
                rate: Vector3::zeros(),
            },
            position_drift: Vector3::zeros(),
            attitude_drift: Vector3::zeros(),
            covariance: error_state::initial(parameters),
        }
    }

    fn predict(&mut self, parameters: &Parameters, to_s: f64) {
        let span_s = to_s - self.estimate_s;
        let steps = (span_s / error_state::LONGEST_STEP_S).ceil().max(1.0);
        let step_s = span_s / steps;
        for _ in 0..steps as u64 {
            let (phi, noise) = transition(parameters, &self.target.rate, step_s);
            self.covariance = phi * self.covariance * phi.transpose() + noise;
            self.target = parameters.target.predicted(&self.target, step_s);
            let keep = libm::exp(-step_s / parameters.drift_time_s);
            self.position_drift *= keep;
            self.attitude_drift *= keep;
        }
        self.estimate_s = to_s;
    }

    /// Updates the estimate with a pose unless it is outside the gate; returns the normalised innovation squared.
    fn update(&mut self, parameters: &Parameters, pose: &Pose) -> f64 {
        let drift = so3::exp(&self.attitude_drift);
        let expected = self.target.pose.attitude * drift;
        let r_p = pose.position - self.target.pose.position - self.position_drift;
        let r_q = so3::log(&(expected.inverse() * pose.attitude));
        let residual = SVector::<f64, 6>::new(r_p.x, r_p.y, r_p.z, r_q.x, r_q.y, r_q.z);

        let h = error_state::observation(&drift, &self.attitude_drift);
        let noise = error_state::camera_noise(parameters);
        let cross = self.covariance * h.transpose();
        let innovation = h * cross + noise;
        let Some(factor) = innovation.cholesky() else {
            return f64::INFINITY; // no longer a covariance: reject the pose; after a few rejections the filter re-initialises
        };
        let nis = residual.dot(&factor.solve(&residual));
        if nis.is_nan() || nis > parameters.gate {
            return if nis.is_nan() { f64::INFINITY } else { nis };
        }
        let gain = factor.solve(&cross.transpose()).transpose();
        let correction: ErrorState = gain * residual;
        // Joseph's form: stays symmetric and positive whatever the rounding
        let keep = Covariance::identity() - gain * h;
        let covariance = keep * self.covariance * keep.transpose() + gain * noise * gain.transpose();
        self.covariance = (covariance + covariance.transpose()) * 0.5;

        let part = |first: usize| correction.fixed_rows::<3>(first).into_owned();
        self.target.pose.position += part(error_state::POSITION);
        self.target.velocity += part(error_state::VELOCITY);
        self.target.pose.attitude = so3::normalised(
            self.target.pose.attitude.into_inner() * so3::exp(&part(error_state::ATTITUDE)).into_inner(),
        );
        self.target.rate += part(error_state::RATE);
        self.position_drift += part(error_state::POSITION_DRIFT);
        self.attitude_drift += part(error_state::ATTITUDE_DRIFT);
        nis
    }
}
