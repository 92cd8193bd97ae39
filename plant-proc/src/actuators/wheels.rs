//! Reaction wheels: momentum exchange between base and rotors.

use lockstep::participant::ParameterError;
use lockstep::units::{AngularMomentum, Torque};
use nalgebra::Vector3;

use super::{Channel, ChannelParameters, ChannelState, Effect, WheelParameters, not_negative};

/// State of the wheels except their momentum, which is part of the motion.
pub type WheelsState = [ChannelState; 3];

/// One wheel per body axis.
#[derive(Debug, Clone)]
pub struct Wheels {
    channels: [Channel; 3],
    momentum: [f64; 3],
    motor_torque: [f64; 3],
    gyroscopic: bool,
    period: f64,
}

/// Wheel torques over a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WheelTorque {
    /// On `compensated` axes: torque on the base, N m. On the others: torque of the motor; the base receives it less the gyroscopic torque
    /// `ω × h`.
    pub torque: Vector3<f64>,
    /// Axes on which the wheel control adds the gyroscopic torque to the motor torque, so that none of it acts on the base.
    pub compensated: [bool; 3],
}

impl Wheels {
    /// Wheels at rest.
    ///
    /// # Errors
    /// Names the parameter that is out of range.
    pub fn new(parameters: &WheelParameters, period: f64) -> Result<Self, ParameterError> {
        let group = "actuators.wheels";
        let channel_parameters = ChannelParameters::new(
            group,
            parameters.lag,
            parameters.dead_zone.si(),
            parameters.quantum.si(),
            period,
        )?;
        for axis in 0..3 {
            let of = [" about x", " about y", " about z"][axis];
            not_negative::<Torque>("actuators.wheels.torque", of, parameters.torque.si()[axis])?;
            if let Some(motor) = &parameters.motor_torque {
                not_negative::<Torque>("actuators.wheels.motor_torque", of, motor.si()[axis])?;
            }
            let momentum_limit =
                not_negative::<AngularMomentum>("actuators.wheels.momentum", of, parameters.momentum.si()[axis])?;
            let start = parameters.start_momentum.si()[axis];
            if start.abs() > momentum_limit {
                let reason = format!("{start} N m s{of} is more than the wheel can store ({momentum_limit} N m s)");
                return Err(ParameterError::new("actuators.wheels.start_momentum", reason));
            }
        }
        Ok(Self {
            channels: parameters
                .torque
                .si()
                .map(|limit| Channel::new(channel_parameters, limit)),
            momentum: parameters.momentum.si(),
            motor_torque: parameters
                .motor_torque
                .as_ref()
                .map_or([f64::INFINITY; 3], |motor| motor.si()),
            gyroscopic: parameters.gyroscopic,
            period,
        })
    }

    pub fn state(&self) -> WheelsState {
        self.channels.each_ref().map(Channel::state)
    }

    pub fn restore(&mut self, state: &WheelsState) {
        for (channel, state) in self.channels.iter_mut().zip(state) {
            channel.restore(state);
        }
    }

    /// Wheel torques with `momentum` stored, N m s, and `gyroscopic_torque` = ω × h on the base, N m.
    ///
    /// All motor torque changes the wheel's momentum, whatever the torque is for. The motor torque is limited by what its wheel can store
    /// over the step and, if given, by the motor's own limit; then it cannot compensate all of the gyroscopic torque, and the rest acts on
    /// the base. A wheel that is stuck or off compensates nothing; a weak one is weak in its command alone.
    pub fn apply(
        &mut self,
        command: &[f64; 3],
        momentum: &Vector3<f64>,
        gyroscopic_torque: &Vector3<f64>,
        effect: impl Fn(usize) -> Option<Effect>,
    ) -> WheelTorque {
        let mut out = WheelTorque {
            torque: Vector3::zeros(),
            compensated: [false; 3],
        };
        for (axis, &command) in command.iter().enumerate() {
            // a positive torque on the base reduces the wheel's momentum, so a wheel at its positive limit can give no negative torque
            let momentum_limit = self.momentum[axis];
            let feasible = if momentum[axis] >= momentum_limit {
                command.max(0.0)
            } else if momentum[axis] <= -momentum_limit {
                command.min(0.0)
            } else {
                command
            };
            let effect = effect(axis);
            let torque = self.channels[axis].apply(feasible, effect);
            let compensates = !self.gyroscopic && matches!(effect, None | Some(Effect::Weak(_)));
            let motor_demand = if compensates {
                torque + gyroscopic_torque[axis]
            } else {
                torque
            };
            let torque_to_limit = |stored: f64| (momentum_limit - stored).max(0.0) / self.period;
            let limit = self.motor_torque[axis];
            let motor = motor_demand
                .clamp(-limit, limit)
                .clamp(-torque_to_limit(momentum[axis]), torque_to_limit(-momentum[axis]));
            out.compensated[axis] = compensates && motor == motor_demand;
            out.torque[axis] = if out.compensated[axis] { torque } else { motor };
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn full_wheel_accepts_only_unloading_torque() {
        let mut wheels = Wheels::new(&WheelParameters::default(), 0.001).unwrap();
        let torque = |wheels: &mut Wheels, command: f64, stored: f64| {
            wheels
                .apply(
                    &[command, 0.0, 0.0],
                    &Vector3::new(stored, 0.0, 0.0),
                    &Vector3::zeros(),
                    |_| None,
                )
                .torque
                .x
        };
        assert_eq!(torque(&mut wheels, 0.1, 11.9), 0.1);
        assert_eq!(torque(&mut wheels, -0.1, 12.0), 0.0);
        assert_eq!(torque(&mut wheels, 0.1, 12.0), 0.1);
        assert_eq!(torque(&mut wheels, 0.1, -12.1), 0.0);
        assert_eq!(torque(&mut wheels, -0.5, -12.1), -0.2);
        // the last step fills the wheel exactly to its limit
        assert!((torque(&mut wheels, -0.2, 11.9999) + 0.1).abs() < 1e-9);
    }

    #[test]
    fn compensation_counts_against_the_wheel_limits() {
        let wheels = |motor_torque: Option<f64>, gyroscopic: bool| {
            let parameters = WheelParameters {
                motor_torque: motor_torque.map(|limit| lockstep::units::PerAxis::of([limit; 3])),
                gyroscopic,
                ..WheelParameters::default()
            };
            Wheels::new(&parameters, 0.001).unwrap()
        };
        let apply = |mut wheels: Wheels, stored: f64, gyroscopic_torque: f64, effect: Option<Effect>| {
            let (momentum, gyroscopic_torque) = (
                Vector3::new(0.0, stored, 0.0),
                Vector3::new(0.0, gyroscopic_torque, 0.0),
            );
            let output = wheels.apply(&[0.0, 0.1, 0.0], &momentum, &gyroscopic_torque, |_| effect);
            (output.torque.y, output.compensated[1])
        };
        assert_eq!(apply(wheels(None, false), 11.0, -0.3, None), (0.1, true));
        // the motor torque would exceed the wheel's momentum limit: it is zero, and the gyroscopic torque acts on the base
        assert_eq!(apply(wheels(None, false), 12.0, -0.3, None), (0.0, false));
        assert_eq!(apply(wheels(None, false), 12.0, 0.3, None), (0.1, true), "it empties");
        assert_eq!(apply(wheels(Some(0.2), false), 0.0, 0.05, None), (0.1, true));
        assert_eq!(apply(wheels(Some(0.2), false), 0.0, 0.3, None), (0.2, false));
        assert_eq!(apply(wheels(None, true), 0.0, 0.3, None), (0.1, false));
        assert_eq!(apply(wheels(None, false), 0.0, 0.3, Some(Effect::Off)), (0.0, false));
        assert_eq!(
            apply(wheels(None, false), 0.0, 0.3, Some(Effect::Weak(0.5))),
            (0.05, true)
        );
    }
}
