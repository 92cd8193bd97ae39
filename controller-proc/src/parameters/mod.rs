//! Controller parameters of a scenario. Every default is the paper's, or the baseline's where the paper gives none.

mod channels;
mod extensions;
mod gains;
mod model;
mod refusal;

use control_laws::filter::FilterParameters;
use control_laws::inner::{Bound, Discretisation, FeedbackLaw};
use control_laws::outer::{ArmWeight, AttitudeLaw, OuterParameters, Weights};
use control_laws::tracker::{TrackedVelocity, TrackerParameters};
use control_laws::{comparison, hierarchical};
use guidance_laws::InterSample;
use interfaces::JOINTS;
use interfaces::files::{Servicer, Target};
use lockstep::participant::ParameterError;
use lockstep::units::{AngularRate, Force, Length, PerAxis, PerTime, Quantity, Torque};
use nalgebra::Vector3;
use serde::Deserialize;

pub use channels::channels;

pub use extensions::{Allocation, Avoidance, Stabilise, payload};
pub use gains::GainsFile;
pub use model::{Model, build_control_model};
pub use refusal::scenario_error;

/// `participants.NAME.parameters` of a controller.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
    /// The mechanism, as URDF text.
    pub urdf: String,
    /// Servicer data that a URDF cannot express.
    pub servicer: Servicer,
    /// The target, carried by the end effector after the grasp. Only for `stabilise`.
    pub target: Option<Target>,
    /// Control law.
    #[serde(default)]
    pub law: LawName,
    /// Set-point handling between two samples of the guidance.
    #[serde(default)]
    pub between: InterSampleName,
    /// Gains of the inner loop.
    pub gains: GainsFile,
    /// Control model of the servicer.
    #[serde(default)]
    pub model: Model,
    /// The outer loop.
    #[serde(default)]
    pub outer: Outer,
    /// The command-shaping filter.
    #[serde(default)]
    pub filter: Filter,
    /// The inner loop.
    #[serde(default)]
    pub inner: Inner,
    /// Parameters specific to the comparison law.
    #[serde(default)]
    pub reference: ComparisonParameters,
    /// Avoidance of joint limits and of the straight elbow; off by default.
    pub avoidance: Option<Avoidance>,
    /// Allocation of the base's torque to wheels and thrusters; off by default.
    pub allocation: Option<Allocation>,
    /// Stabilisation of the stack after the grasp; off by default.
    pub stabilise: Option<Stabilise>,
}

/// Control law.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LawName {
    /// The two-level law of the paper.
    #[default]
    Hierarchical,
    /// The comparison law: a stand-in for the combined base and arm law.
    Reference,
}

/// Set-point handling between two samples of the guidance.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum InterSampleName {
    /// The last set-point, extrapolated with its own velocities.
    #[default]
    Propagate,
    /// The last set-point, held.
    Hold,
}

/// The outer loop.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Outer {
    /// Definition of the attitude error.
    pub attitude_law: AttitudeLawName,
    /// Hysteresis of the hybrid law.
    pub hysteresis: f64,
    /// Diagonal of K_att.
    pub attitude_gain: PerAxis<PerTime, 3>,
    /// Diagonal of K_pos.
    pub position_gain: PerAxis<PerTime, 3>,
    /// Weights that share the motion between base and arm.
    pub weights: WeightsTable,
}

impl Default for Outer {
    fn default() -> Self {
        Self {
            attitude_law: AttitudeLawName::Hybrid,
            hysteresis: 0.5,
            attitude_gain: PerAxis::of([1.0, 0.99, 1.01]),
            position_gain: PerAxis::of([1.0; 3]),
            weights: WeightsTable::default(),
        }
    }
}

/// Definition of the attitude error.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum AttitudeLawName {
    /// Eq 16 and 17.
    Hybrid,
    /// Eq 13.
    RotationMatrix,
    /// The quaternion without the sign law: subject to unwinding.
    Quaternion,
}

/// Weights of the pseudoinverse.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct WeightsTable {
    /// Weight of the base's rotation.
    pub base_rotation: f64,
    /// Weight of the base's translation.
    pub base_translation: f64,
    /// Constant weight of the arm; by distance if absent.
    pub arm_fixed: Option<f64>,
    /// Distance of the base from the target at which the arm has `near_weight`.
    pub near: Quantity<Length>,
    /// Distance at which the arm has `far_weight`.
    pub far: Quantity<Length>,
    /// Weight of the arm at the near distance.
    pub near_weight: f64,
    /// Weight of the arm at the far distance.
    pub far_weight: f64,
    /// Factor for each joint: 0 locks it.
    pub joint_factor: [f64; JOINTS],
}

impl Default for WeightsTable {
    /// Eq 14 and 15: 100 at the closing distance, 10 at twice that.
    fn default() -> Self {
        // |[-0.35, 0, -2.375] m|
        let near = (0.35_f64 * 0.35 + 2.375 * 2.375).sqrt();
        Self {
            base_rotation: 1.0,
            base_translation: 10.0,
            arm_fixed: None,
            near: Quantity::of(near),
            far: Quantity::of(2.0 * near),
            near_weight: 100.0,
            far_weight: 10.0,
            joint_factor: [1.0; JOINTS],
        }
    }
}

/// The command-shaping filter.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Filter {
    /// Natural frequency.
    pub frequency: Quantity<AngularRate>,
    /// Damping ratio.
    pub damping: f64,
    /// Velocity that the inner loop follows.
    pub followed: TrackedVelocityName,
}

impl Default for Filter {
    fn default() -> Self {
        Self {
            frequency: Quantity::of(10.0),
            damping: 0.9,
            followed: TrackedVelocityName::Raw,
        }
    }
}

/// Velocity that the inner loop follows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum TrackedVelocityName {
    /// The outer loop's velocity, as in the paper.
    Raw,
    /// The filter's velocity.
    Filtered,
}

/// The inner loop.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Inner {
    /// Feedback law.
    pub feedback: FeedbackName,
    /// Discretisation of the integral.
    pub discretisation: DiscretisationName,
    /// Bound of the feedback.
    pub bound: BoundName,
    /// Bound of the feedback on the base's torque; the stock wheels' limit by default.
    pub torque_bound: Option<PerAxis<Torque, 3>>,
    /// Bound of the feedback on the base's force; the stock thrusters' limit by default.
    pub force_bound: Option<PerAxis<Force, 3>>,
    /// Bound of the feedback on the joints; the stock motors' limit by default.
    pub joint_bound: Option<PerAxis<Torque, JOINTS>>,
    /// One numerical bound for both N and N m, in place of the three above.
    pub scalar_bound: Option<f64>,
}

impl Default for Inner {
    /// The conditional integrator with the limits of the stock actuators.
    fn default() -> Self {
        Self {
            feedback: FeedbackName::ConditionalIntegrator,
            discretisation: DiscretisationName::Exact,
            bound: BoundName::Actuators,
            torque_bound: None,
            force_bound: None,
            joint_bound: None,
            scalar_bound: None,
        }
    }
}

impl Inner {
    /// F of Eq 7.
    fn bound(&self, gains: &GainsFile) -> Result<Bound, ParameterError> {
        let given = [
            ("scalar_bound", self.scalar_bound.is_some()),
            ("torque_bound", self.torque_bound.is_some()),
            ("force_bound", self.force_bound.is_some()),
            ("joint_bound", self.joint_bound.is_some()),
        ];
        let given = given.into_iter().filter_map(|(key, given)| given.then_some(key));
        let one = match (self.bound, self.scalar_bound) {
            (BoundName::SlidingGain, _) => Some("bound = \"sliding-gain\""),
            (BoundName::Actuators, Some(_)) => Some("scalar_bound"),
            (BoundName::Actuators, None) => None,
        };
        if let Some(one) = one
            && let Some(ignored) = given.into_iter().find(|key| *key != one)
        {
            let reason = format!("would be ignored: inner.{one} bounds every channel; leave one of them out");
            return Err(ParameterError::new(format!("inner.{ignored}"), reason));
        }
        Ok(match (self.bound, self.scalar_bound) {
            (BoundName::SlidingGain, _) => Bound::Scalar(gains.sliding_gain_norm()?),
            (BoundName::Actuators, Some(bound)) => Bound::Scalar(bound),
            (BoundName::Actuators, None) => Bound::PerChannel(channels(
                self.torque_bound.unwrap_or(PerAxis::of([0.2; 3])).si(),
                self.force_bound.unwrap_or(PerAxis::of([9.0; 3])).si(),
                self.joint_bound
                    .unwrap_or(PerAxis::of([320.0, 320.0, 176.0, 176.0, 110.0, 40.0, 40.0]))
                    .si(),
            )),
        })
    }
}

/// Bound of the feedback.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BoundName {
    /// The actuator limits, channel by channel: the feedback alone never exceeds them.
    Actuators,
    /// ‖K_S‖ of the gains, as in the paper.
    SlidingGain,
}

/// Feedback law.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FeedbackName {
    /// Eq 7.
    ConditionalIntegrator,
    /// Eq 6.
    ProportionalIntegral,
    /// Proportional.
    Proportional,
}

/// Discretisation of the integral.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DiscretisationName {
    /// One implicit step.
    Exact,
    /// Forward Euler.
    Euler,
}

/// Parameters specific to the comparison law; attitude and position gains are those of `outer`.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ComparisonParameters {
    /// Position gain of the base.
    pub base_position_gain: PerAxis<PerTime, 3>,
    /// Damping of the least squares.
    pub least_squares_damping: f64,
}

impl Default for ComparisonParameters {
    /// 0.3 1/s, and a damping of 0.01 that only matters next to a singularity.
    fn default() -> Self {
        Self {
            base_position_gain: PerAxis::of([0.3; 3]),
            least_squares_damping: 0.01,
        }
    }
}

impl Parameters {
    fn attitude(&self) -> AttitudeLaw {
        match self.outer.attitude_law {
            AttitudeLawName::Hybrid => AttitudeLaw::Hybrid {
                hysteresis: self.outer.hysteresis,
            },
            AttitudeLawName::RotationMatrix => AttitudeLaw::RotationMatrix,
            AttitudeLawName::Quaternion => AttitudeLaw::Quaternion,
        }
    }

    fn inter_sample(&self) -> InterSample {
        match self.between {
            InterSampleName::Propagate => InterSample::Propagate,
            InterSampleName::Hold => InterSample::Hold,
        }
    }

    /// The feedback law of the inner loop.
    ///
    /// # Errors
    /// When a bound is given twice, or missing.
    pub fn feedback(&self) -> Result<FeedbackLaw, ParameterError> {
        let discretisation = match self.inner.discretisation {
            DiscretisationName::Exact => Discretisation::Exact,
            DiscretisationName::Euler => Discretisation::Euler,
        };
        Ok(match self.inner.feedback {
            FeedbackName::ConditionalIntegrator => FeedbackLaw::ConditionalIntegrator {
                bound: self.inner.bound(&self.gains)?,
                discretisation,
            },
            FeedbackName::ProportionalIntegral => FeedbackLaw::ProportionalIntegral,
            FeedbackName::Proportional => FeedbackLaw::Proportional,
        })
    }

    /// Shaping filter and inner loop.
    fn tracker(&self, period_s: f64) -> Result<TrackerParameters, ParameterError> {
        let feedback = self.feedback()?;
        Ok(TrackerParameters {
            period_s,
            filter: FilterParameters {
                frequency_rad_s: self.filter.frequency.si(),
                damping: self.filter.damping,
            },
            followed: match self.filter.followed {
                TrackedVelocityName::Raw => TrackedVelocity::Raw,
                TrackedVelocityName::Filtered => TrackedVelocity::Filtered,
            },
            gains: self.gains.gains(&feedback)?,
            feedback,
        })
    }

    /// Parameters of the hierarchical law.
    pub fn hierarchical(&self, period_s: f64) -> Result<hierarchical::Parameters, ParameterError> {
        let weights = &self.outer.weights;
        let arm = match weights.arm_fixed {
            Some(weight) => ArmWeight::Fixed(weight),
            None => ArmWeight::ByDistance {
                near_m: weights.near.si(),
                far_m: weights.far.si(),
                near_weight: weights.near_weight,
                far_weight: weights.far_weight,
            },
        };
        Ok(hierarchical::Parameters {
            outer: OuterParameters {
                attitude: self.attitude(),
                attitude_gain: self.outer.attitude_gain.si().into(),
                position_gain: self.outer.position_gain.si().into(),
                weights: Weights {
                    base_rotation: weights.base_rotation,
                    base_translation: weights.base_translation,
                    arm,
                    joint_factor: weights.joint_factor,
                },
            },
            tracker: self.tracker(period_s)?,
            inter_sample: self.inter_sample(),
            avoidance: match &self.avoidance {
                Some(avoidance) => Some(avoidance.law_parameters(&self.urdf, &self.servicer.arm)?),
                None => None,
            },
            allocation: self.allocation.as_ref().map(Allocation::law_parameters),
        })
    }

    /// Parameters of the comparison law.
    pub fn comparison(&self, period_s: f64) -> Result<comparison::Parameters, ParameterError> {
        if self.avoidance.is_some() {
            let reason = "only the hierarchical law has a null space to avoid joint ends in; leave it out";
            return Err(ParameterError::new("avoidance", reason));
        }
        Ok(comparison::Parameters {
            attitude: self.attitude(),
            attitude_gain: self.outer.attitude_gain.si().into(),
            position_gain: self.outer.position_gain.si().into(),
            base_position_gain: Vector3::from(self.reference.base_position_gain.si()),
            least_squares_damping: self.reference.least_squares_damping,
            tracker: self.tracker(period_s)?,
            inter_sample: self.inter_sample(),
            allocation: self.allocation.as_ref().map(Allocation::law_parameters),
        })
    }
}
