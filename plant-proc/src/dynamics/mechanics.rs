//! The servicer's equations of motion, augmented with wheel momentum, impulses, work and losses: these are integrated with
//! the same stages, so the ledger closes to the accuracy of the integrator.

use multibody::rotation::cross;
use multibody::{Number, OdeSystem, Rate};
use nalgebra::{SVector, Vector3};

use super::constraint::hold_joints;
use super::spherical_pendulum::perpendicular_directions;
use super::{Bob, COORDINATES, Forces, Model, Motion, VELOCITIES};

/// Rates of a [`Motion`].
#[derive(Debug, Clone, Copy)]
pub struct MotionRate<T = f64> {
    servicer: Rate<COORDINATES, VELOCITIES, T>,
    bob: Bob<T>,
    wheel_momentum: Vector3<T>,
    impulse: Vector3<T>,
    angular_impulse: Vector3<T>,
    work: T,
    loss: T,
}

/// The equations of motion.
#[derive(Debug, Clone, Copy)]
pub struct Mechanics<'a> {
    /// The mechanism.
    pub model: &'a Model,
}

/// Forces at one state of the servicer.
pub(super) struct AppliedForces<T> {
    /// Generalised force on the servicer.
    pub(super) generalised: SVector<T, VELOCITIES>,
    /// Rate of the wheels' momentum.
    wheel_rate: Vector3<T>,
}

impl<T: Number> AppliedForces<T> {
    /// The actuators' forces, with the gyroscopic torque of the wheels on the uncompensated axes.
    #[inline(always)]
    pub(super) fn of(motion: &Motion<T>, forces: &Forces<T>) -> Self {
        let gyroscopic_torque = cross(&motion.servicer.omega(), &motion.wheel_momentum);
        let (mut wheel_torque, mut wheel_rate) = (forces.wheel_torque, -forces.wheel_torque);
        for (axis, compensated) in forces.compensated.iter().enumerate() {
            if *compensated {
                wheel_rate[axis] -= gyroscopic_torque[axis];
            } else {
                wheel_torque[axis] -= gyroscopic_torque[axis];
            }
        }
        let torque = wheel_torque + forces.thruster_torque;
        let mut generalised = SVector::<T, VELOCITIES>::zeros();
        for axis in 0..3 {
            generalised[axis] = torque[axis];
            generalised[3 + axis] = forces.thruster_force[axis];
        }
        for (joint, torque) in forces.joint_torque.iter().enumerate() {
            generalised[6 + joint] = *torque;
        }
        Self {
            generalised,
            wheel_rate,
        }
    }

    /// All rates, given the servicer's acceleration, the rate of the bob and the power of the dampers.
    #[inline(always)]
    pub(super) fn rates(
        &self,
        motion: &Motion<T>,
        forces: &Forces<T>,
        (nu_dot, bob, damper_power): (SVector<T, VELOCITIES>, Bob<T>, T),
    ) -> MotionRate<T> {
        let now = &motion.servicer;
        let force_n = now.quat_nb.rotate(&forces.thruster_force);
        MotionRate {
            servicer: Rate::of(now, nu_dot),
            bob,
            wheel_momentum: self.wheel_rate,
            impulse: force_n,
            angular_impulse: cross(&now.p_nb, &force_n) + now.quat_nb.rotate(&forces.thruster_torque),
            work: self.generalised.dot(&now.nu),
            loss: -damper_power,
        }
    }
}

impl<T: Number> Motion<T> {
    /// `self + Σ kᵢ rateᵢ`; the bob moves where the pendulum is spherical.
    #[inline(always)]
    pub(super) fn plus_rates(&self, by: &[(f64, &MotionRate<T>)], spherical: bool) -> Self {
        let mut out = *self;
        for (k, rate) in by {
            out.servicer.add_rate(*k, &rate.servicer);
            let k = T::of(*k);
            if spherical {
                out.bob.d += rate.bob.d * k;
                out.bob.w += rate.bob.w * k;
            }
            out.wheel_momentum += rate.wheel_momentum * k;
            out.impulse += rate.impulse * k;
            out.angular_impulse += rate.angular_impulse * k;
            out.work += rate.work * k;
            out.loss += rate.loss * k;
        }
        out
    }
}

impl OdeSystem for Mechanics<'_> {
    type State = Motion;
    type Rate = MotionRate;
    type Force = Forces;

    #[inline]
    fn rate(&self, motion: &Motion, forces: &Forces) -> MotionRate {
        let servicer = &motion.servicer;
        let applied = AppliedForces::of(motion, forces);
        let generalised = &applied.generalised;
        let braked = forces.braked.contains(&true);
        // a brake does no work: the braked joint does not move
        let rates = match &self.model.spherical {
            None => {
                let tree = &self.model.tree;
                let mut nu = tree.forward_dynamics(servicer, generalised);
                if braked {
                    hold_joints(&tree.mass_matrix(&servicer.q), &forces.braked, &mut nu);
                }
                (nu, Bob::NONE, tree.damper_power(&servicer.nu))
            }
            Some(spherical) => {
                let (mut nu, mut w) = spherical.accelerations(servicer, &motion.bob, generalised);
                if braked {
                    hold_joints(&spherical.mass_matrix(servicer, &motion.bob), &forces.braked, &mut nu);
                    let [first, second] = perpendicular_directions(&motion.bob.d);
                    w += first * nu[VELOCITIES - 2] + second * nu[VELOCITIES - 1];
                    (nu[VELOCITIES - 2], nu[VELOCITIES - 1]) = (0.0, 0.0);
                }
                let d = motion.bob.w.cross(&motion.bob.d);
                let power = spherical.tree().damper_power(&spherical.state(servicer, &motion.bob));
                (nu, Bob { d, w }, power)
            }
        };
        applied.rates(motion, forces, rates)
    }

    #[inline]
    fn plus_rates(&self, motion: &Motion, by: &[(f64, &MotionRate)]) -> Motion {
        motion.plus_rates(by, self.model.spherical.is_some())
    }

    #[inline]
    fn projected(&self, motion: Motion) -> Motion {
        let mut bob = motion.bob;
        if self.model.spherical.is_some() {
            bob.d = bob.d.normalize();
            bob.w -= bob.d * bob.d.dot(&bob.w);
        }
        Motion {
            servicer: motion.servicer.projected(),
            bob,
            ..motion
        }
    }
}
