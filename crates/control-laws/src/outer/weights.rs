//! Weights of the pseudoinverse, which share a twist of the end effector between base and arm (Eq 14 and 15).

use crate::{Dof, JOINTS, ParameterError};

/// Weight ε of the arm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ArmWeight {
    /// Eq 15: linear in the distance of the base from the target, and never below zero. Far away the base moves, near the target the arm.
    ByDistance {
        /// Distance `r_cl` at which the weight is `near_weight`, m.
        near_m: f64,
        /// Distance `r_far` at which the weight is `far_weight`, m.
        far_m: f64,
        /// Weight at the near distance.
        near_weight: f64,
        /// Weight at the far distance.
        far_weight: f64,
    },
    /// Constant weight.
    Fixed(f64),
}

impl Default for ArmWeight {
    /// 100 at the closing distance |(−0.35, 0, −2.375) m| and 10 at twice that, as in the paper.
    fn default() -> Self {
        let near_m = (0.35_f64 * 0.35 + 2.375 * 2.375).sqrt();
        Self::ByDistance {
            near_m,
            far_m: 2.0 * near_m,
            near_weight: 100.0,
            far_weight: 10.0,
        }
    }
}

/// User parameters of the weights.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Weights {
    /// Weight of the base's rotation.
    pub base_rotation: f64,
    /// Weight of the base's translation.
    pub base_translation: f64,
    /// Weight ε of the arm.
    pub arm: ArmWeight,
    /// Factor on ε for every joint: 0 locks the joint, 1 leaves it free.
    pub joint_factor: [f64; JOINTS],
}

impl Default for Weights {
    /// Eq 14: 1 for the base's rotation, 10 for its translation, ε of Eq 15 for every joint.
    fn default() -> Self {
        Self {
            base_rotation: 1.0,
            base_translation: 10.0,
            arm: ArmWeight::default(),
            joint_factor: [1.0; JOINTS],
        }
    }
}

/// The weights at an instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Weight {
    /// ε.
    pub epsilon: f64,
    /// Whether Eq 15 gave a negative ε, which was clamped to zero: the arm rests.
    pub clamped: bool,
    /// Diagonal of `W`.
    pub diagonal: Dof,
}

impl Weights {
    pub(super) fn validate(&self) -> Result<(), ParameterError> {
        // a base weight above zero keeps J W Jᵀ regular in every arm configuration
        ParameterError::positive("outer.weights.base_rotation", self.base_rotation)?;
        ParameterError::positive("outer.weights.base_translation", self.base_translation)?;
        for factor in self.joint_factor {
            ParameterError::non_negative("outer.weights.joint_factor", factor)?;
        }
        match self.arm {
            ArmWeight::Fixed(weight) => {
                ParameterError::non_negative("outer.weights.arm", weight)?;
            }
            ArmWeight::ByDistance {
                near_m,
                far_m,
                near_weight,
                far_weight,
            } => {
                ParameterError::positive("outer.weights.arm.near_m", near_m)?;
                ParameterError::positive("outer.weights.arm.far_m", far_m)?;
                ParameterError::non_negative("outer.weights.arm.near_weight", near_weight)?;
                ParameterError::non_negative("outer.weights.arm.far_weight", far_weight)?;
                if far_m <= near_m {
                    let remedy = "must be larger than outer.weights.arm.near_m";
                    return Err(ParameterError::new("outer.weights.arm.far_m", far_m, remedy));
                }
            }
        }
        Ok(())
    }

    /// The weights with the base `distance_m` away from the target, and `joint_factor` on those of the joints.
    pub fn at(&self, distance_m: f64, joint_factor: &[f64; JOINTS]) -> Weight {
        let raw = match self.arm {
            ArmWeight::Fixed(weight) => weight,
            ArmWeight::ByDistance {
                near_m,
                far_m,
                near_weight,
                far_weight,
            } => {
                let span_m = far_m - near_m;
                // Eq 15
                (near_weight * far_m - far_weight * near_m - (near_weight - far_weight) * distance_m) / span_m
            }
        };
        let clamped = raw < 0.0;
        let epsilon = if clamped { 0.0 } else { raw };
        // Eq 14
        let diagonal = Dof::from_fn(|row, _| match row {
            0..3 => self.base_rotation,
            3..6 => self.base_translation,
            _ => epsilon * self.joint_factor[row - 6] * joint_factor[row - 6],
        });
        Weight {
            epsilon,
            clamped,
            diagonal,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn epsilon_is_that_of_the_paper_and_never_negative() {
        let weights = Weights::default();
        let closing_m = (0.35_f64 * 0.35 + 2.375 * 2.375).sqrt();
        for (factor, epsilon, clamped) in [
            (1.0, 100.0, false),
            (1.2, 82.0, false),
            (2.0, 10.0, false),
            (2.11, 0.1, false),
            (2.12, 0.0, true),
            (9.0, 0.0, true),
        ] {
            let weight = weights.at(factor * closing_m, &[1.0; JOINTS]);
            assert!((weight.epsilon - epsilon).abs() < 1e-9, "{factor}: {}", weight.epsilon);
            assert_eq!(weight.clamped, clamped, "{factor}");
        }
    }

    #[test]
    fn the_factor_of_a_joint_scales_its_weight_alone() {
        let mut weights = Weights::default();
        weights.joint_factor[3] = 0.0;
        let mut faded = [1.0; JOINTS];
        faded[5] = 0.5;
        let diagonal = weights.at(2.4, &faded).diagonal;
        assert_eq!(diagonal[11], 0.5 * diagonal[10]);
        assert_eq!(diagonal[9], 0.0);
        assert!(diagonal[8] > 90.0 && diagonal[8] == diagonal[10]);
        assert_eq!((diagonal[2], diagonal[3]), (1.0, 10.0));
    }

    #[test]
    fn weights_out_of_range_are_refused_with_the_field() {
        let field = |weights: Weights| weights.validate().unwrap_err().field;
        let base_rotation = 0.0;
        assert_eq!(
            field(Weights {
                base_rotation,
                ..Weights::default()
            }),
            "outer.weights.base_rotation"
        );
        let arm = ArmWeight::ByDistance {
            near_m: 2.0,
            far_m: 2.0,
            near_weight: 1.0,
            far_weight: 1.0,
        };
        assert_eq!(
            field(Weights {
                arm,
                ..Weights::default()
            }),
            "outer.weights.arm.far_m"
        );
        let mut weights = Weights::default();
        weights.joint_factor[6] = f64::NAN;
        assert_eq!(field(weights), "outer.weights.joint_factor");
    }
}
