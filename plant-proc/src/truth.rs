//! Content of the truth port.

use interfaces::Truth;
use multibody::{Placement, Quaternion};
use nalgebra::Vector3;

use crate::dynamics::{Bob, BodyQuantities, Forces, Ledger, Model, Motion, Servicer, Target, Totals, quaternion_of};

/// Poses of the end effector E and of the target's grasp frame G in world axes.
pub struct GraspPoses {
    p_NE: Vector3<f64>,
    quat_NE: Quaternion,
    p_NG: Vector3<f64>,
    quat_NG: Quaternion,
}

impl GraspPoses {
    /// Computes both, with the end effector at the pose `p_BE` in the base.
    pub fn of(model: &Model, p_BE: &Placement, servicer: &Servicer, target: &Target) -> Self {
        Self {
            p_NE: servicer.p_nb + servicer.quat_nb.rotate(&p_BE.p),
            quat_NE: servicer.quat_nb.times(quaternion_of(&p_BE.r)),
            p_NG: target.p_nb + target.quat_nb.rotate(&model.grasp.p),
            quat_NG: target.quat_nb.times(model.quat_TG),
        }
    }

    /// Distance between the two origins, m.
    pub fn distance(&self) -> f64 {
        (self.p_NE - self.p_NG).norm()
    }

    /// Smallest angle between the two attitudes, rad.
    pub fn angle(&self) -> f64 {
        rotation_angle(self.quat_NG.conjugate().times(self.quat_NE))
    }
}

/// Fills a [`Truth`]. Keeps the signs of the quaternions derived from rotation matrices continuous.
#[derive(Debug, Clone, Copy, Default)]
pub struct TruthWriter {
    /// Attitudes of end effector and grasp frame as last written; zeros before.
    pub last: [[f64; 4]; 2],
}

impl TruthWriter {
    /// Updates the signs when the truth about this motion is not written, so that they are the same as if it were written at every step.
    pub fn update_signs(&mut self, model: &Model, motion: &Motion, target: &Target) {
        let kinematics = model.kinematics(&motion.servicer);
        let p_BE = model.tree.placement(&kinematics, model.end_effector);
        let poses = GraspPoses::of(model, &p_BE, &motion.servicer, target);
        self.with_continuous_sign(0, poses.quat_NE);
        self.with_continuous_sign(1, poses.quat_NG);
    }

    /// The truth about this motion and the servicer's `bodies` in it; `forces` are the actuators' over the step that ends here.
    pub fn message(
        &mut self,
        model: &Model,
        (motion, bodies): (&Motion, &BodyQuantities),
        target: &Target,
        forces: &Forces,
        ledger: &Ledger,
        grasped: bool,
    ) -> Truth {
        let servicer = &motion.servicer;
        let poses = GraspPoses::of(model, &bodies.end_effector, servicer, target);
        let (omega_NE_E, v_NE_E) = bodies.twist;
        let (quat_NE, quat_NG) = (poses.quat_NE, poses.quat_NG);
        let v_NE = quat_NE.rotate(&v_NE_E);

        let hinges = ([servicer.q[7], servicer.q[8]], [servicer.nu[13], servicer.nu[14]]);
        let (bob, slosh, slosh_rate) = match &model.spherical {
            None => (Bob::at(hinges.0, hinges.1), hinges.0, hinges.1),
            Some(_) => (motion.bob, motion.bob.angles(), [motion.bob.w.y, motion.bob.w.x]),
        };
        let omega_NT = target.omega();
        let v_NT = target.quat_nb.rotate(&target.velocity());
        let v_NG = v_NT + target.quat_nb.rotate(&omega_NT.cross(&model.grasp.p));

        let relative_rate = quat_NE.rotate(&omega_NE_E) - target.quat_nb.rotate(&omega_NT);
        let totals = Totals::with(model, &bodies.momentum, motion, target, grasped);
        let residual = ledger.residual(&totals, motion);
        let [quat_NE, quat_NG] = [(0, quat_NE), (1, quat_NG)].map(|(at, quat)| self.with_continuous_sign(at, quat));
        Truth {
            p_NB_N: servicer.p_nb.into(),
            quat_NB: servicer.quat_nb.to_wxyz(),
            q: std::array::from_fn(|joint| servicer.q[joint]),
            slosh,
            slosh_direction_B: bob.d.into(),
            slosh_swing: libm::atan2(hypot(bob.d.x, bob.d.y), -bob.d.z),
            omega_NB_B: servicer.omega().into(),
            v_NB_B: servicer.velocity().into(),
            qdot: std::array::from_fn(|joint| servicer.nu[6 + joint]),
            slosh_rate,
            wheel_torque_B: forces.wheel_torque.into(),
            thruster_force_B: forces.thruster_force.into(),
            thrust: forces.thrust,
            thruster_torque_B: forces.thruster_torque.into(),
            tau: forces.joint_torque,
            wheel_momentum_B: motion.wheel_momentum.into(),
            p_NE_N: poses.p_NE.into(),
            quat_NE,
            v_NE_N: v_NE.into(),
            omega_NE_E: omega_NE_E.into(),
            p_NT_N: target.p_nb.into(),
            quat_NT: target.quat_nb.to_wxyz(),
            v_NT_N: v_NT.into(),
            omega_NT_T: omega_NT.into(),
            p_NG_N: poses.p_NG.into(),
            quat_NG,
            position_error: poses.distance(),
            attitude_error: poses.angle(),
            relative_speed: (v_NE - v_NG).norm(),
            relative_rate: relative_rate.norm(),
            linear_momentum_N: totals.linear.into(),
            angular_momentum_N: totals.angular.into(),
            energy: totals.energy,
            actuator_work: motion.work,
            damper_loss: motion.loss,
            impact_loss: ledger.impact_loss,
            linear_residual_N: residual.linear.into(),
            angular_residual_N: residual.angular.into(),
            energy_residual: residual.energy,
            grasped,
            padding: [0; 7],
        }
    }

    fn with_continuous_sign(&mut self, at: usize, quat: Quaternion) -> [f64; 4] {
        let mut quat = quat.to_wxyz();
        let along: f64 = quat.iter().zip(&self.last[at]).map(|(new, old)| new * old).sum();
        if along < 0.0 {
            quat = quat.map(|value| -value);
        }
        self.last[at] = quat;
        quat
    }
}

/// The smallest angle of a rotation, rad.
pub fn rotation_angle(q: Quaternion) -> f64 {
    2.0 * libm::atan2(Vector3::new(q.x, q.y, q.z).norm(), q.w.abs())
}

/// The length of `(x, y)`, bit-identical to `libm::hypot`.
///
/// `libm::hypot` takes the square root with a pre-AVX (legacy SSE) instruction, for which the processor saves and restores the upper halves
/// of all registers: hundreds of cycles at every step of a plant. Here the same sum of squares is formed where nothing in it can overflow
/// or underflow, and the compiler generates the square root.
fn hypot(x: f64, y: f64) -> f64 {
    let (x, y) = (x.abs(), y.abs());
    let (large, small) = if x < y { (y, x) } else { (x, y) };
    // NaN is in no range, and takes the fallback
    if !(large < 1e100 && small > 1e-100 && small > 1e-15 * large) {
        return libm::hypot(x, y);
    }
    // a square, and its rounding error
    let square = |x: f64| (x * x, x.mul_add(x, -(x * x)));
    let ((large, large_rest), (small, small_rest)) = (square(large), square(small));
    (small_rest + large_rest + small + large).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hypot_has_the_bits_of_libm() {
        // all directions, and one side decreasing until it is negligible or zero, or NaN
        let mut sides = vec![0.0, f64::MIN_POSITIVE, 1e-310, f64::MAX, f64::INFINITY, f64::NAN];
        let mut side = 1.0_f64;
        while side > 1e-120 {
            sides.extend([side, 1.0 / side, libm::sin(side * 1e3)]);
            side *= 0.713;
        }
        for x in &sides {
            for y in &sides {
                for (x, y) in [(*x, *y), (-x, *y), (*y, -x)] {
                    let (ours, theirs) = (hypot(x, y), libm::hypot(x, y));
                    let same = ours.to_bits() == theirs.to_bits() || (ours.is_nan() && theirs.is_nan());
                    assert!(same, "{x:e} {y:e}: {ours:e} and {theirs:e}");
                }
            }
        }
    }
}
