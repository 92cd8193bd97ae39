//! Guidance and navigation parameters of a scenario.

use guidance_laws::capture::{self, Schedule};
use guidance_laws::comparison::{self, BasePath};
use guidance_laws::navigation::{self, PositionAttitude};
use guidance_laws::target::TargetModel;
use guidance_laws::{ParameterError as LawError, Pose};
use interfaces::files::{Frame, Servicer, Target};
use lockstep::participant::ParameterError;
use lockstep::units::{Acceleration, Angle, AngularAcceleration, AngularRate, Length, Quantity, Speed, Time, Vector};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use serde::Deserialize;

/// `participants.NAME.parameters` of a guidance.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
    /// The mechanism, as URDF text.
    pub urdf: String,
    /// Servicer data that a URDF cannot express.
    pub servicer: Servicer,
    /// The target.
    pub target: Target,
    /// Guidance law.
    #[serde(default)]
    pub law: LawName,
    /// The instants of the approach.
    pub schedule: ScheduleTable,
    /// Whether a delayed target state is propagated to the present with the model of the target's motion.
    #[serde(default)]
    pub predict_target: bool,
    /// Parameters specific to the comparison guidance.
    #[serde(default)]
    pub reference: ComparisonParameters,
    /// The navigation filter; without it the received target state is used directly.
    pub navigation: Option<Navigation>,
}

/// Guidance law.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LawName {
    /// The law of the paper: a set-point for the end effector.
    #[default]
    Capture,
    /// The stand-in for comparison: a set-point for the base as well.
    Reference,
}

/// The instants of the approach.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ScheduleTable {
    /// The end effector starts to move.
    pub start: Quantity<Time>,
    /// The attitude of the grasp frame is reached.
    pub point: Quantity<Time>,
    /// The position of the grasp frame is reached.
    pub grasp: Quantity<Time>,
}

/// Parameters specific to the comparison guidance.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ComparisonParameters {
    /// Closing pose of the base in the world.
    pub closing_pose: Frame,
    /// Path of the base to its closing pose.
    pub base_path: BasePathName,
}

impl Default for ComparisonParameters {
    /// The nominal closing pose, aligned with the world, and the path `nominal-pose`.
    fn default() -> Self {
        Self {
            closing_pose: Frame {
                position: Vector::of([-0.35, 0.0, -2.375]),
                attitude: Vector::of([0.0; 3]),
            },
            base_path: BasePathName::NominalPose,
        }
    }
}

/// Path of the base to its closing pose.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BasePathName {
    /// The closing pose is commanded from the start instant on.
    NominalPose,
    /// A quintic from the base's true start pose.
    Replanned,
}

/// The navigation filter: its models of camera and target.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Navigation {
    /// Standard deviation of the camera's slow position error about each axis.
    pub drift_position: Quantity<Length>,
    /// Standard deviation of the camera's slow attitude error about each axis.
    pub drift_attitude: Quantity<Angle>,
    /// Time constant of the slow errors.
    pub drift_time: Quantity<Time>,
    /// Standard deviation of the white position error; a value above the camera's true one makes the estimate smoother.
    pub white_position: Quantity<Length>,
    /// Standard deviation of the white attitude error; a value above the camera's true one makes the estimate smoother.
    pub white_attitude: Quantity<Angle>,
    /// Unmodelled acceleration: growth of the velocity's standard deviation in one second.
    pub acceleration: Quantity<Acceleration>,
    /// Unmodelled angular acceleration: growth of the rate's standard deviation in one second.
    pub angular_acceleration: Quantity<AngularAcceleration>,
    /// Standard deviation of the velocity before the first camera pose.
    pub initial_velocity: Quantity<Speed>,
    /// Standard deviation of the angular velocity before the first camera pose.
    pub initial_rate: Quantity<AngularRate>,
    /// Gate: a camera pose is rejected when its normalised innovation squared exceeds this.
    pub gate: f64,
    /// Largest number of consecutive rejections; one more re-initialises the filter.
    pub rejections_max: u32,
    /// Longest step of the prediction.
    pub longest_step: Quantity<Time>,
}

impl Default for Navigation {
    /// The stock camera with slightly inflated noise: every step of the estimate reaches the controller.
    fn default() -> Self {
        Self {
            drift_position: Quantity::of(0.003),
            drift_attitude: Quantity::of(0.2 * std::f64::consts::PI / 180.0),
            drift_time: Quantity::of(5.0),
            white_position: Quantity::of(0.003),
            white_attitude: Quantity::of(0.2 * std::f64::consts::PI / 180.0),
            acceleration: Quantity::of(1e-6),
            angular_acceleration: Quantity::of(1e-6),
            initial_velocity: Quantity::of(0.01),
            initial_rate: Quantity::of(0.05),
            gate: 22.5,
            rejections_max: 10,
            longest_step: Quantity::of(0.01),
        }
    }
}

/// The pose of a frame.
pub fn pose(frame: &Frame) -> Pose {
    let [roll, pitch, yaw] = frame.attitude.si();
    let attitude = if [roll, pitch, yaw] == [0.0; 3] {
        UnitQuaternion::identity()
    } else {
        let r = multibody::rotation::roll_pitch_yaw(roll, pitch, yaw);
        UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(r))
    };
    Pose {
        position: frame.position.si().into(),
        attitude,
    }
}

impl Parameters {
    fn schedule(&self) -> Schedule {
        Schedule {
            start_s: self.schedule.start.si(),
            point_s: self.schedule.point.si(),
            grasp_s: self.schedule.grasp.si(),
        }
    }

    /// Parameters of the paper's law.
    pub fn capture(&self) -> capture::Parameters {
        capture::Parameters {
            schedule: self.schedule(),
            grasp: pose(&self.target.grasp),
        }
    }

    /// Parameters of the comparison law.
    pub fn comparison(&self) -> comparison::Parameters {
        comparison::Parameters {
            schedule: self.schedule(),
            grasp: pose(&self.target.grasp),
            closing_pose: pose(&self.reference.closing_pose),
            base_path: match self.reference.base_path {
                BasePathName::NominalPose => BasePath::NominalPose,
                BasePathName::Replanned => BasePath::Replanned,
            },
        }
    }

    /// Model of the target's motion, integrated in steps of at most `longest_step`, s.
    ///
    /// # Errors
    /// When the inertia is not valid.
    pub fn target_model(&self, longest_step: f64) -> Result<TargetModel, ParameterError> {
        let inertia = Matrix3::from_diagonal(&Vector3::from(self.target.inertia.si()));
        TargetModel::new(inertia, longest_step).map_err(|error| {
            let key = if error.field == "inertia" {
                "target.inertia"
            } else {
                "navigation.longest_step"
            };
            ParameterError::new(key, format!("{} {}", error.value, error.remedy))
        })
    }

    /// Parameters of the filter.
    ///
    /// # Errors
    /// When the target's inertia is not valid.
    pub fn filter(&self, navigation: &Navigation) -> Result<navigation::Parameters, ParameterError> {
        let pair = |position, attitude| PositionAttitude { position, attitude };
        Ok(navigation::Parameters {
            target: self.target_model(navigation.longest_step.si())?,
            drift_sigma: pair(navigation.drift_position.si(), navigation.drift_attitude.si()),
            drift_time_s: navigation.drift_time.si(),
            white_sigma: pair(navigation.white_position.si(), navigation.white_attitude.si()),
            acceleration_density: pair(navigation.acceleration.si(), navigation.angular_acceleration.si()),
            initial_rate_sigma: pair(navigation.initial_velocity.si(), navigation.initial_rate.si()),
            gate: navigation.gate,
            rejections_max: navigation.rejections_max,
        })
    }
}

/// Maps a law's parameter error to the scenario's key.
pub fn scenario_error(error: &LawError) -> ParameterError {
    // prose has no such names in it
    let remedy: Vec<&str> = error.remedy.split(' ').map(scenario_key).collect();
    let unit = if error.field.ends_with("_s") && error.value.parse::<f64>().is_ok() {
        " s"
    } else {
        ""
    };
    let reason = format!("{}{unit} {}", error.value.trim_end_matches(".0"), remedy.join(" "));
    ParameterError::new(scenario_key(error.field), reason)
}

/// The scenario's key of a law's field.
fn scenario_key(field: &str) -> &str {
    match field {
        "schedule.start_s" => "schedule.start",
        "schedule.point_s" => "schedule.point",
        "schedule.grasp_s" => "schedule.grasp",
        "grasp.position" | "grasp.attitude" => "target.grasp",
        "closing_pose.position" | "closing_pose.attitude" => "reference.closing_pose",
        "white_sigma" => "navigation.white_position",
        "drift_sigma" => "navigation.drift_position",
        "drift_time_s" => "navigation.drift_time",
        "initial_rate_sigma" => "navigation.initial_rate",
        "acceleration_density" => "navigation.acceleration",
        "gate" => "navigation.gate",
        other => other,
    }
}
