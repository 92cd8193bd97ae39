//! Conservation ledger: total momentum and energy, and their residuals.

use multibody::{Kinematics, Momentum};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::{COORDINATES, Model, Motion, Target, VELOCITIES};

/// Momentum and energy of servicer, wheels and target at an instant.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Totals {
    /// Linear momentum, world axes, kg m/s.
    pub linear: Vector3<f64>,
    /// Angular momentum about the world's origin, world axes, N m s.
    pub angular: Vector3<f64>,
    /// Kinetic and spring energy, without the wheels' spin, J.
    pub energy: f64,
}

/// Totals at the start, and the losses since then that occurred outside the integrator's steps.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Ledger {
    /// Totals at the first instant.
    pub start: Totals,
    /// Energy lost in impacts so far, J.
    pub impact_loss: f64,
}

impl Totals {
    /// Totals of servicer, wheels and target; a `carried` target is already part of the servicer.
    pub fn of(model: &Model, motion: &Motion, target: &Target, carried: bool) -> Self {
        let own = Self::own(model, &model.kinematics(&motion.servicer), motion);
        Self::with(model, &own, motion, target, carried)
    }

    /// Momentum and kinetic energy of the servicer; `kinematics` are those of its tree.
    pub fn own(model: &Model, kinematics: &Kinematics<COORDINATES, VELOCITIES>, motion: &Motion) -> (Momentum, f64) {
        match &model.spherical {
            None => model.tree.momentum_and_energy(kinematics),
            Some(spherical) => spherical
                .tree()
                .momentum_and_energy(&spherical.state(&motion.servicer, &motion.bob)),
        }
    }

    /// The totals, given the result of [`Totals::own`].
    pub fn with(
        model: &Model,
        (momentum, own_energy): &(Momentum, f64),
        motion: &Motion,
        target: &Target,
        carried: bool,
    ) -> Self {
        let servicer = &motion.servicer;
        let own_energy = own_energy
            + match &model.spherical {
                None => model.tree.potential_energy(servicer),
                Some(spherical) => spherical
                    .tree()
                    .potential_energy(&spherical.state(servicer, &motion.bob)),
            };
        let to_world = |vector: &Vector3<f64>| servicer.quat_nb.rotate(vector);
        let centre = servicer.p_nb + to_world(&momentum.p_bc);
        let mut linear = to_world(&momentum.linear_b);
        let mut angular = centre.cross(&linear) + to_world(&(momentum.angular_b + motion.wheel_momentum));
        let mut energy = own_energy;
        if !carried {
            let (omega, v) = (target.omega(), target.velocity());
            let (mass, inertia) = (model.target_inertia.mass, model.target_inertia.about_com);
            let p = target.quat_nb.rotate(&(v * mass));
            linear += p;
            angular += target.p_nb.cross(&p) + target.quat_nb.rotate(&(inertia * omega));
            energy += 0.5 * omega.dot(&(inertia * omega)) + 0.5 * mass * v.norm_squared();
        }
        Self {
            linear,
            angular,
            energy,
        }
    }
}

impl Ledger {
    /// The ledger of a plant that continues with other masses: momentum and energy were `before` and are `after`. What the change adds
    /// is no residual, so it belongs to the start.
    #[must_use]
    pub fn after_change(mut self, before: &Totals, after: &Totals) -> Self {
        // without a change no bit of the ledger changes
        if before != after {
            self.start.linear += after.linear - before.linear;
            self.start.angular += after.angular - before.angular;
            self.start.energy += after.energy - before.energy;
        }
        self
    }

    /// Residuals of `now`: momentum less impulse, angular momentum less angular impulse, energy less work plus losses.
    pub fn residual(&self, now: &Totals, motion: &Motion) -> Totals {
        Totals {
            linear: now.linear - self.start.linear - motion.impulse,
            angular: now.angular - self.start.angular - motion.angular_impulse,
            energy: now.energy - self.start.energy - motion.work + motion.loss + self.impact_loss,
        }
    }
}
