//! Avoidance of joint limits and of the straight elbow, in the null space of the end effector's Jacobian.
//!
//! Beyond the paper, off by default. The law acts on a joint closer than a margin to a limit of its range, and on the elbow when it is
//! nearly straight, in two ways. The joint's weight fades to zero at the limit, so that the motion of the end effector is shifted to the
//! other joints and to the base (the weights of the base never fade, so the end effector always attains its twist). And the joint is
//! commanded away from the limit; the null-space projection makes the other channels compensate, so the end effector is not disturbed.
//!
//! The commanded rate alone would not suffice: with large arm weights the projection returns most of the motion to the same joint.

use crate::{Dof, JOINTS, ParameterError};

/// User parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AvoidanceParameters {
    /// Lower end of each joint's range, rad.
    pub lower_rad: [f64; JOINTS],
    /// Upper end of each joint's range, rad.
    pub upper_rad: [f64; JOINTS],
    /// Distance from a limit at which avoidance starts, rad.
    pub margin_rad: f64,
    /// Rate commanded to a joint at its limit, rad/s; it grows with the square of the depth in the margin.
    pub rate_rad_s: f64,
    /// The elbow, if its straight position is also to be avoided.
    pub elbow: Option<Elbow>,
}

/// A joint in which the arm becomes singular at angle zero.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Elbow {
    /// Index of the joint, 0 for A1.
    pub joint: usize,
    /// Angle below which the elbow is commanded to bend, rad.
    pub margin_rad: f64,
    /// Rate commanded at the straight position, rad/s.
    pub rate_rad_s: f64,
}

impl AvoidanceParameters {
    pub(crate) fn validate(&self) -> Result<(), ParameterError> {
        ParameterError::positive("avoidance.margin_rad", self.margin_rad)?;
        ParameterError::positive("avoidance.rate_rad_s", self.rate_rad_s)?;
        ParameterError::finite("avoidance.lower_rad", &self.lower_rad)?;
        ParameterError::finite("avoidance.upper_rad", &self.upper_rad)?;
        let ranges = self.lower_rad.iter().zip(&self.upper_rad);
        if ranges
            .clone()
            .all(|(lower, upper)| upper > lower && upper - lower <= 2.0 * self.margin_rad)
        {
            // the ranges are hardly all wrong
            let remedy =
                "must be less than half of each joint's range, from avoidance.lower_rad to avoidance.upper_rad";
            return Err(ParameterError::new("avoidance.margin_rad", self.margin_rad, remedy));
        }
        for (lower, upper) in ranges {
            if upper - lower <= 2.0 * self.margin_rad {
                let remedy = "must be above avoidance.lower_rad by more than twice avoidance.margin_rad";
                return Err(ParameterError::new("avoidance.upper_rad", upper, remedy));
            }
        }
        if let Some(elbow) = self.elbow {
            ParameterError::positive("avoidance.elbow.margin_rad", elbow.margin_rad)?;
            ParameterError::positive("avoidance.elbow.rate_rad_s", elbow.rate_rad_s)?;
            if elbow.joint >= JOINTS {
                let remedy = "must be the index of a joint, 0 to 6";
                return Err(ParameterError::new("avoidance.elbow.joint", elbow.joint, remedy));
            }
        }
        Ok(())
    }

    /// Factor on the weight of each joint: 1 outside every margin, falling to 0 at the limit of the range and at the straight elbow.
    pub fn weight_factors(&self, joints: &[f64; JOINTS]) -> [f64; JOINTS] {
        std::array::from_fn(|joint| {
            let above = depth(self.upper_rad[joint] - joints[joint], self.margin_rad);
            let below = depth(joints[joint] - self.lower_rad[joint], self.margin_rad);
            let straight = match self.elbow {
                Some(elbow) if elbow.joint == joint => depth(joints[joint].abs(), elbow.margin_rad),
                _ => 0.0,
            };
            (1.0 - above.max(below).max(straight)).max(0.0)
        })
    }

    /// The avoidance velocity before its projection into the null space; zero outside every margin.
    pub fn avoidance_velocity(&self, joints: &[f64; JOINTS]) -> Dof {
        let mut velocity = Dof::zeros();
        for joint in 0..JOINTS {
            let above = depth(self.upper_rad[joint] - joints[joint], self.margin_rad);
            let below = depth(joints[joint] - self.lower_rad[joint], self.margin_rad);
            velocity[6 + joint] = self.rate_rad_s * (below * below - above * above);
        }
        if let Some(elbow) = self.elbow {
            let angle = joints[elbow.joint];
            let into = depth(angle.abs(), elbow.margin_rad);
            // away from zero; a perfectly straight elbow bends to the positive side
            velocity[6 + elbow.joint] += elbow.rate_rad_s * into * into * if angle < 0.0 { -1.0 } else { 1.0 };
        }
        velocity
    }
}

/// Depth in the margin: 0 at its edge, 1 where `distance` is zero, and at most 2 beyond.
fn depth(distance: f64, margin: f64) -> f64 {
    ((margin - distance) / margin).clamp(0.0, 2.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parameters() -> AvoidanceParameters {
        AvoidanceParameters {
            lower_rad: [-2.0; JOINTS],
            upper_rad: [2.0; JOINTS],
            margin_rad: 0.4,
            rate_rad_s: 0.1,
            elbow: Some(Elbow {
                joint: 3,
                margin_rad: 0.3,
                rate_rad_s: 0.05,
            }),
        }
    }

    #[test]
    fn avoidance_moves_only_joints_in_a_margin() {
        let velocity = parameters().avoidance_velocity(&[0.0, 1.59, 1.9, 0.5, -2.0, -2.5, 1.0]);
        assert_eq!(velocity.fixed_rows::<8>(0), Dof::zeros().fixed_rows::<8>(0));
        assert!(velocity[8] < 0.0 && velocity[8] > -0.1);
        assert_eq!((velocity[9], velocity[12]), (0.0, 0.0));
        assert_eq!(velocity[10], 0.1);
        assert!(
            velocity[11] > 0.1 && velocity[11] <= 0.4,
            "beyond the end more, but bounded"
        );
    }

    #[test]
    fn weights_vanish_at_limits_and_at_the_straight_elbow() {
        let weight_factors = parameters().weight_factors(&[0.0, 1.8, 2.0, 0.15, -2.5, -1.9, 1.0]);
        for (factor, expected) in weight_factors.into_iter().zip([1.0, 0.5, 0.0, 0.5, 0.0, 0.25, 1.0]) {
            assert!((factor - expected).abs() < 1e-12, "{weight_factors:?}");
        }
    }

    #[test]
    fn a_straight_elbow_bends_away_from_zero() {
        for (angle, sign) in [(0.1, 1.0), (-0.1, -1.0), (0.0, 1.0)] {
            let mut joints = [0.5; JOINTS];
            joints[3] = angle;
            assert!(parameters().avoidance_velocity(&joints)[9] * sign > 0.0, "{angle}");
        }
    }

    #[test]
    fn too_narrow_ranges_are_rejected_with_the_field() {
        let mut narrow = parameters();
        narrow.upper_rad[2] = -1.3;
        assert_eq!(narrow.validate().unwrap_err().field, "avoidance.upper_rad");
        let mut wide = parameters();
        wide.margin_rad = 2.0;
        assert_eq!(wide.validate().unwrap_err().field, "avoidance.margin_rad");
        let mut elbow = parameters();
        elbow.elbow.as_mut().unwrap().joint = 7;
        assert_eq!(elbow.validate().unwrap_err().field, "avoidance.elbow.joint");
    }
}
