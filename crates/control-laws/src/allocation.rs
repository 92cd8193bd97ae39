//! Actuator allocation of the base torque: reaction wheels, and thruster couples.
//!
//! Beyond the paper, off by default. Twelve thrusters form four-packs, one pack per axis: two push each way, on lever arms that turn
//! the base about the next axis but one (thrusters along y turn about x, along z about y, along x about z). So a pack gives a force `f`
//! and a torque `m` at once as long as `|f| + |m| / arm ≤ F`. Wheel and thruster torques that cancel span the null space of the base's
//! torque: along it the thrusters unload stored momentum from the wheels without a net torque on the base.

use crate::{Dof, ParameterError};
use nalgebra::Vector3;

/// User parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AllocationParameters {
    /// Torque limit of the wheels, one per body axis, N m.
    pub wheel_torque_nm: Vector3<f64>,
    /// Momentum limit of the wheels, N m s.
    pub wheel_momentum_nms: Vector3<f64>,
    /// Force limit of the thrusters along each body axis, N (two thrusters at full thrust).
    pub thruster_force_n: Vector3<f64>,
    /// Lever arm of the couples about each body axis, m. Zero: no couple about that axis.
    pub lever_arm_m: Vector3<f64>,
    /// Rate at which stored momentum above the threshold is unloaded, 1/s. Zero: thrusters only support saturated wheels.
    pub unload_rate_1_s: f64,
    /// Threshold of stored momentum below which nothing is unloaded, N m s.
    pub unload_above_nms: f64,
}

/// Result of the allocation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Allocation {
    /// Torque of the wheels on the base, base axes, N m.
    pub wheel_torque: Vector3<f64>,
    /// Torque of the thruster couples on the base, base axes, N m.
    pub thruster_torque: Vector3<f64>,
    /// Force of the thrusters on the base, base axes, N.
    pub thruster_force: Vector3<f64>,
    /// Thrust of each thruster, N, none negative: for each axis the two that push along it, then the two that push against it.
    pub thrust: [f64; 12],
    /// Commanded torque that no actuator can provide, N m.
    pub missing_torque: Vector3<f64>,
    /// Commanded force that no actuator can provide, N.
    pub missing_force: Vector3<f64>,
}

impl Allocation {
    /// Allocates the base's part of a generalised force by `parameters`, or directly if there are none.
    pub fn of(parameters: Option<&AllocationParameters>, force: &Dof, wheel_momentum: &Vector3<f64>) -> Self {
        let torque = Vector3::new(force[0], force[1], force[2]);
        let force = Vector3::new(force[3], force[4], force[5]);
        match parameters {
            None => Self::direct(&torque, &force),
            Some(parameters) => parameters.allocate(&torque, &force, wheel_momentum),
        }
    }

    /// Allocation of the paper: all torque from the wheels, all force from the thrusters, limits left to the actuators.
    pub fn direct(torque: &Vector3<f64>, force: &Vector3<f64>) -> Self {
        Self {
            wheel_torque: *torque,
            thruster_torque: Vector3::zeros(),
            thruster_force: *force,
            thrust: thrust(force, &Vector3::zeros(), &Vector3::zeros()),
            missing_torque: Vector3::zeros(),
            missing_force: Vector3::zeros(),
        }
    }
}

/// The axis along which the thrusters push that turn about `axis`.
const fn thrust_axis(axis: usize) -> usize {
    (axis + 1) % 3
}

/// Thrust of each thruster for forces along, and torques about, the axes.
fn thrust(force: &Vector3<f64>, torque: &Vector3<f64>, lever_arm: &Vector3<f64>) -> [f64; 12] {
    let mut thrust = [0.0; 12];
    for turn in 0..3 {
        let push = thrust_axis(turn);
        let couple = if lever_arm[turn] > 0.0 {
            torque[turn] / lever_arm[turn]
        } else {
            0.0
        };
        let (first, second) = (0.5 * (force[push] + couple), 0.5 * (force[push] - couple));
        thrust[4 * push] = first.max(0.0);
        thrust[4 * push + 1] = second.max(0.0);
        thrust[4 * push + 2] = (-first).max(0.0);
        thrust[4 * push + 3] = (-second).max(0.0);
    }
    thrust
}

impl AllocationParameters {
    pub(crate) fn validate(&self) -> Result<(), ParameterError> {
        for axis in 0..3 {
            ParameterError::non_negative("allocation.wheel_torque_nm", self.wheel_torque_nm[axis])?;
            ParameterError::non_negative("allocation.wheel_momentum_nms", self.wheel_momentum_nms[axis])?;
            ParameterError::non_negative("allocation.thruster_force_n", self.thruster_force_n[axis])?;
            ParameterError::non_negative("allocation.lever_arm_m", self.lever_arm_m[axis])?;
        }
        ParameterError::non_negative("allocation.unload_rate_1_s", self.unload_rate_1_s)?;
        ParameterError::non_negative("allocation.unload_above_nms", self.unload_above_nms)?;
        Ok(())
    }

    /// Allocates `torque` (N m) and `force` (N) on the base, with `momentum` (N m s) stored in the wheels; all in base axes. On the
    /// thrusters, force has priority over torque.
    pub fn allocate(&self, torque: &Vector3<f64>, force: &Vector3<f64>, momentum: &Vector3<f64>) -> Allocation {
        let thruster_force = force.zip_map(&self.thruster_force_n, |value, limit| value.clamp(-limit, limit));
        let mut wheel_torque = Vector3::zeros();
        let mut thruster_torque = Vector3::zeros();
        for axis in 0..3 {
            let push = thrust_axis(axis);
            let spare = (self.thruster_force_n[push] - thruster_force[push].abs()) * self.lever_arm_m[axis];
            let (most_negative, most_positive) = self.wheel_range(axis, momentum[axis]);
            // the reaction of a torque on the base changes the wheel's momentum: dh/dt = −torque
            let unloading = self.unload_rate_1_s
                * (momentum[axis].abs() - self.unload_above_nms)
                    .max(0.0)
                    .copysign(momentum[axis]);
            let wheel = (torque[axis] + unloading).clamp(most_negative, most_positive);
            let thruster = (torque[axis] - wheel).clamp(-spare, spare);
            // the wheels provide the part that the thrusters cannot
            wheel_torque[axis] = (torque[axis] - thruster).clamp(most_negative, most_positive);
            thruster_torque[axis] = thruster;
        }
        Allocation {
            wheel_torque,
            thruster_torque,
            thruster_force,
            thrust: thrust(&thruster_force, &thruster_torque, &self.lever_arm_m),
            missing_torque: torque - wheel_torque - thruster_torque,
            missing_force: force - thruster_force,
        }
    }

    /// Range of torques that a wheel can give: none that increases its momentum once it is saturated.
    fn wheel_range(&self, axis: usize, momentum: f64) -> (f64, f64) {
        let (torque, full) = (self.wheel_torque_nm[axis], self.wheel_momentum_nms[axis]);
        let most_positive = if momentum <= -full { 0.0 } else { torque };
        let most_negative = if momentum >= full { 0.0 } else { -torque };
        (most_negative, most_positive)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn parameters() -> AllocationParameters {
        AllocationParameters {
            wheel_torque_nm: Vector3::repeat(0.2),
            wheel_momentum_nms: Vector3::repeat(12.0),
            thruster_force_n: Vector3::repeat(9.0),
            lever_arm_m: Vector3::new(0.45, 0.5, 0.55),
            unload_rate_1_s: 0.01,
            unload_above_nms: 6.0,
        }
    }

    fn vector(size: f64) -> impl Strategy<Value = Vector3<f64>> {
        proptest::array::uniform3(-size..size).prop_map(Vector3::from)
    }

    /// Force and torque of the thrusters from their positions and directions: independent of how thrust was computed.
    fn wrench(thrust: &[f64; 12], lever_arm: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
        let (mut force, mut torque) = (Vector3::zeros(), Vector3::zeros());
        for push in 0..3 {
            let turn = (push + 2) % 3;
            let offset = Vector3::ith((turn + 2) % 3, lever_arm[turn]);
            let direction = Vector3::ith(push, 1.0);
            // the first of each two is placed where it gives a positive torque
            let side = offset.cross(&direction)[turn].signum();
            for (index, (along, forwards)) in [(1.0, 1.0), (1.0, -1.0), (-1.0, -1.0), (-1.0, 1.0)]
                .into_iter()
                .enumerate()
            {
                let f = direction * (along * thrust[4 * push + index]);
                let at = offset * (side * along * forwards);
                force += f;
                torque += at.cross(&f);
            }
        }
        (force, torque)
    }

    proptest! {
        #[test]
        fn allocation_is_complete_and_respects_every_limit(
            torque in vector(6.0), force in vector(12.0), momentum in vector(14.0),
        ) {
            let parameters = parameters();
            let allocated = parameters.allocate(&torque, &force, &momentum);
            prop_assert!((allocated.wheel_torque + allocated.thruster_torque + allocated.missing_torque - torque).amax() < 1e-14);
            prop_assert!((allocated.thruster_force + allocated.missing_force - force).amax() < 1e-14);
            for axis in 0..3 {
                prop_assert!(allocated.wheel_torque[axis].abs() <= 0.2);
                if momentum[axis].abs() >= 12.0 {
                    prop_assert!(allocated.wheel_torque[axis] * momentum[axis] >= 0.0, "a full wheel is not filled further");
                }
            }
            for thrust in allocated.thrust {
                prop_assert!((0.0..=4.5 + 1e-12).contains(&thrust));
            }
            let (total_force, total_torque) = wrench(&allocated.thrust, &parameters.lever_arm_m);
            prop_assert!((total_force - allocated.thruster_force).amax() < 1e-12);
            prop_assert!((total_torque - allocated.thruster_torque).amax() < 1e-12);
        }

        #[test]
        fn unloading_the_wheels_gives_no_net_torque(torque in vector(0.15), momentum in vector(11.0)) {
            let allocated = parameters().allocate(&torque, &Vector3::zeros(), &momentum);
            prop_assert!(allocated.missing_torque.amax() < 1e-15);
            prop_assert!((allocated.wheel_torque + allocated.thruster_torque - torque).amax() < 1e-15);
            for axis in 0..3 {
                let unloading = allocated.wheel_torque[axis] - torque[axis];
                prop_assert!(unloading * momentum[axis] >= 0.0);
                prop_assert_eq!(unloading.abs() > 1e-15, momentum[axis].abs() > 6.0 + 1e-13);
            }
        }
    }

    #[test]
    fn thrusters_support_saturated_wheels_within_spare_force() {
        let torque = Vector3::new(1.0, 0.0, 0.0);
        let free = parameters().allocate(&torque, &Vector3::zeros(), &Vector3::zeros());
        assert!((free.wheel_torque.x - 0.2).abs() < 1e-15 && (free.thruster_torque.x - 0.8).abs() < 1e-15);
        let busy = parameters().allocate(&torque, &Vector3::new(0.0, -8.0, 0.0), &Vector3::zeros());
        assert!((busy.thruster_torque.x - 0.45).abs() < 1e-15);
        assert!((busy.missing_torque.x - 0.35).abs() < 1e-15);
    }

    #[test]
    fn direct_allocation_equals_the_command() {
        let (torque, force) = (Vector3::new(1.0, -2.0, 3.0), Vector3::new(-20.0, 5.0, 0.1));
        let direct = Allocation::direct(&torque, &force);
        assert_eq!((direct.wheel_torque, direct.thruster_force), (torque, force));
        assert_eq!(wrench(&direct.thrust, &Vector3::zeros()).0, force);
    }

    #[test]
    fn a_negative_limit_is_refused_with_the_field() {
        let mut parameters = parameters();
        parameters.lever_arm_m.y = -0.1;
        assert_eq!(parameters.validate().unwrap_err().field, "allocation.lever_arm_m");
    }
}
