//! File format of the specification of a tuning problem for the velocity loop of a free-flying robot.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// Complete definition of the problem. Fixed before tuning; gamma is always reported against it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Spec {
    /// Title, one line.
    pub title: String,
    /// The tree.
    pub robot: RobotSpec,
    /// Sampling, delays and lags between the controller and the tree.
    pub sampling: SamplingSpec,
    /// Sizes of signals.
    pub scales: ScaleSpec,
    /// Weights.
    pub weights: WeightSpec,
    /// The structure and the start values of the gains.
    pub gains: GainSpec,
    /// The situations for which the gains are tuned.
    pub models: Vec<ModelSpec>,
    /// Options of the search.
    #[serde(default)]
    pub search: SearchSpec,
    /// Uncertainty for the margins.
    pub uncertainty: UncertaintySpec,
    /// The random set against which tuned gains are validated, and the adversary.
    #[serde(default)]
    pub validation: ValidationSpec,
    /// Closed-loop runs in the non-linear simulator; none by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub closed_loop: Option<ClosedLoopSpec>,
}

/// Closed-loop runs of the tuned gains in a scenario, over the configurations of the models and some delays. The scenario's own
/// criteria decide whether a run passes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClosedLoopSpec {
    /// The scenario, a file.
    pub scenario: String,
    /// Delays, s: each value is written to all of `delay_keys`.
    pub delays_s: Vec<f64>,
    /// Key of the controller's gains.
    #[serde(default = "gains_key")]
    pub gains_key: String,
    /// Key of the joint angles at the start.
    #[serde(default = "joints_key")]
    pub joints_key: String,
    /// Keys of the delays of measurement and command.
    #[serde(default = "delay_keys")]
    pub delay_keys: Vec<String>,
    /// Additional settings for gains without an integral part.
    #[serde(default = "proportional")]
    pub proportional: Vec<String>,
}

fn gains_key() -> String {
    "participants.controller.parameters.gains".into()
}

fn joints_key() -> String {
    "participants.plant.parameters.start.joints".into()
}

fn delay_keys() -> Vec<String> {
    ["connections.measured.delay", "connections.command.delay"]
        .map(String::from)
        .into()
}

fn proportional() -> Vec<String> {
    vec![r#"participants.controller.parameters.inner={ feedback = "proportional" }"#.into()]
}

/// The tree.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RobotSpec {
    /// URDF file, relative to the project.
    pub urdf: String,
    /// Joints that the controller's model welds, with the position (rad) at which.
    pub frozen: BTreeMap<String, f64>,
    /// Reflected rotor inertia of every actuated joint, kg m².
    pub motor_inertia_kg_m2: f64,
    /// Link whose mass and inertia count as "base".
    pub base_link: String,
    /// Links whose mass and inertia count as "arm".
    pub arm_links: Vec<String>,
    /// Links that carry propellant, for the fill.
    pub propellant_links: Vec<String>,
    /// Frame to which a payload is attached.
    pub end_effector: String,
}

/// Sampling, delays and lags. All channels are alike, so delays commute with the gains and only their sum matters to the
/// continuous problem; the sampled verification uses them one by one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SamplingSpec {
    /// Period of the controller, s. Its zero-order hold counts as half of it.
    pub controller_period_s: f64,
    /// Period of the plant's communication, s.
    pub plant_period_s: f64,
    /// Time from a sample to the command computed from it, s.
    pub computing_s: f64,
    /// Delay of the measured state, s.
    pub sensor_delay_s: f64,
    /// Delay of the command, s.
    pub actuator_delay_s: f64,
    /// First-order time constant of every actuator, s; zero for none.
    pub actuator_lag_s: f64,
    /// Order of the Padé approximant while tuning.
    pub pade_order_tuning: usize,
    /// Order of the Padé approximant for reported figures.
    pub pade_order_reporting: usize,
}

impl SamplingSpec {
    /// The delay of the continuous loop: hold, computing, sensor, actuator.
    pub fn total_delay_s(&self) -> f64 {
        0.5 * self.controller_period_s + self.computing_s + self.sensor_delay_s + self.actuator_delay_s
    }
}

/// Sizes of signals, one number per channel: 3 rotations (rad/s, N m), 3 translations (m/s, N), the joints (rad/s, N m).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ScaleSpec {
    /// Velocity error of size one.
    pub velocity: Vec<f64>,
    /// Force of size one: the authority of the loop.
    pub authority: Vec<f64>,
    /// Disturbance force of size one.
    pub disturbance: Vec<f64>,
}

/// Weights on the normalised signals.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WeightSpec {
    /// Cut-off ω of each channel, rad/s: W_S = (s/peak + ω)/(s + ω floor).
    pub cutoff_rad_s: Vec<f64>,
    /// Largest sensitivity allowed at high frequency.
    pub peak: f64,
    /// Largest sensitivity allowed at zero frequency.
    pub floor: f64,
    /// Constant weight on the normalised force.
    pub effort: f64,
    /// Weight on the response to disturbances; none for a proportional law, which cannot reject a constant one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub load: Option<LoadSpec>,
}

/// W_L = (s + ω)/(s + ω floor), ω = ratio · cut-off.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LoadSpec {
    /// Frequency below which disturbances must be rejected, as a fraction of the cut-off.
    pub ratio: f64,
    /// Inverse of the weight at zero frequency.
    pub floor: f64,
}

/// Structure of K_P.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum GainStructure {
    /// Diagonal.
    Diagonal,
    /// Positive definite blocks: base rotation, base translation, arm.
    Block,
    /// One positive definite matrix.
    Full,
    /// K_P(q) = M(q)^½ X M(q)^½ with one constant positive definite X.
    Scheduled,
}

/// The gains.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GainSpec {
    /// Structure of K_P.
    pub structure: GainStructure,
    /// Whether there is an integral part, with a constant diagonal K_I.
    pub integral: bool,
    /// Start of K_P: its diagonal (N m s/rad, N s/m); of X for the scheduled structure (1/s).
    pub start_kp: Vec<f64>,
    /// Start of the diagonal of K_I (N m/rad, N/m); empty without integral part.
    #[serde(default)]
    pub start_ki: Vec<f64>,
    /// A file of gains tuned without an integral part; its K_P becomes the K_S of the conditional integrator, and its norm bounds the
    /// feedback (Eq 7). It is copied to the tuned gains; the loop below saturation does not depend on it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ks: Option<String>,
}

/// One situation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModelSpec {
    /// Name, for reports.
    pub name: String,
    /// Joint angles, deg. A specification gives these or `at`; a file of gains has both.
    #[serde(default)]
    pub joints_deg: Vec<f64>,
    /// `RUN:TIME`: the joint angles are those of a recorded run, or of a scenario run for this purpose, at this instant. The caller
    /// looks them up; without `joints_deg` the situation is rejected.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at: Option<String>,
    /// Factor on the base's mass (inertia unchanged).
    #[serde(default = "one")]
    pub base_mass: f64,
    /// Factor on the base's inertia (mass unchanged).
    #[serde(default = "one")]
    pub base_inertia: f64,
    /// Factor on the arm's masses and inertias.
    #[serde(default = "one")]
    pub arm_inertia: f64,
    /// Factor on the propellant's mass.
    #[serde(default = "one")]
    pub fill: f64,
    /// Extra delay in the loop, s.
    #[serde(default)]
    pub extra_delay_s: f64,
    /// A rigid body held by the end effector.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub payload: Option<Payload>,
    /// Sizes of velocity errors in this situation, in place of `scales.velocity`: with a held payload the same error corresponds to
    /// a different momentum.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub error_sizes: Vec<f64>,
    /// Whether the propellant is free to slosh (the joints frozen in the controller's model move, unactuated).
    #[serde(default)]
    pub slosh: bool,
    /// Generalised velocity about which to linearise, exact velocity Jacobian of the bias included; at rest when empty.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub velocity: Vec<f64>,
}

fn one() -> f64 {
    1.0
}

/// A body at the end effector, centred at `com_m` in its frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Payload {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Centre of mass in the end effector's frame, m.
    pub com_m: [f64; 3],
    /// Principal moments about the centre of mass, axes of the end effector's frame, kg m².
    pub inertia_kg_m2: [f64; 3],
}

/// Options of the search.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SearchSpec {
    /// Number of starts.
    pub starts: usize,
    /// Scatter of the starts, natural logarithm.
    pub scatter: f64,
    /// Seed.
    pub seed: u64,
    /// BFGS iterations per descent.
    pub iterations: usize,
    /// Evaluations per finishing phase.
    pub finishing: usize,
    /// Rounds of descent and finishing.
    pub rounds: usize,
    /// Relative gain below which a phase ends.
    pub tolerance: f64,
}

impl Default for SearchSpec {
    fn default() -> Self {
        Self {
            starts: 2,
            scatter: 0.5,
            seed: 1,
            iterations: 120,
            finishing: 40,
            rounds: 3,
            tolerance: 2e-4,
        }
    }
}

/// Uncertainty for the margins.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct UncertaintySpec {
    /// Relative size of the real parametric errors of base mass, base inertia and arm inertia.
    pub parametric: f64,
    /// Relative multiplicative error of every actuator at low frequency.
    pub multiplicative_low: f64,
    /// The same at high frequency.
    pub multiplicative_high: f64,
    /// Frequency at which the error has risen halfway, rad/s.
    pub multiplicative_cutoff_rad_s: f64,
}

/// The validation set: uniform in every range, seeded.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ValidationSpec {
    /// Number of samples.
    pub samples: usize,
    /// Seed.
    pub seed: u64,
    /// Range of every joint angle, deg, symmetric about zero.
    pub joints_deg: Vec<f64>,
    /// Range of the factors on base mass, base inertia, arm inertia: 1 ± this.
    pub mass: f64,
    /// Range of the fill factor.
    pub fill: [f64; 2],
    /// Largest extra delay, s.
    pub extra_delay_s: f64,
    /// Largest gamma at which a sample passes.
    pub gamma: f64,
    /// Most rounds of the adversary.
    pub rounds: usize,
    /// Models that the adversary adds per round.
    pub added: usize,
}

impl Default for ValidationSpec {
    fn default() -> Self {
        Self {
            samples: 0,
            seed: 7,
            joints_deg: Vec::new(),
            mass: 0.0,
            fill: [1.0, 1.0],
            extra_delay_s: 0.0,
            gamma: f64::INFINITY,
            rounds: 0,
            added: 4,
        }
    }
}
