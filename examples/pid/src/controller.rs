//! A PID controller with a limited force, whose integral is frozen at the limit.

use lockstep::participant::{Failure, Inputs, Interface, Kind, Outputs, ParameterError, Participant, Setup, Step};
use lockstep::units::{self, Force, LinearDamping, LinearStiffness, Quantity, Time};
use serde::Deserialize;

use crate::{Motion, Push, Target};

#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
struct Pid {
    gain: Quantity<LinearStiffness>,
    integral_time: Quantity<Time>,
    damping: Quantity<LinearDamping>,
    limit: Quantity<Force>,
    #[serde(skip)]
    integral: f64,
}

/// Creates a controller whose integral is zero.
pub fn make(setup: &Setup) -> Result<Box<dyn Participant>, ParameterError> {
    let pid: Pid = units::read(&setup.parameters)?;
    if pid.limit.si() < 0.0 {
        return Err(ParameterError::new("limit", "a limit is not negative"));
    }
    Ok(Box::new(pid))
}

impl Participant for Pid {
    fn interface(&self) -> Interface {
        Interface::new(Kind::Sampled)
            .input::<Motion>("measured")
            .input::<Target>("target")
            .output::<Push>("push")
    }

    fn initialise(&mut self, _t: f64, _outputs: &mut Outputs) -> Result<(), Failure> {
        Ok(())
    }

    fn step(&mut self, step: &Step, inputs: &Inputs, outputs: &mut Outputs) -> Result<(), Failure> {
        let (measured, target) = (inputs.get::<Motion>(0), inputs.get::<Target>(1));
        let error = target.position - measured.position;
        let wanted =
            self.gain.si() * (error + self.integral / self.integral_time.si()) - self.damping.si() * measured.velocity;
        let force = wanted.clamp(-self.limit.si(), self.limit.si());
        if force == wanted {
            self.integral += step.period * error;
        }
        *outputs.get_mut(0) = Push { force };
        Ok(())
    }

    fn save(&self) -> Option<Vec<u8>> {
        Some(self.integral.to_le_bytes().to_vec())
    }

    fn restore(&mut self, state: &[u8]) -> Result<(), Failure> {
        self.integral = f64::from_le_bytes(state.try_into()?);
        Ok(())
    }
}
