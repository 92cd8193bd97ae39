//! A shaft driven by a motor, and a regulator of its angle.

use escapement::lockstep::units::{
    self, Angle, Inertia, Quantity, RotationalDamping, RotationalStiffness, Time, Torque,
};
use escapement::prelude::*;
use serde::Deserialize;

escapement::message! {
    /// The motion of the shaft.
    pub struct Turn {
        /// Angle from zero.
        pub angle: f64 = "rad",
        /// Its rate.
        pub rate: f64 = "rad/s",
    }
}

escapement::message! {
    /// The command of the regulator, and its reference.
    pub struct Drive {
        /// Torque of the motor.
        pub torque: f64 = "N m",
        /// Reference angle of the shaft.
        pub wanted: f64 = "rad",
    }
}

/// The plant: J w' = torque - d w.
struct Shaft {
    parameters: ShaftParameters,
    turn: Turn,
}

/// The table `parameters` of the shaft, with units.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ShaftParameters {
    inertia: Quantity<Inertia>,
    friction: Quantity<RotationalDamping>,
    torque_max: Quantity<Torque>,
}

fn shaft(setup: &Setup) -> Result<Box<dyn Participant>, ParameterError> {
    let parameters = units::read(&setup.parameters)?;
    let turn = Turn { angle: 0.0, rate: 0.0 };
    Ok(Box::new(Shaft { parameters, turn }))
}

impl Participant for Shaft {
    fn interface(&self) -> Interface {
        Interface::new(Kind::Continuous)
            .input::<Drive>("drive")
            .output::<Turn>("turn")
    }

    fn initialise(&mut self, _t: f64, outputs: &mut Outputs) -> Result<(), Failure> {
        *outputs.get_mut(0) = self.turn;
        Ok(())
    }

    fn step(&mut self, step: &Step, inputs: &Inputs, outputs: &mut Outputs) -> Result<(), Failure> {
        let most = self.parameters.torque_max.si();
        let torque = inputs.get::<Drive>(0).torque.clamp(-most, most);
        let acceleration = (torque - self.parameters.friction.si() * self.turn.rate) / self.parameters.inertia.si();
        self.turn.rate += step.period * acceleration;
        self.turn.angle += step.period * self.turn.rate;
        *outputs.get_mut(0) = self.turn;
        Ok(())
    }
}

/// The controller: torque = stiffness (wanted - angle) - damping rate, from the instant `at` on.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Regulator {
    stiffness: Quantity<RotationalStiffness>,
    damping: Quantity<RotationalDamping>,
    step: Quantity<Angle>,
    at: Quantity<Time>,
}

fn regulator(setup: &Setup) -> Result<Box<dyn Participant>, ParameterError> {
    let regulator: Regulator = units::read(&setup.parameters)?;
    Ok(Box::new(regulator))
}

impl Participant for Regulator {
    fn interface(&self) -> Interface {
        Interface::new(Kind::Sampled)
            .input::<Turn>("turn")
            .output::<Drive>("drive")
    }

    fn initialise(&mut self, _t: f64, _outputs: &mut Outputs) -> Result<(), Failure> {
        Ok(())
    }

    fn step(&mut self, step: &Step, inputs: &Inputs, outputs: &mut Outputs) -> Result<(), Failure> {
        let turn = inputs.get::<Turn>(0);
        let wanted = if step.t < self.at.si() { 0.0 } else { self.step.si() };
        *outputs.get_mut(0) = Drive {
            torque: self.stiffness.si() * (wanted - turn.angle) - self.damping.si() * turn.rate,
            wanted,
        };
        Ok(())
    }
}

fn main() -> std::process::ExitCode {
    escapement::Program::new("servo")
        .version(env!("CARGO_PKG_VERSION"))
        .participant("shaft", shaft)
        .participant("regulator", regulator)
        .main()
}
