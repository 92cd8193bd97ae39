//! Gains of the inner loop as given in a file.

use control_laws::inner::{FeedbackLaw, Gains};
use control_laws::{Dof, Matrix13};
use interfaces::JOINTS;
use lockstep::participant::ParameterError;
use lockstep::units::{LinearDamping, LinearStiffness, PerAxis, RotationalDamping, RotationalStiffness};
use serde::Deserialize;
use serde::de::IgnoredAny;

use super::channels;

/// Channels of the inner loop: 3 rotations, 3 translations, the joints.
const CHANNELS: usize = 6 + JOINTS;

/// K_P and K_I in one of three forms: as `escapement tune` writes them; diagonals, channel by channel with units; or full
/// matrices.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GainsFile {
    /// Tuned gains.
    pub gains: Option<Tuned>,
    /// Diagonal of K_P.
    pub kp: Option<Kp>,
    /// Diagonal of K_I.
    pub ki: Option<Ki>,
    /// Full K_P, row by row, SI units: rows give N m, N and N m, columns take rad/s, m/s and rad/s.
    pub kp_matrix: Option<[[f64; 13]; 13]>,
    /// Full K_I, row by row, SI units: columns take rad, m and rad.
    pub ki_matrix: Option<[[f64; 13]; 13]>,
    // Other tables of a tuned-gains file: read by `escapement margins` and `escapement check`.
    #[serde(rename = "provenance")]
    _provenance: Option<IgnoredAny>,
    #[serde(rename = "models")]
    _models: Option<IgnoredAny>,
    #[serde(rename = "channels")]
    _channels: Option<IgnoredAny>,
    #[serde(rename = "margins")]
    _margins: Option<IgnoredAny>,
    #[serde(rename = "sampled")]
    _sampled: Option<IgnoredAny>,
    #[serde(rename = "closed_loop")]
    _closed_loop: Option<IgnoredAny>,
    #[serde(rename = "validation")]
    _validation: Option<IgnoredAny>,
    #[serde(rename = "full_order")]
    _full_order: Option<IgnoredAny>,
    #[serde(rename = "rounds")]
    _rounds: Option<IgnoredAny>,
    #[serde(rename = "adversary")]
    _adversary: Option<IgnoredAny>,
}

/// The table `gains` of a file that `escapement tune` wrote, SI units.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tuned {
    /// Structure of K_P.
    pub structure: StructureName,
    /// Diagonal of K_P, for `diagonal`.
    #[serde(default)]
    pub kp: Vec<f64>,
    /// Rows of K_P, for `block` and `full`.
    #[serde(default)]
    pub kp_matrix: Vec<Vec<f64>>,
    /// Rows of X, for `scheduled`, 1/s.
    #[serde(default)]
    pub x: Vec<Vec<f64>>,
    /// Diagonal of K_I; empty when tuned without an integral part.
    #[serde(default)]
    pub ki: Vec<f64>,
    /// Diagonal of K_S, whose norm bounds the conditional integrator with `inner.bound = "sliding-gain"`.
    #[serde(default)]
    pub ks: Vec<f64>,
    /// Rows of K_S where it is not diagonal.
    #[serde(default)]
    pub ks_matrix: Vec<Vec<f64>>,
}

/// Structure of tuned K_P.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum StructureName {
    /// Diagonal.
    Diagonal,
    /// Blocks of base rotation, base translation and arm.
    Block,
    /// Full matrix.
    Full,
    /// `K_P(q) = M(q)^½ X M(q)^½`.
    Scheduled,
}

/// Diagonal of K_P.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Kp {
    /// Base torque per angular rate.
    pub base_rotation: PerAxis<RotationalDamping, 3>,
    /// Base force per speed.
    pub base_translation: PerAxis<LinearDamping, 3>,
    /// Joint torque per joint rate.
    pub joints: PerAxis<RotationalDamping, JOINTS>,
}

/// Diagonal of K_I.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ki {
    /// Base torque per angle.
    pub base_rotation: PerAxis<RotationalStiffness, 3>,
    /// Base force per length.
    pub base_translation: PerAxis<LinearStiffness, 3>,
    /// Joint torque per joint angle.
    pub joints: PerAxis<RotationalStiffness, JOINTS>,
}

impl GainsFile {
    /// The gains for a feedback law.
    ///
    /// # Errors
    /// When none or several of the forms are given, when their size is not that of the servicer, or when they were tuned for another
    /// feedback law.
    pub fn gains(&self, feedback: &FeedbackLaw) -> Result<Gains, ParameterError> {
        match (&self.gains, &self.kp, &self.ki, &self.kp_matrix, &self.ki_matrix) {
            (Some(tuned), None, None, None, None) => tuned.gains(feedback),
            (None, Some(kp), Some(ki), None, None) => {
                let kp: Dof = channels(kp.base_rotation.si(), kp.base_translation.si(), kp.joints.si());
                let ki: Dof = channels(ki.base_rotation.si(), ki.base_translation.si(), ki.joints.si());
                Ok(Gains::diagonal(&kp, &ki))
            }
            (None, None, None, Some(kp), Some(ki)) => {
                let matrix = |rows: &[[f64; 13]; 13]| Matrix13::from_fn(|row, column| rows[row][column]);
                Ok(Gains::full(matrix(kp), matrix(ki)))
            }
            _ => Err(ParameterError::new(
                "gains",
                "give one of: a file of `escapement tune` (its table `gains`), the tables kp and ki (diagonals with units), \
                 or kp_matrix and ki_matrix (13 rows of 13 numbers in SI units)",
            )),
        }
    }
}

impl GainsFile {
    /// ‖K_S‖, the paper's bound of the feedback: one number for N m and N alike.
    ///
    /// # Errors
    /// When there is no K_S, or its size is not that of the servicer.
    pub fn sliding_gain_norm(&self) -> Result<f64, ParameterError> {
        let tuned = self.gains.as_ref();
        let sizes = tuned.map_or((0, 0), |tuned| (tuned.ks.len(), tuned.ks_matrix.len()));
        match (tuned, sizes) {
            (Some(tuned), (1.., 0)) => Ok(list("gains.gains.ks", &tuned.ks)?.amax()),
            (Some(tuned), (0, 1..)) => Ok(matrix("gains.gains.ks_matrix", &tuned.ks_matrix)?
                .singular_values()
                .max()),
            (Some(_), (1.., 1..)) => {
                let reason = "stands beside `ks_matrix`, and K_S is one of them; remove the other";
                Err(ParameterError::new("gains.gains.ks", reason))
            }
            _ => {
                let reason = "is missing, and inner.bound = \"sliding-gain\" is its norm; tune with `gains.ks` in the specification, or \
                              choose inner.bound = \"actuators\"";
                Err(ParameterError::new("gains.gains.ks", reason))
            }
        }
    }
}

impl Tuned {
    fn gains(&self, feedback: &FeedbackLaw) -> Result<Gains, ParameterError> {
        let (name, wanted) = match self.structure {
            StructureName::Diagonal => ("diagonal", "kp"),
            StructureName::Block => ("block", "kp_matrix"),
            StructureName::Full => ("full", "kp_matrix"),
            StructureName::Scheduled => ("scheduled", "x"),
        };
        let lists = [
            ("kp", self.kp.len()),
            ("kp_matrix", self.kp_matrix.len()),
            ("x", self.x.len()),
        ];
        for (key, entries) in lists {
            if (key == wanted) != (entries > 0) {
                let reason = format!(
                    "structure = \"{name}\" has its gains in `{wanted}` alone, and `{key}` has {entries} entries; tune again, or correct `structure`"
                );
                return Err(ParameterError::new(format!("gains.gains.{key}"), reason));
            }
        }
        let ki = match (self.ki.is_empty(), feedback) {
            (true, FeedbackLaw::Proportional) => Dof::zeros(),
            (true, _) => {
                let reason = "is missing: these gains were tuned without an integral part; write inner = { feedback = \"proportional\" }, or \
                              name gains that were tuned with `integral = true`";
                return Err(ParameterError::new("gains.gains.ki", reason));
            }
            (false, FeedbackLaw::Proportional) => {
                let reason = "would be ignored: inner.feedback is \"proportional\" and these gains were tuned with an integral part; name gains \
                              that were tuned with `integral = false`, or another feedback";
                return Err(ParameterError::new("gains.gains.ki", reason));
            }
            (false, _) => list("gains.gains.ki", &self.ki)?,
        };
        Ok(match self.structure {
            StructureName::Diagonal => Gains::diagonal(&list("gains.gains.kp", &self.kp)?, &ki),
            StructureName::Block | StructureName::Full => Gains::full(
                matrix("gains.gains.kp_matrix", &self.kp_matrix)?,
                Matrix13::from_diagonal(&ki),
            ),
            StructureName::Scheduled => Gains::scheduled(matrix("gains.gains.x", &self.x)?, &ki),
        })
    }
}

fn size(key: &str, what: &str, found: usize) -> Result<(), ParameterError> {
    if found == CHANNELS {
        return Ok(());
    }
    let reason = format!(
        "has {found} {what}, and the servicer {CHANNELS} channels (3 rotations, 3 translations, {JOINTS} joints); name gains \
         that were tuned for this robot"
    );
    Err(ParameterError::new(key.to_owned(), reason))
}

fn list(key: &str, values: &[f64]) -> Result<Dof, ParameterError> {
    size(key, "entries", values.len())?;
    Ok(Dof::from_row_slice(values))
}

fn matrix(key: &str, rows: &[Vec<f64>]) -> Result<Matrix13, ParameterError> {
    size(key, "rows", rows.len())?;
    for row in rows {
        size(key, "entries in a row", row.len())?;
    }
    Ok(Matrix13::from_fn(|row, column| rows[row][column]))
}
