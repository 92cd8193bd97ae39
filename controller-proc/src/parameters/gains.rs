//! Gains of the inner loop, as a file holds them.

use control_laws::inner::Gains;
use control_laws::{Dof, Matrix13};
use interfaces::JOINTS;
use lockstep::participant::ParameterError;
use lockstep::units::{Each, LinearDamping, LinearStiffness, RotationalDamping, RotationalStiffness};
use serde::Deserialize;

use super::channels;

/// K_P and K_I: diagonal, channel by channel with units, or full matrices.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GainsFile {
    /// Diagonal of K_P.
    pub kp: Option<Kp>,
    /// Diagonal of K_I.
    pub ki: Option<Ki>,
    /// Full K_P, row by row, SI units: rows make N m, N and N m, columns take rad/s, m/s and rad/s.
    pub kp_matrix: Option<[[f64; 13]; 13]>,
    /// Full K_I, row by row, SI units: columns take rad, m and rad.
    pub ki_matrix: Option<[[f64; 13]; 13]>,
}

/// Diagonal of K_P.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Kp {
    /// Base torque per angular rate.
    pub base_rotation: Each<RotationalDamping, 3>,
    /// Base force per speed.
    pub base_translation: Each<LinearDamping, 3>,
    /// Joint torque per joint rate.
    pub joints: Each<RotationalDamping, JOINTS>,
}

/// Diagonal of K_I.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ki {
    /// Base torque per angle.
    pub base_rotation: Each<RotationalStiffness, 3>,
    /// Base force per length.
    pub base_translation: Each<LinearStiffness, 3>,
    /// Joint torque per joint angle.
    pub joints: Each<RotationalStiffness, JOINTS>,
}

impl GainsFile {
    /// The gains.
    ///
    /// # Errors
    /// When neither or both of the forms are given.
    pub fn gains(&self) -> Result<Gains, ParameterError> {
        match (&self.kp, &self.ki, &self.kp_matrix, &self.ki_matrix) {
            (Some(kp), Some(ki), None, None) => {
                let kp: Dof = channels(kp.base_rotation.si(), kp.base_translation.si(), kp.joints.si());
                let ki: Dof = channels(ki.base_rotation.si(), ki.base_translation.si(), ki.joints.si());
                Ok(Gains::diagonal(&kp, &ki))
            }
            (None, None, Some(kp), Some(ki)) => {
                let matrix = |rows: &[[f64; 13]; 13]| Matrix13::from_fn(|row, column| rows[row][column]);
                Ok(Gains::full(matrix(kp), matrix(ki)))
            }
            _ => Err(ParameterError::new(
                "gains",
                "give either the tables kp and ki (diagonals with units) or kp_matrix and ki_matrix (13 rows of 13 numbers \
                 in SI units)",
            )),
        }
    }
}
