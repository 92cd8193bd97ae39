//! Stabilisation after the capture: servicer, arm and captured target are brought to rest within all actuator and gripper limits.
//!
//! The paper names this as future work; the law is ours. The model is that of the whole stack, with the target welded to the end effector
//! ([`crate::model::Payload`]). Every rate is commanded to decay at the rate of its group, `ν̇_d = −α Λ ν`, and one factor `α` in [0, 1]
//! scales all of them so that the command `u = α M(−Λ ν) + C ν` and the wrench in the gripper stay within their limits. Both are affine in
//! `α`, so the largest admissible `α` is found in closed form. With equal rates the kinetic energy falls as `dE/dt = −2 α λ E`. A common
//! factor keeps the direction: a limit on one channel slows all channels down instead of changing the direction of the motion.
//!
//! Assumptions and limits: rates are brought to rest, attitude and configuration are not controlled; the stack is assumed rigid except for
//! the joints (the propellant is a disturbance); when the bias force `C ν` alone exceeds a limit no `α` helps, which the output reports.

use crate::allocation::{Allocation, AllocationParameters};
use crate::model::ControlModel;
use crate::{DOF, Dof, Measured, ParameterError, Twist};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// User parameters, except the model of the stack.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameters {
    /// Decay rate of the base's rotation, 1/s.
    pub rotation_1_s: f64,
    /// Decay rate of the base's translation, 1/s. Zero leaves the translation uncontrolled, without thruster force against it.
    pub translation_1_s: f64,
    /// Decay rate of the joint rates, 1/s.
    pub joints_1_s: f64,
    /// Limits of the command: torque on the base (N m), force on the base (N), joint torques (N m); order of the generalised force.
    pub limits: Dof,
    /// Limit of the force in the gripper, N.
    pub gripper_force_n: f64,
    /// Limit of the torque in the gripper, N m.
    pub gripper_torque_nm: f64,
    /// Momentum that the wheels can store, one per body axis, N m s.
    pub wheel_momentum_nms: Vector3<f64>,
    /// Threshold below which an angular rate counts as rest, rad/s.
    pub rest_rate_rad_s: f64,
    /// Threshold below which the base's velocity counts as rest, m/s; ignored if the translation is uncontrolled.
    pub rest_speed_m_s: f64,
    /// Allocation of the base torque to wheels and thrusters; `None` leaves all of it to the wheels.
    pub allocation: Option<AllocationParameters>,
}

/// Inputs of the law at an instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Input {
    /// Simulated time, s.
    pub time_s: f64,
    /// Measured state; `None` before the first one is received: the law then commands nothing.
    pub measured: Option<Measured>,
    /// Momentum stored in the wheels, base axes, N m s.
    pub wheel_momentum: Vector3<f64>,
}

/// Outputs of the law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Output {
    /// Generalised force: `[m_b; f_b; τ]`, N m, N, N m. Within the limits.
    pub force: Dof,
    /// Allocation of the base's part to wheels and thrusters.
    pub allocation: Allocation,
    /// Internal signals of the law.
    pub telemetry: Telemetry,
}

/// Internal signals of the law at an instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Telemetry {
    /// The factor α: 1 while no limit is active.
    pub factor: f64,
    /// The limit that determines the factor.
    pub active_limit: ActiveLimit,
    /// Wrench of the gripper on the target, `[torque; force]` about the end effector's origin in its axes, N m and N.
    pub gripper: Twist,
    /// Kinetic energy of the stack, J.
    pub kinetic_energy_j: f64,
    /// Predicted wheel momentum at rest if the wheels alone absorb the stack's angular momentum: base axes, N m s. The base rotates in the
    /// meantime, so the magnitude is accurate to a few per cent, the direction less.
    pub wheel_momentum_at_rest: Vector3<f64>,
    /// Whether that exceeds what the wheels can store.
    pub wheels_too_small: bool,
    /// Whether everything is at rest.
    pub at_rest: bool,
    /// Time from the first step to the first instant at rest, s; negative before.
    pub time_to_rest_s: f64,
}

/// The active limit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ActiveLimit {
    /// None.
    None,
    /// The limit of a channel of the command: its index in the generalised force.
    Channel(usize),
    /// The torque in the gripper.
    GripperTorque,
    /// The force in the gripper.
    GripperForce,
}

/// Complete state of the law, as plain numbers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// Time of the first step with a measurement, s; negative before.
    pub start_s: f64,
    /// Time from there to the first instant at rest, s; negative before.
    pub time_to_rest_s: f64,
}

/// The stabilisation law.
#[derive(Debug, Clone)]
pub struct StabilisingLaw {
    parameters: Parameters,
    stack: ControlModel,
    servicer: ControlModel,
    state: State,
}

impl StabilisingLaw {
    /// A law for the model of the whole `stack` and of the `servicer` alone; the difference of the two gives the wrench in the gripper.
    ///
    /// # Errors
    ///
    /// Names the parameter that is out of range.
    pub fn new(stack: ControlModel, servicer: ControlModel, parameters: Parameters) -> Result<Self, ParameterError> {
        ParameterError::positive("rotation_1_s", parameters.rotation_1_s)?;
        ParameterError::non_negative("translation_1_s", parameters.translation_1_s)?;
        ParameterError::positive("joints_1_s", parameters.joints_1_s)?;
        for limit in parameters.limits.iter() {
            ParameterError::positive("limits", *limit)?;
        }
        ParameterError::positive("gripper_force_n", parameters.gripper_force_n)?;
        ParameterError::positive("gripper_torque_nm", parameters.gripper_torque_nm)?;
        for limit in parameters.wheel_momentum_nms.iter() {
            ParameterError::non_negative("wheel_momentum_nms", *limit)?;
        }
        ParameterError::positive("rest_rate_rad_s", parameters.rest_rate_rad_s)?;
        ParameterError::positive("rest_speed_m_s", parameters.rest_speed_m_s)?;
        if let Some(allocation) = &parameters.allocation {
            allocation.validate()?;
        }
        Ok(Self {
            parameters,
            stack,
            servicer,
            state: State {
                start_s: -1.0,
                time_to_rest_s: -1.0,
            },
        })
    }

    /// A law that continues from `state`, bit for bit.
    ///
    /// # Errors
    ///
    /// As [`Self::new`].
    pub fn from_state(
        stack: ControlModel,
        servicer: ControlModel,
        parameters: Parameters,
        state: &State,
    ) -> Result<Self, ParameterError> {
        let mut law = Self::new(stack, servicer, parameters)?;
        law.restore(state);
        Ok(law)
    }

    /// Complete state of the law.
    pub fn state(&self) -> State {
        self.state
    }

    /// Continues from `state`, bit for bit.
    pub fn restore(&mut self, state: &State) {
        self.state = *state;
    }

    /// The command at this instant. `None` while there is no measurement.
    pub fn step(&mut self, input: &Input) -> Option<Output> {
        let measured = input.measured.as_ref()?;
        let parameters = &self.parameters;
        let brake = Dof::from_fn(|row, _| {
            let rate = match row {
                0..3 => parameters.rotation_1_s,
                3..6 => parameters.translation_1_s,
                _ => parameters.joints_1_s,
            };
            -rate * measured.velocity[row]
        });
        let (bias, slope) = bias_and_slope(&self.stack, measured, &brake);
        let (servicer_bias, servicer_slope) = bias_and_slope(&self.servicer, measured, &brake);
        let arm = self.stack.end_effector(measured).jacobian;
        let gripper_bias = gripper_wrench(&arm, &(bias - servicer_bias));
        let gripper_slope = gripper_wrench(&arm, &(slope - servicer_slope));

        let (factor, active_limit) = self.largest_factor(&bias, &slope, &gripper_bias, &gripper_slope);
        let force = (bias + slope * factor).zip_map(&parameters.limits, |value, limit| value.clamp(-limit, limit));
        let momentum = self.stack.momentum(measured);
        let at_rest = self.at_rest(&measured.velocity);
        if self.state.start_s < 0.0 {
            self.state.start_s = input.time_s;
        }
        if at_rest && self.state.time_to_rest_s < 0.0 {
            self.state.time_to_rest_s = input.time_s - self.state.start_s;
        }
        let wheel_momentum_at_rest = input.wheel_momentum + momentum.fixed_rows::<3>(0);
        Some(Output {
            force,
            allocation: Allocation::of(parameters.allocation.as_ref(), &force, &input.wheel_momentum),
            telemetry: Telemetry {
                factor,
                active_limit,
                gripper: gripper_bias + gripper_slope * factor,
                kinetic_energy_j: 0.5 * momentum.dot(&measured.velocity),
                wheel_momentum_at_rest,
                wheels_too_small: (0..3)
                    .any(|axis| wheel_momentum_at_rest[axis].abs() > parameters.wheel_momentum_nms[axis]),
                at_rest,
                time_to_rest_s: self.state.time_to_rest_s,
            },
        })
    }

    fn at_rest(&self, velocity: &Dof) -> bool {
        (0..DOF).all(|row| match row {
            3..6 => self.parameters.translation_1_s == 0.0 || velocity[row].abs() < self.parameters.rest_speed_m_s,
            _ => velocity[row].abs() < self.parameters.rest_rate_rad_s,
        })
    }

    /// The largest α in [0, 1] that respects every limit, and the active limit.
    fn largest_factor(
        &self,
        bias: &Dof,
        slope: &Dof,
        gripper_bias: &Twist,
        gripper_slope: &Twist,
    ) -> (f64, ActiveLimit) {
        let Parameters {
            limits,
            gripper_force_n,
            gripper_torque_nm,
            ..
        } = &self.parameters;
        let channels = (0..DOF).map(|row| (linear(bias[row], slope[row], limits[row]), ActiveLimit::Channel(row)));
        let part = |wrench: &Twist, first: usize| wrench.fixed_rows::<3>(first).into_owned();
        let gripper = [
            (0, *gripper_torque_nm, ActiveLimit::GripperTorque),
            (3, *gripper_force_n, ActiveLimit::GripperForce),
        ]
        .map(|(first, limit, by)| {
            (
                quadratic(&part(gripper_bias, first), &part(gripper_slope, first), limit),
                by,
            )
        });
        channels.chain(gripper).fold(
            (1.0, ActiveLimit::None),
            |best, next| if next.0 < best.0 { next } else { best },
        )
    }
}

/// Bias `C ν` and slope `M b` of the force with respect to a factor on the acceleration `b`.
fn bias_and_slope(model: &ControlModel, measured: &Measured, acceleration: &Dof) -> (Dof, Dof) {
    let bias = model.force(measured, &measured.velocity, &Dof::zeros());
    let both = model.force(measured, &measured.velocity, acceleration);
    (bias, both - bias)
}

/// The wrench at the end effector equivalent to a difference in generalised force: its base part is `J_Bᵀ w`, and `J_B` is regular.
fn gripper_wrench(jacobian: &crate::Jacobian, difference: &Dof) -> Twist {
    let base = jacobian.fixed_columns::<6>(0).transpose();
    let base_part: Twist = difference.fixed_rows::<6>(0).into_owned();
    // a rotation and a lever arm: never singular
    base.lu().solve(&base_part).unwrap_or(Twist::repeat(f64::NAN))
}

/// The largest α with `|bias + α slope| ≤ limit`; zero if there is none.
fn linear(bias: f64, slope: f64, limit: f64) -> f64 {
    if slope == 0.0 {
        return f64::INFINITY; // this channel never limits the factor
    }
    ((limit.copysign(slope) - bias) / slope).max(0.0)
}

/// The largest α with `‖bias + α slope‖ ≤ limit`; if there is none, the α that comes closest; never below zero.
fn quadratic(bias: &Vector3<f64>, slope: &Vector3<f64>, limit: f64) -> f64 {
    let (a, b, c) = (
        slope.norm_squared(),
        bias.dot(slope),
        bias.norm_squared() - limit * limit,
    );
    if a == 0.0 {
        return f64::INFINITY;
    }
    (((b * b - a * c).max(0.0).sqrt() - b) / a).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn largest_factor_reaches_the_limit_and_smaller_stay_within(
            bias in proptest::array::uniform3(-1.0..1.0), slope in proptest::array::uniform3(-5.0..5.0), limit in 0.1..3.0f64, part in 0.0..1.0f64,
        ) {
            let (bias, slope) = (Vector3::from(bias), Vector3::from(slope));
            let within = |factor: f64| (bias + slope * factor).norm() <= limit * (1.0 + 1e-9);
            let factor = quadratic(&bias, &slope, limit);
            if bias.norm() < limit {
                prop_assert!(within(factor) && within(factor * part) && !within(factor * 1.001 + 1e-6));
            }
            let factor = linear(bias.x, slope.x, limit);
            if bias.x.abs() < limit {
                prop_assert!((bias.x + slope.x * factor).abs() <= limit * (1.0 + 1e-9));
                prop_assert!((bias.x + slope.x * factor * part).abs() <= limit * (1.0 + 1e-9));
                prop_assert!((bias.x + slope.x * (factor * 1.001 + 1e-6)).abs() > limit);
            }
        }
    }

    #[test]
    fn zero_slope_never_limits_and_exceeding_bias_gives_zero() {
        assert_eq!(linear(0.5, 0.0, 1.0), f64::INFINITY);
        assert_eq!(quadratic(&Vector3::zeros(), &Vector3::zeros(), 1.0), f64::INFINITY);
        assert_eq!(linear(2.0, 1.0, 1.0), 0.0);
        assert_eq!(linear(2.0, -1.0, 1.0), 3.0);
        assert_eq!(quadratic(&Vector3::x(), &Vector3::x(), 0.5), 0.0);
    }
}
