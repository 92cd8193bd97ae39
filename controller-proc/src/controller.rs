//! The controller participant.

use control_laws::Measured as MeasuredState;
use guidance_laws::SetPoint as SetPointState;
use interfaces::{Command, ControlTelemetry, Housekeeping, Measured, SetPoint, ThrusterTorque};
use lockstep::participant::{Failure, Inputs, Interface, Kind, Outputs, ParameterError, Participant, Setup, Step};

use crate::law::{Input, Law};
use crate::parameters::Parameters;
use crate::saved;

/// The input ports, by number.
const MEASURED: usize = 0;
const SETPOINT: usize = 1;
const BASE_SETPOINT: usize = 2;
const HOUSEKEEPING: usize = 3;
/// The output ports, by number.
const COMMAND: usize = 0;
const COUPLES: usize = 1;
const TELEMETRY: usize = 2;

/// The controller.
#[derive(Debug)]
pub struct Controller {
    law: Law,
}

impl Controller {
    /// A controller before its first input.
    ///
    /// # Errors
    /// Names the rejected parameter.
    pub fn new(setup: &Setup, parameters: &Parameters) -> Result<Self, ParameterError> {
        Ok(Self {
            law: Law::new(parameters, setup.period)?,
        })
    }
}

impl Participant for Controller {
    fn interface(&self) -> Interface {
        Interface::new(Kind::Sampled)
            .input::<Measured>("measured")
            .input::<SetPoint>("setpoint")
            .optional_input::<SetPoint>("base_setpoint")
            .optional_input::<Housekeeping>("housekeeping")
            .output::<Command>("command")
            .output::<ThrusterTorque>("couples")
            .output::<ControlTelemetry>("telemetry")
    }

    fn initialise(&mut self, _: f64, _: &mut Outputs) -> Result<(), Failure> {
        Ok(())
    }

    fn step(&mut self, step: &Step, inputs: &Inputs, outputs: &mut Outputs) -> Result<(), Failure> {
        let housekeeping = inputs.get::<Housekeeping>(HOUSEKEEPING);
        let output = self.law.step(&Input {
            t: step.t,
            measured: measured(inputs.get(MEASURED)),
            end_effector: set_point(inputs.get(SETPOINT)),
            base: set_point(inputs.get(BASE_SETPOINT)),
            wheel_momentum: housekeeping.wheel_momentum_B.into(),
            grasped: housekeeping.grasped,
        });
        let Some(output) = output else {
            *outputs.get_mut::<Command>(COMMAND) = Command::default();
            *outputs.get_mut::<ThrusterTorque>(COUPLES) = ThrusterTorque::default();
            *outputs.get_mut::<ControlTelemetry>(TELEMETRY) = ControlTelemetry::default();
            return Ok(());
        };
        *outputs.get_mut::<Command>(COMMAND) = Command {
            torque_B: output.allocation.wheel_torque.into(),
            force_B: output.allocation.thruster_force.into(),
            tau: std::array::from_fn(|joint| output.force[6 + joint]),
        };
        *outputs.get_mut::<ThrusterTorque>(COUPLES) = ThrusterTorque {
            torque_B: output.allocation.thruster_torque.into(),
        };
        *outputs.get_mut::<ControlTelemetry>(TELEMETRY) = output.telemetry;
        Ok(())
    }

    fn save(&self) -> Option<Vec<u8>> {
        saved::save(&self.law)
    }

    fn restore(&mut self, state: &[u8]) -> Result<(), Failure> {
        saved::restore(&mut self.law, state)
    }
}

fn measured(message: &Measured) -> Option<MeasuredState> {
    let mut velocity = [0.0; 13];
    let parts = message.omega_NB_B.iter().chain(&message.v_NB_B).chain(&message.qdot);
    velocity.iter_mut().zip(parts).for_each(|(slot, value)| *slot = *value);
    MeasuredState::from_raw(message.p_NB_N, message.quat_NB, message.q, velocity)
}

fn set_point(message: &SetPoint) -> Option<(SetPointState, f64)> {
    let set_point = SetPointState::from_raw(message.p_ND_N, message.quat_ND, message.v_ND_N, message.omega_ND_D)?;
    Some((set_point, message.stamp))
}
