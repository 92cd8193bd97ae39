//! The servicer's motion as a differential equation, with wheel momentum, impulses, work and losses integrated beside it:
//! with the same stages, so that the books close as well as the integrator is good.

use multibody::{Flow, Rate};
use nalgebra::Vector3;

use super::constraint::hold_joints;
use super::sphere::across;
use super::{Bob, COORDINATES, Forces, Generalised, Model, Motion, VELOCITIES};

/// Rates of a [`Motion`].
#[derive(Debug, Clone, Copy)]
pub struct MotionRate {
    servicer: Rate<COORDINATES, VELOCITIES>,
    bob: Bob,
    wheel_momentum: Vector3<f64>,
    impulse: Vector3<f64>,
    angular_impulse: Vector3<f64>,
    work: f64,
    loss: f64,
}

/// The equation.
#[derive(Debug, Clone, Copy)]
pub struct Mechanics<'a> {
    /// The mechanism.
    pub model: &'a Model,
}

impl Flow for Mechanics<'_> {
    type State = Motion;
    type Rate = MotionRate;
    type Force = Forces;

    #[inline]
    fn rate(&self, motion: &Motion, forces: &Forces) -> MotionRate {
        let servicer = &motion.servicer;
        let omega = servicer.omega();
        let turned = omega.cross(&motion.wheel_momentum);
        let (mut wheel_torque, mut wheel_rate) = (forces.wheel_torque, -forces.wheel_torque);
        for (axis, compensated) in forces.compensated.iter().enumerate() {
            if *compensated {
                wheel_rate[axis] -= turned[axis];
            } else {
                wheel_torque[axis] -= turned[axis];
            }
        }
        let torque = wheel_torque + forces.thruster_torque;
        let mut generalised = Generalised::zeros();
        for axis in 0..3 {
            generalised[axis] = torque[axis];
            generalised[3 + axis] = forces.thruster_force[axis];
        }
        for (joint, torque) in forces.joint_torque.iter().enumerate() {
            generalised[6 + joint] = *torque;
        }
        let braked = forces.braked.contains(&true);
        // a brake does no work: what it holds does not move
        let (rate, bob, damper_power) = match &self.model.sphere {
            None => {
                let tree = &self.model.tree;
                let mut rate = tree.rate(servicer, &generalised);
                if braked {
                    hold_joints(&tree.mass_matrix(&servicer.q), &forces.braked, &mut rate.nu);
                }
                (rate, Bob::NONE, tree.damper_power(&servicer.nu))
            }
            Some(sphere) => {
                let (mut nu, mut w) = sphere.accelerations(servicer, &motion.bob, &generalised);
                if braked {
                    hold_joints(&sphere.mass_matrix(servicer, &motion.bob), &forces.braked, &mut nu);
                    let [first, second] = across(&motion.bob.d);
                    w += first * nu[VELOCITIES - 2] + second * nu[VELOCITIES - 1];
                    (nu[VELOCITIES - 2], nu[VELOCITIES - 1]) = (0.0, 0.0);
                }
                let d = motion.bob.w.cross(&motion.bob.d);
                let power = sphere.tree().damper_power(&sphere.state(servicer, &motion.bob));
                (Rate::of(servicer, nu), Bob { d, w }, power)
            }
        };
        let force_n = servicer.quat_nb.rotate(&forces.thruster_force);
        MotionRate {
            servicer: rate,
            bob,
            wheel_momentum: wheel_rate,
            impulse: force_n,
            angular_impulse: servicer.p_nb.cross(&force_n) + servicer.quat_nb.rotate(&forces.thruster_torque),
            work: generalised.dot(&servicer.nu),
            loss: -damper_power,
        }
    }

    #[inline]
    fn moved(&self, motion: &Motion, by: &[(f64, &MotionRate)]) -> Motion {
        // as many as any method has stages
        let mut servicer: [(f64, &Rate<COORDINATES, VELOCITIES>); 16] = [(0.0, &by[0].1.servicer); 16];
        for (slot, (k, rate)) in servicer.iter_mut().zip(by) {
            *slot = (*k, &rate.servicer);
        }
        let mut out = Motion {
            servicer: self.model.tree.moved(&motion.servicer, &servicer[..by.len()]),
            ..*motion
        };
        for (k, rate) in by {
            if self.model.sphere.is_some() {
                out.bob.d += rate.bob.d * *k;
                out.bob.w += rate.bob.w * *k;
            }
            out.wheel_momentum += rate.wheel_momentum * *k;
            out.impulse += rate.impulse * *k;
            out.angular_impulse += rate.angular_impulse * *k;
            out.work += rate.work * k;
            out.loss += rate.loss * k;
        }
        out
    }

    #[inline]
    fn restored(&self, motion: Motion) -> Motion {
        let mut bob = motion.bob;
        if self.model.sphere.is_some() {
            bob.d = bob.d.normalize();
            bob.w -= bob.d * bob.d.dot(&bob.w);
        }
        Motion {
            servicer: self.model.tree.restored(motion.servicer),
            bob,
            ..motion
        }
    }
}
