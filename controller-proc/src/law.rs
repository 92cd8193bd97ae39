//! Common interface of the control laws.

use control_laws::allocation::Allocation;
use control_laws::stabilise::{self, StabilisingLaw};
use control_laws::{ComparisonLaw, Dof, HierarchicalLaw, Measured, comparison, hierarchical};
use guidance_laws::SetPoint;
use interfaces::{ControlMode, ControlTelemetry};
use lockstep::participant::ParameterError;
use nalgebra::Vector3;

use crate::parameters::{LawName, Parameters, build_control_model, payload, scenario_error};

/// Inputs of a law.
#[derive(Debug, Clone, Copy)]
pub struct Input {
    /// Current simulated time, s.
    pub t: f64,
    /// The servicer.
    pub measured: Option<Measured>,
    /// The end effector's set-point, and the instant it is for, s.
    pub end_effector: Option<(SetPoint, f64)>,
    /// The base's set-point, and the instant it is for, s.
    pub base: Option<(SetPoint, f64)>,
    /// Momentum stored in the wheels, base axes, N m s.
    pub wheel_momentum: Vector3<f64>,
    /// Whether the gripper has closed on the target.
    pub grasped: bool,
}

/// Outputs of a law.
#[derive(Debug, Clone, Copy)]
pub struct LawOutput {
    /// Generalised force.
    pub force: Dof,
    /// Allocation of the base's part to wheels and thrusters.
    pub allocation: Allocation,
    /// Internal signals of the law.
    pub telemetry: ControlTelemetry,
}

/// The law of the approach.
#[derive(Debug, Clone)]
pub enum Approach {
    /// The law of the paper.
    Hierarchical(Box<HierarchicalLaw>),
    /// The comparison law.
    Comparison(Box<ComparisonLaw>),
}

/// The law of the approach, and the law after the grasp.
#[derive(Debug, Clone)]
pub struct Law {
    /// Active until the grasp, or for the whole run.
    pub approach: Approach,
    /// Active from the grasp on, if configured.
    pub stabilise: Option<Box<StabilisingLaw>>,
}

impl Law {
    /// The laws selected by the scenario.
    ///
    /// # Errors
    /// Names the rejected parameter.
    pub fn new(parameters: &Parameters, period: f64) -> Result<Self, ParameterError> {
        let model = |payload| build_control_model(&parameters.urdf, &parameters.servicer, &parameters.model, payload);
        let approach = match parameters.law {
            LawName::Hierarchical => HierarchicalLaw::new(model(None)?, parameters.hierarchical(period)?)
                .map(|law| Approach::Hierarchical(Box::new(law))),
            LawName::Reference => ComparisonLaw::new(model(None)?, parameters.comparison(period)?)
                .map(|law| Approach::Comparison(Box::new(law))),
        }
        .map_err(|error| scenario_error(&error))?;
        let stabilise = match (&parameters.stabilise, &parameters.target) {
            (None, _) => None,
            (Some(_), None) => {
                let reason = "stabilisation needs to know what the end effector carries: give the target's file";
                return Err(ParameterError::new("target", reason));
            }
            (Some(stabilise), Some(target)) => {
                target.validate()?;
                let law = stabilise.law_parameters(parameters.allocation.as_ref());
                let law = StabilisingLaw::new(model(Some(payload(target)))?, model(None)?, law).map_err(|error| {
                    let inner = scenario_error(&error);
                    ParameterError::new(format!("stabilise.{}", inner.key), inner.reason)
                })?;
                Some(Box::new(law))
            }
        };
        Ok(Self { approach, stabilise })
    }

    /// The command at this instant; `None` while there is no measurement.
    pub fn step(&mut self, input: &Input) -> Option<LawOutput> {
        if let (Some(law), true) = (&mut self.stabilise, input.grasped) {
            return stabilised(law, input);
        }
        match &mut self.approach {
            Approach::Hierarchical(law) => hierarchical(law, input),
            Approach::Comparison(law) => comparison(law, input),
        }
    }
}

/// Age of a set-point; zero while there is none.
fn age(t: f64, set_point: Option<(SetPoint, f64)>) -> f64 {
    set_point.map_or(0.0, |(_, stamp)| t - stamp)
}

fn hierarchical(law: &mut HierarchicalLaw, input: &Input) -> Option<LawOutput> {
    let output = law.step(&hierarchical::Input {
        measured: input.measured,
        set_point: input.end_effector.map(|(set_point, _)| set_point),
        set_point_age_s: age(input.t, input.end_effector),
        wheel_momentum: input.wheel_momentum,
    })?;
    let signals = &output.telemetry;
    let mut telemetry = ControlTelemetry {
        mode: mode(signals.tracking),
        p_DE_N: signals.position_error.into(),
        quat_DE: signals.attitude_error.quaternion,
        h: signals.attitude_error.h,
        epsilon: signals.epsilon,
        epsilon_clamped: signals.epsilon_clamped,
        feedback_saturated: count(&signals.saturated),
        missing_torque_B: output.allocation.missing_torque.into(),
        ..ControlTelemetry::default()
    };
    velocities(&mut telemetry, &signals.virtual_velocity, &signals.feedback);
    Some(LawOutput {
        force: output.force,
        allocation: output.allocation,
        telemetry,
    })
}

fn comparison(law: &mut ComparisonLaw, input: &Input) -> Option<LawOutput> {
    let output = law.step(&comparison::Input {
        measured: input.measured,
        end_effector: input.end_effector.map(|(set_point, _)| set_point),
        base: input.base.map(|(set_point, _)| set_point),
        set_point_age_s: age(input.t, input.end_effector),
        wheel_momentum: input.wheel_momentum,
    })?;
    let signals = &output.telemetry;
    let mut telemetry = ControlTelemetry {
        mode: mode(input.end_effector.is_some()),
        p_DE_N: signals.position_error.into(),
        quat_DE: signals.attitude_error.quaternion,
        h: signals.attitude_error.h,
        feedback_saturated: count(&signals.saturated),
        missing_torque_B: output.allocation.missing_torque.into(),
        ..ControlTelemetry::default()
    };
    velocities(&mut telemetry, &signals.virtual_velocity, &signals.feedback);
    Some(LawOutput {
        force: output.force,
        allocation: output.allocation,
        telemetry,
    })
}

fn stabilised(law: &mut StabilisingLaw, input: &Input) -> Option<LawOutput> {
    let output = law.step(&stabilise::Input {
        time_s: input.t,
        measured: input.measured,
        wheel_momentum: input.wheel_momentum,
    })?;
    let signals = &output.telemetry;
    Some(LawOutput {
        force: output.force,
        allocation: output.allocation,
        telemetry: ControlTelemetry {
            mode: ControlMode::Stabilising,
            quat_DE: [1.0, 0.0, 0.0, 0.0],
            h: 1.0,
            missing_torque_B: output.allocation.missing_torque.into(),
            stabilise_factor: signals.factor,
            gripper_torque_E: [signals.gripper[0], signals.gripper[1], signals.gripper[2]],
            gripper_force_E: [signals.gripper[3], signals.gripper[4], signals.gripper[5]],
            at_rest: signals.at_rest,
            time_to_rest: signals.time_to_rest_s,
            ..ControlTelemetry::default()
        },
    })
}

fn velocities(telemetry: &mut ControlTelemetry, virtual_velocity: &Dof, feedback: &Dof) {
    let three = |vector: &Dof, at: usize| [vector[at], vector[at + 1], vector[at + 2]];
    telemetry.omega_v_B = three(virtual_velocity, 0);
    telemetry.v_v_B = three(virtual_velocity, 3);
    telemetry.qdot_v = std::array::from_fn(|joint| virtual_velocity[6 + joint]);
    telemetry.feedback_torque_B = three(feedback, 0);
    telemetry.feedback_force_B = three(feedback, 3);
    telemetry.feedback_tau = std::array::from_fn(|joint| feedback[6 + joint]);
}

fn mode(tracking: bool) -> ControlMode {
    match tracking {
        true => ControlMode::Tracking,
        false => ControlMode::Waiting,
    }
}

fn count(flags: &[bool]) -> u8 {
    flags.iter().map(|value| u8::from(*value)).sum()
}
