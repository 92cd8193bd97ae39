//! Reaction wheels: torque on the base against momentum in the rotor.

use lockstep::participant::ParameterError;
use lockstep::units::{AngularMomentum, Torque};
use nalgebra::Vector3;

use super::{Channel, ChannelState, Effect, Shape, WheelParameters, not_negative};

/// All that the wheels remember beside their momentum, which is part of the motion.
pub type WheelsState = [ChannelState; 3];

/// One wheel a body axis.
#[derive(Debug, Clone)]
pub struct Wheels {
    channels: [Channel; 3],
    momentum: [f64; 3],
    gyroscopic: bool,
}

impl Wheels {
    /// Wheels at rest.
    ///
    /// # Errors
    /// Names the parameter that is out of range.
    pub fn new(parameters: &WheelParameters, period: f64) -> Result<Self, ParameterError> {
        let group = "actuators.wheels";
        let shape = Shape::new(
            group,
            parameters.lag,
            parameters.dead_zone.si(),
            parameters.quantum.si(),
            period,
        )?;
        for axis in 0..3 {
            let of = [" about x", " about y", " about z"][axis];
            not_negative::<Torque>("actuators.wheels.torque", of, parameters.torque.si()[axis])?;
            let full =
                not_negative::<AngularMomentum>("actuators.wheels.momentum", of, parameters.momentum.si()[axis])?;
            let start = parameters.start_momentum.si()[axis];
            if start.abs() > full {
                let reason = format!("{start} N m s{of} is more than the wheel can store ({full} N m s)");
                return Err(ParameterError::new("actuators.wheels.start_momentum", reason));
            }
        }
        Ok(Self {
            channels: parameters.torque.si().map(|limit| Channel::new(shape, limit)),
            momentum: parameters.momentum.si(),
            gyroscopic: parameters.gyroscopic,
        })
    }

    pub fn gyroscopic(&self) -> bool {
        self.gyroscopic
    }

    pub fn state(&self) -> WheelsState {
        self.channels.each_ref().map(Channel::state)
    }

    pub fn restore(&mut self, state: &WheelsState) {
        for (channel, state) in self.channels.iter_mut().zip(state) {
            channel.restore(state);
        }
    }

    /// Torque on the base, N m, with `momentum` stored, N m s.
    pub fn apply(
        &mut self,
        command: &[f64; 3],
        momentum: &Vector3<f64>,
        effect: impl Fn(usize) -> Option<Effect>,
    ) -> Vector3<f64> {
        Vector3::from_fn(|axis, _| {
            // a wheel that turns the base forwards loses momentum, so a full one cannot turn it back
            let full = self.momentum[axis];
            let possible = if momentum[axis] >= full {
                command[axis].max(0.0)
            } else if momentum[axis] <= -full {
                command[axis].min(0.0)
            } else {
                command[axis]
            };
            self.channels[axis].apply(possible, effect(axis))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_wheel_only_empties() {
        let mut wheels = Wheels::new(&WheelParameters::default(), 0.001).unwrap();
        let torque = |wheels: &mut Wheels, command: f64, stored: f64| {
            wheels
                .apply(&[command, 0.0, 0.0], &Vector3::new(stored, 0.0, 0.0), |_| None)
                .x
        };
        assert_eq!(torque(&mut wheels, 0.1, 11.9), 0.1);
        assert_eq!(torque(&mut wheels, -0.1, 12.0), 0.0);
        assert_eq!(torque(&mut wheels, 0.1, 12.0), 0.1);
        assert_eq!(torque(&mut wheels, 0.1, -12.1), 0.0);
        assert_eq!(torque(&mut wheels, -0.5, -12.1), -0.2);
    }
}
