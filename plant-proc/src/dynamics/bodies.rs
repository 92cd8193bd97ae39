//! End-effector motion, momentum and energy from one pass over the servicer's bodies.

use multibody::{Momentum, Placement};
use nalgebra::Vector3;

use super::{Model, Motion, Totals};

/// Quantities for the truth message that need all bodies of the servicer.
#[derive(Debug, Clone, Copy)]
pub struct BodyQuantities {
    /// Pose of the end effector in the base.
    pub end_effector: Placement,
    /// Twist of the end effector in its own axes: ω_NE, v_NE.
    pub twist: (Vector3<f64>, Vector3<f64>),
    /// Momentum, and kinetic energy, J.
    pub momentum: (Momentum, f64),
}

impl BodyQuantities {
    /// Evaluates them at this motion.
    pub fn of(model: &Model, motion: &Motion) -> Self {
        let kinematics = model.kinematics(&motion.servicer);
        Self {
            end_effector: model.tree.placement(&kinematics, model.end_effector),
            twist: model.twist(&kinematics, &motion.servicer),
            momentum: Totals::own(model, &kinematics, motion),
        }
    }
}
