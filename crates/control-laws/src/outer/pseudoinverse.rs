//! Weighted pseudoinverse of the body Jacobian (Eq 14).

use crate::{Dof, Jacobian, Twist};
use nalgebra::{Matrix6, SMatrix};

/// `J† = W Jᵀ (J W Jᵀ)⁻¹`: of all velocities that give a twist, the one that minimises `ṽᵀ W⁻¹ ṽ`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WeightedPseudoinverse {
    jacobian: Jacobian,
    inverse: SMatrix<f64, 13, 6>,
}

impl WeightedPseudoinverse {
    /// Builds it from the Jacobian (6 × 13) and the diagonal of `W`, whose entries are not negative. The base's entries are above zero, and
    /// the base alone can give the end effector any twist, so `J W Jᵀ` is always regular.
    pub fn new(jacobian: &Jacobian, weight: &Dof) -> Self {
        let mut weighted = jacobian.transpose(); // W Jᵀ
        for (mut row, weight) in weighted.row_iter_mut().zip(weight.iter()) {
            row *= *weight;
        }
        let gram: Matrix6<f64> = jacobian * weighted;
        let gram_inverse = match gram.cholesky() {
            Some(factor) => factor.inverse(),
            // reached only for a Jacobian that is not finite: the result is NaN instead of hiding it
            None => Matrix6::repeat(f64::NAN),
        };
        Self {
            jacobian: *jacobian,
            inverse: weighted * gram_inverse,
        }
    }

    /// The velocity for a twist of the end effector.
    pub fn apply(&self, twist: &Twist) -> Dof {
        self.inverse * twist
    }

    /// Null-space component of `velocity`, which leaves the end effector at rest: `(I − J† J) ṽ`.
    pub fn null_space(&self, velocity: &Dof) -> Dof {
        velocity - self.inverse * (self.jacobian * velocity)
    }

    /// `J†`.
    pub fn matrix(&self) -> &SMatrix<f64, 13, 6> {
        &self.inverse
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3;
    use proptest::prelude::*;

    /// A Jacobian of the right structure: an invertible base part and any arm part.
    fn jacobian() -> impl Strategy<Value = Jacobian> {
        (
            proptest::collection::vec(-1.0..1.0, 3),
            proptest::collection::vec(-2.0..2.0, 3),
            proptest::collection::vec(-1.5..1.5, 42),
        )
            .prop_map(|(phi, arm, joints): (Vec<f64>, Vec<f64>, Vec<f64>)| {
                let R = guidance_laws::so3::exp(&nalgebra::Vector3::from_row_slice(&phi))
                    .to_rotation_matrix()
                    .into_inner();
                let cross = guidance_laws::so3::hat(&nalgebra::Vector3::from_row_slice(&arm));
                let mut J = Jacobian::zeros();
                J.fixed_view_mut::<3, 3>(0, 0).copy_from(&R);
                J.fixed_view_mut::<3, 3>(0, 3).copy_from(&Matrix3::zeros());
                J.fixed_view_mut::<3, 3>(3, 0).copy_from(&(-R * cross));
                J.fixed_view_mut::<3, 3>(3, 3).copy_from(&R);
                J.fixed_view_mut::<6, 7>(0, 6)
                    .copy_from(&SMatrix::<f64, 6, 7>::from_row_slice(&joints));
                J
            })
    }

    fn weight() -> impl Strategy<Value = Dof> {
        (
            0.1..200.0,
            proptest::collection::vec(prop_oneof![Just(0.0), 0.01..2.0], 7),
        )
            .prop_map(|(epsilon, factors): (f64, Vec<f64>)| {
                Dof::from_fn(|row, _| match row {
                    0..3 => 1.0,
                    3..6 => 10.0,
                    _ => epsilon * factors[row - 6],
                })
            })
    }

    fn dof() -> impl Strategy<Value = Dof> {
        proptest::collection::vec(-1.0..1.0, 13).prop_map(|values: Vec<f64>| Dof::from_row_slice(&values))
    }

    proptest! {
        #[test]
        fn pseudoinverse_is_a_right_inverse(J in jacobian(), weight in weight()) {
            let inverse = WeightedPseudoinverse::new(&J, &weight);
            prop_assert!((J * inverse.matrix() - Matrix6::identity()).abs().max() < 1e-10);
        }

        #[test]
        fn pseudoinverse_gives_the_least_weighted_velocity(J in jacobian(), weight in weight(), other in dof()) {
            let inverse = WeightedPseudoinverse::new(&J, &weight);
            let other = other.zip_map(&weight, |value, weight| if weight > 0.0 { value } else { 0.0 });
            let best = inverse.apply(&(J * other));
            let cost = |velocity: &Dof| -> f64 {
                velocity.iter().zip(weight.iter()).filter(|(_, w)| **w > 0.0).map(|(v, w)| v * v / w).sum()
            };
            prop_assert!(cost(&best) <= cost(&other) * (1.0 + 1e-10) + 1e-12);
            // and stationary: the difference, a null-space motion, is orthogonal in the metric of the cost
            let difference = inverse.null_space(&other);
            let product: f64 = (0..13).filter(|i| weight[*i] > 0.0).map(|i| best[i] * difference[i] / weight[i]).sum();
            prop_assert!(product.abs() < 1e-9 * (1.0 + cost(&other)));
        }

        #[test]
        fn null_space_motions_leave_the_end_effector_at_rest(J in jacobian(), weight in weight(), velocity in dof()) {
            let inverse = WeightedPseudoinverse::new(&J, &weight);
            prop_assert!((J * inverse.null_space(&velocity)).norm() < 1e-10);
        }

        #[test]
        fn a_weight_of_zero_locks_the_joint(J in jacobian(), mut weight in weight(), velocity in dof(), joint in 6_usize..13) {
            weight[joint] = 0.0;
            let inverse = WeightedPseudoinverse::new(&J, &weight);
            prop_assert_eq!(inverse.apply(&(J * velocity))[joint], 0.0);
        }
    }
}
