//! The file of tuned gains, and export of the problem as plain matrices for independent verification.

use serde::{Deserialize, Serialize};

use super::design::Round;
use super::plant::Gains;
use super::spec::{GainStructure, ModelSpec};
use crate::linalg::{self, LinalgError, Matrix, diagonal};
use crate::tuner::{Certificate, Evaluation, GainKind, Problem};

/// Gains with their provenance and verification results.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GainsFile {
    /// Provenance of the gains.
    pub provenance: Provenance,
    /// The gains.
    pub gains: GainTable,
    /// The situations of the specification, with the joint angles that were looked up.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub models: Vec<ModelSpec>,
    /// Norm of every channel at the reporting order.
    #[serde(default)]
    pub channels: Vec<ChannelEntry>,
    /// Margins with their uncertainty sets.
    #[serde(default)]
    pub margins: Vec<MarginEntry>,
    /// Results of the sampled loop.
    #[serde(default)]
    pub sampled: Vec<SampledEntry>,
    /// Closed-loop runs in the non-linear simulator.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub closed_loop: Vec<ClosedLoopEntry>,
    /// The full-order optimum of the tracking channel of every model, including the adversary's.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub full_order: Vec<OptimumEntry>,
    /// The rounds of the adversary, when there were several.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub rounds: Vec<Round>,
    /// The validation set.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub validation: Option<ValidationEntry>,
    /// Situations that the adversary added to those of the specification.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub adversary: Vec<ModelSpec>,
}

/// Provenance of gains.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Provenance {
    /// Title of the specification.
    pub title: String,
    /// Path of the specification.
    pub specification: String,
    /// Digest of the specification's text.
    pub specification_digest: String,
    /// Digest of the robot's physics: masses, inertias, joints, frames and limits.
    pub plant_digest: String,
    /// Period of the controller for which the gains were tuned, s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub controller_period_s: Option<f64>,
    /// The file of gains that K_S is taken from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ks: Option<String>,
    /// Version of the tuner.
    pub version: String,
    /// Seed of the search.
    pub seed: u64,
    /// Largest channel norm at the tuning order.
    pub gamma: f64,
    /// Largest channel norm at the reporting order.
    pub gamma_reported: f64,
    /// Gamma of every start, as text because it may be infinite.
    pub starts: Vec<String>,
    /// Length of the smallest element of the convex hull of the active gradients of ln γ.
    pub certificate: f64,
    /// Length of the longest of these gradients, for comparison.
    #[serde(default)]
    pub certificate_steepest: f64,
    /// Radius of the neighbourhood of that certificate.
    pub certificate_radius: f64,
}

/// The gains as a table. Units: N m s/rad and N s/m for K_P, N m/rad and N/m for K_I; 1/s for X.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GainTable {
    /// Structure of K_P.
    pub structure: GainStructure,
    /// Diagonal of K_P, for the diagonal structure.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub kp: Vec<f64>,
    /// Rows of K_P, for block and full.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub kp_matrix: Vec<Vec<f64>>,
    /// Rows of X, for K_P(q) = M(q)^½ X M(q)^½.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub x: Vec<Vec<f64>>,
    /// Diagonal of K_I; empty for a proportional law.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub ki: Vec<f64>,
    /// Diagonal of K_S; its norm bounds the conditional integrator. Empty when K_S is full or was not requested.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub ks: Vec<f64>,
    /// Rows of K_S where it is not diagonal.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub ks_matrix: Vec<Vec<f64>>,
}

/// Gains that cannot be the K_S of a conditional integrator.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum SlidingGainError {
    /// They have an integral part.
    #[error("were tuned with an integral part; K_S is tuned without one (gains.integral = false)")]
    Integral,
    /// They are scheduled with the configuration.
    #[error("are scheduled; the bound of the conditional integrator is a constant")]
    Scheduled,
}

impl GainTable {
    /// The table of some gains.
    pub fn new(gains: &Gains) -> Self {
        let mut table = Self {
            structure: gains.structure,
            kp: Vec::new(),
            kp_matrix: Vec::new(),
            x: Vec::new(),
            ki: gains.ki.clone(),
            ks: Vec::new(),
            ks_matrix: Vec::new(),
        };
        match gains.structure {
            GainStructure::Diagonal => table.kp = (0..gains.kp.nrows()).map(|i| gains.kp[(i, i)]).collect(),
            GainStructure::Block | GainStructure::Full => table.kp_matrix = linalg::to_rows(&gains.kp),
            GainStructure::Scheduled => table.x = linalg::to_rows(&gains.kp),
        }
        table
    }

    /// Takes the K_P of `proportional` as K_S.
    ///
    /// # Errors
    /// Gains with an integral part, or scheduled gains.
    pub fn take_sliding_gain(&mut self, proportional: &GainTable) -> Result<(), SlidingGainError> {
        if !proportional.ki.is_empty() {
            return Err(SlidingGainError::Integral);
        }
        if proportional.structure == GainStructure::Scheduled {
            return Err(SlidingGainError::Scheduled);
        }
        self.ks.clone_from(&proportional.kp);
        self.ks_matrix.clone_from(&proportional.kp_matrix);
        Ok(())
    }

    /// The gains of a table.
    ///
    /// # Errors
    /// Ragged rows, entries that are not finite.
    pub fn gains(&self) -> Result<Gains, LinalgError> {
        let kp = match self.structure {
            GainStructure::Diagonal => diagonal(&self.kp),
            GainStructure::Block | GainStructure::Full => linalg::from_rows(&self.kp_matrix)?,
            GainStructure::Scheduled => linalg::from_rows(&self.x)?,
        };
        Ok(Gains {
            structure: self.structure,
            kp,
            ki: self.ki.clone(),
        })
    }
}

/// One channel norm.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ChannelEntry {
    /// Model.
    pub model: String,
    /// Channel.
    pub channel: String,
    /// Norm.
    pub norm: f64,
    /// Peak, rad/s.
    pub omega_rad_s: f64,
}

/// One margin: multiples of the stated set.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MarginEntry {
    /// The uncertainty set.
    pub set: String,
    /// Model.
    pub model: String,
    /// Guaranteed for all frequencies.
    pub guaranteed: f64,
    /// Size of the destabilising perturbation found.
    pub destabilising: f64,
    /// Critical frequency, rad/s.
    pub critical_rad_s: f64,
}

/// The sampled loop of one model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SampledEntry {
    /// Model.
    pub model: String,
    /// Whether the propellant sloshes.
    pub slosh: bool,
    /// Spectral radius over one controller period.
    pub spectral_radius: f64,
    /// Factor on all gains up to which the loop is stable.
    pub gain_margin: f64,
    /// Delay that may be added, s.
    pub delay_margin_s: f64,
}

/// One closed-loop run in the non-linear simulator, with the linear analysis of the same loop.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ClosedLoopEntry {
    /// Model that gave the configuration of the run; masses are nominal.
    pub model: String,
    /// Delay of the measurement, and of the command, s.
    pub delay_s: f64,
    /// Spectral radius of the sampled loop with sloshing propellant and these delays.
    pub spectral_radius: f64,
    /// Whether the scenario's criteria were met.
    pub settled: bool,
    /// Fraction of the controller's samples in which a command exceeded an actuator's limit.
    pub saturated_fraction: f64,
}

impl ClosedLoopEntry {
    /// Whether the simulator contradicts the linear analysis: the analysis predicts stability and the run did not settle.
    pub fn contradicts(&self) -> bool {
        self.spectral_radius < 1.0 && !self.settled
    }
}

/// Full-order optimum of the tracking channel of one model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OptimumEntry {
    /// Model.
    pub model: String,
    /// No controller attains this norm.
    pub unreachable: f64,
    /// Some controller attains this norm.
    pub reachable: f64,
}

impl OptimumEntry {
    /// Builds it from the two ends of the bracket.
    pub fn new(model: &str, (unreachable, reachable): (f64, f64)) -> Self {
        Self {
            model: model.to_owned(),
            unreachable,
            reachable,
        }
    }
}

/// Summary of the validation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ValidationEntry {
    /// Samples.
    pub samples: usize,
    /// Unstable ones.
    pub unstable: usize,
    /// Stable ones above the limit of the specification.
    #[serde(default)]
    pub above: usize,
    /// Largest gamma among the stable ones.
    pub worst_gamma: f64,
    /// Histogram: lower edge of each bin, and count.
    pub histogram: Vec<(f64, usize)>,
}

/// The problem as plain matrices, sufficient for an independent implementation to recompute the claim.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ExportedProblem {
    /// Meaning of the fields.
    pub about: String,
    /// The claimed largest channel norm.
    pub gamma: f64,
    /// Length of the optimality certificate, when tuned.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub certificate: Option<f64>,
    /// Gain blocks: structure, place and value.
    pub gains: Vec<ExportedGain>,
    /// Models.
    pub models: Vec<ExportedModel>,
}

/// One gain block.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ExportedGain {
    /// Name.
    pub name: String,
    /// Structure in words.
    pub structure: String,
    /// First row in K.
    pub row: usize,
    /// First column in K.
    pub column: usize,
    /// Value X.
    pub value: Vec<Vec<f64>>,
}

/// One model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[allow(non_snake_case, missing_docs)]
pub struct ExportedModel {
    /// Name.
    pub name: String,
    pub A: Vec<Vec<f64>>,
    pub B1: Vec<Vec<f64>>,
    pub B: Vec<Vec<f64>>,
    pub C1: Vec<Vec<f64>>,
    pub C: Vec<Vec<f64>>,
    pub D11: Vec<Vec<f64>>,
    pub D12: Vec<Vec<f64>>,
    pub D21: Vec<Vec<f64>>,
    pub D22: Vec<Vec<f64>>,
    /// The controller gain u = K y of this model.
    pub K: Vec<Vec<f64>>,
    /// Channels: rows of z and columns of w (from, to exclusive), and the claimed norm.
    pub channels: Vec<ExportedChannel>,
}

/// One channel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ExportedChannel {
    /// Name.
    pub name: String,
    /// Rows of z, from and to (exclusive).
    pub outputs: [usize; 2],
    /// Columns of w, from and to (exclusive).
    pub inputs: [usize; 2],
    /// Claimed norm.
    pub norm: f64,
    /// Its peak, rad/s; none (null in JSON) at infinite frequency.
    pub omega_rad_s: Option<f64>,
}

/// Exports a problem with its gains and their claimed norms.
pub fn export(
    problem: &Problem,
    gains: &[Matrix],
    controllers: &[Matrix],
    evaluation: &Evaluation,
    certificate: Option<&Certificate>,
) -> ExportedProblem {
    let structure = |kind: &GainKind| match kind {
        GainKind::Full { rows, columns } => format!("free {rows} x {columns}"),
        GainKind::PositiveDiagonal(n) => format!("positive diagonal {n}"),
        GainKind::PositiveDefinite(sizes) => format!("symmetric positive definite, blocks {sizes:?}"),
    };
    let mut norms = evaluation.channels.iter();
    let models = problem
        .models
        .iter()
        .zip(controllers)
        .map(|(m, k)| {
            let p = &m.plant;
            let n = p.states();
            let (nw, nz) = (p.inputs() - m.controls, p.outputs() - m.measurements);
            let cut = |x: &Matrix, r: usize, c: usize, h: usize, w: usize| linalg::to_rows(&x.block(r, c, h, w));
            ExportedModel {
                name: m.name.clone(),
                A: linalg::to_rows(&p.a),
                B1: cut(&p.b, 0, 0, n, nw),
                B: cut(&p.b, 0, nw, n, m.controls),
                C1: cut(&p.c, 0, 0, nz, n),
                C: cut(&p.c, nz, 0, m.measurements, n),
                D11: cut(&p.d, 0, 0, nz, nw),
                D12: cut(&p.d, 0, nw, nz, m.controls),
                D21: cut(&p.d, nz, 0, m.measurements, nw),
                D22: cut(&p.d, nz, nw, m.measurements, m.controls),
                K: linalg::to_rows(k),
                channels: m
                    .channels
                    .iter()
                    .map(|c| {
                        let found = norms.next();
                        ExportedChannel {
                            name: c.name.clone(),
                            outputs: [c.outputs.start, c.outputs.end],
                            inputs: [c.inputs.start, c.inputs.end],
                            norm: found.map_or(f64::INFINITY, |f| f.norm),
                            omega_rad_s: found.map(|f| f.omega).filter(|omega| omega.is_finite()),
                        }
                    })
                    .collect(),
            }
        })
        .collect();
    ExportedProblem {
        about: "x' = A x + B1 w + B u, z = C1 x + D11 w + D12 u, y = C x + D21 w + D22 u, u = K y. A channel is the closed loop from \
                the columns `inputs` of w to the rows `outputs` of z; its H-infinity norm is claimed in `norm`, at the frequency `omega_rad_s` (null: infinite). K of a model is \
                assembled from the gain blocks, each possibly transformed per model (M^1/2 X M^1/2 for scheduled gains)."
            .into(),
        gamma: evaluation.gamma,
        certificate: certificate.map(|c| c.length),
        gains: problem
            .gains
            .iter()
            .zip(gains)
            .map(|(g, value)| ExportedGain {
                name: g.name.clone(),
                structure: structure(&g.kind),
                row: g.row,
                column: g.column,
                value: linalg::to_rows(value),
            })
            .collect(),
        models,
    }
}
