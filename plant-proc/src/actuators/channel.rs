//! Actuator channel: fault, dead zone, quantisation, saturation and first-order lag of one actuator.

use lockstep::participant::ParameterError;
use lockstep::units::{Quantity, Time};
use serde::{Deserialize, Serialize};

use super::Effect;

/// Parameters common to all actuators of a group.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChannelParameters {
    dead_zone: f64,
    quantum: f64,
    /// For a lag: the fraction of a step change that remains after one step, and its mean over the step.
    lag: Option<(f64, f64)>,
}

impl ChannelParameters {
    /// Builds the shape from parameters in SI units; `group` is their key.
    ///
    /// # Errors
    /// When a number is negative, or the lag is not above zero.
    pub fn new(
        group: &str,
        lag: Option<Quantity<Time>>,
        dead_zone: f64,
        quantum: f64,
        period: f64,
    ) -> Result<Self, ParameterError> {
        for (key, value) in [("dead_zone", dead_zone), ("quantum", quantum)] {
            if value < 0.0 {
                let reason =
                    format!("{value} is negative; leave it out, or give the width in the unit of the actuator");
                return Err(ParameterError::new(format!("{group}.{key}"), reason));
            }
        }
        let lag = match lag.map(|lag| lag.si()) {
            None => None,
            Some(lag) if lag > 0.0 => {
                let decay = libm::exp(-period / lag);
                Some((decay, (1.0 - decay) * lag / period))
            }
            Some(lag) => {
                let reason = format!("{lag} s is not above zero; leave it out for an actuator without lag");
                return Err(ParameterError::new(format!("{group}.lag"), reason));
            }
        };
        Ok(Self {
            dead_zone,
            quantum,
            lag,
        })
    }
}

/// Complete state of an actuator.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct ChannelState {
    /// Output of the lag at the end of the last step.
    lagged: f64,
    /// Output over the last step: the value at which it sticks.
    last: f64,
}

/// One actuator.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Channel {
    parameters: ChannelParameters,
    limit: f64,
    state: ChannelState,
}

impl Channel {
    /// An actuator at rest with output limits of ±`limit`.
    pub fn new(parameters: ChannelParameters, limit: f64) -> Self {
        Self {
            parameters,
            limit,
            state: ChannelState::default(),
        }
    }

    /// Its complete state.
    pub fn state(&self) -> ChannelState {
        self.state
    }

    /// Continues from `state`.
    pub fn restore(&mut self, state: &ChannelState) {
        self.state = *state;
    }

    /// Mean output over a step with `command` held.
    pub fn apply(&mut self, command: f64, effect: Option<Effect>) -> f64 {
        let ChannelParameters {
            dead_zone,
            quantum,
            lag,
        } = self.parameters;
        let mut value = command;
        match effect {
            Some(Effect::Stuck) => return self.state.last,
            Some(Effect::Off | Effect::Locked) => value = 0.0,
            Some(Effect::On) => value = self.limit,
            Some(Effect::Weak(factor)) => value *= factor,
            None => {}
        }
        if value.abs() < dead_zone {
            value = 0.0;
        }
        if quantum > 0.0 {
            value = nearest(value, quantum);
        }
        value = value.clamp(-self.limit, self.limit);
        if let Some((decay, mean)) = lag {
            let difference = self.state.lagged - value;
            self.state.lagged = value + difference * decay;
            value += difference * mean;
        }
        self.state.last = value;
        value
    }
}

/// The multiple of `quantum` nearest to `value`. Not inlined: otherwise the quotient would be computed for continuous actuators as well.
#[inline(never)]
fn nearest(value: f64, quantum: f64) -> f64 {
    (value / quantum).round_ties_even() * quantum
}

#[cfg(test)]
mod tests {
    use super::*;

    fn channel(lag: Option<f64>, dead_zone: f64, quantum: f64) -> Channel {
        Channel::new(
            ChannelParameters::new("a", lag.map(Quantity::of), dead_zone, quantum, 0.001).unwrap(),
            2.0,
        )
    }

    #[test]
    fn an_ideal_actuator_only_saturates() {
        let mut ideal = channel(None, 0.0, 0.0);
        for (command, expected) in [(0.1, 0.1), (1.999, 1.999), (7.0, 2.0), (-7.0, -2.0)] {
            assert_eq!(ideal.apply(command, None), expected);
        }
    }

    #[test]
    fn channel_applies_dead_zone_and_quantisation() {
        let mut rough = channel(None, 0.3, 0.25);
        for (command, expected) in [(0.29, 0.0), (0.31, 0.25), (0.38, 0.5), (-1.1, -1.0), (9.0, 2.0)] {
            assert_eq!(rough.apply(command, None), expected, "{command}");
        }
    }

    #[test]
    fn a_lag_keeps_the_impulse() {
        let mut slow = channel(Some(0.02), 0.0, 0.0);
        // a pulse, then a long rest: the impulse is delivered late but in full
        let impulse: f64 = (0..2000)
            .map(|k| slow.apply(if k < 50 { 1.0 } else { 0.0 }, None) * 0.001)
            .sum();
        assert!((impulse - 0.05).abs() < 1e-12, "{impulse}");
        let mut slow = channel(Some(0.02), 0.0, 0.0);
        for _ in 0..20 {
            slow.apply(1.0, None);
        }
        assert!((slow.state.lagged - (1.0 - libm::exp(-1.0))).abs() < 1e-12);
    }

    #[test]
    fn faults_override_the_command() {
        let mut channel = channel(None, 0.0, 0.0);
        assert_eq!(channel.apply(1.5, None), 1.5);
        assert_eq!(channel.apply(-1.0, Some(Effect::Stuck)), 1.5);
        assert_eq!(channel.apply(-1.0, Some(Effect::Off)), 0.0);
        assert_eq!(channel.apply(-1.0, Some(Effect::On)), 2.0);
        assert_eq!(channel.apply(-1.0, Some(Effect::Weak(0.5))), -0.5);
    }
}
