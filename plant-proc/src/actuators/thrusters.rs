//! Twelve thrusters in four-packs: for each body axis two that push along it, then two that push against it.
//!
//! The first of each two turns the base one way when it pushes alone, the second the other way: thrusters along y about x,
//! along z about y, along x about z.

use lockstep::participant::ParameterError;
use lockstep::units::{Force, Length};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::parameters::THRUSTERS;
use super::{Channel, ChannelParameters, ChannelState, Effect, ThrusterParameters, not_negative};

/// Complete state of the thrusters.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct ThrustersState {
    channels: [ChannelState; THRUSTERS],
    /// Commanded impulse not yet delivered, N s.
    outstanding_impulse: [f64; THRUSTERS],
    /// Remaining steps of the current firing.
    firing: [u32; THRUSTERS],
}

/// The thrusters.
#[derive(Debug, Clone)]
pub struct Thrusters {
    channels: [Channel; THRUSTERS],
    thrust_max: [f64; 3],
    lever_arm: [f64; 3],
    period: f64,
    /// Minimum on-time in steps; `None` for continuous thrust.
    pulse_steps: Option<u32>,
    outstanding_impulse: [f64; THRUSTERS],
    firing: [u32; THRUSTERS],
}

/// The axis along which the thrusters push that turn about `axis`.
const fn push_axis(axis: usize) -> usize {
    (axis + 1) % 3
}

impl Thrusters {
    /// Thrusters at rest.
    ///
    /// # Errors
    /// Names the parameter that is out of range.
    pub fn new(parameters: &ThrusterParameters, period: f64) -> Result<Self, ParameterError> {
        let channel_parameters = ChannelParameters::new(
            "actuators.thrusters",
            parameters.lag,
            parameters.dead_zone.si(),
            parameters.quantum.si(),
            period,
        )?;
        for axis in 0..3 {
            let of = [" along x", " along y", " along z"][axis];
            not_negative::<Force>("actuators.thrusters.force", of, parameters.force.si()[axis])?;
            let of = [" about x", " about y", " about z"][axis];
            not_negative::<Length>("actuators.thrusters.lever_arm", of, parameters.lever_arm.si()[axis])?;
        }
        let pulse_steps = match parameters.minimum_on.map(|on| on.si()) {
            None => None,
            // at least so long, in whole steps; a quotient is rounded, so that a multiple of the period is one
            Some(on) if on > 0.0 && on / period < 1e6 => Some((on / period - 1e-6).ceil().max(1.0) as u32),
            Some(on) => {
                let reason = format!("{on} s is not a shortest firing; write for example \"20 ms\", or leave it out");
                return Err(ParameterError::new("actuators.thrusters.minimum_on", reason));
            }
        };
        // each thruster gives half of its axis' force
        let thrust_max = parameters.force.si().map(|force| 0.5 * force);
        Ok(Self {
            channels: std::array::from_fn(|n| Channel::new(channel_parameters, thrust_max[n / 4])),
            thrust_max,
            lever_arm: parameters.lever_arm.si(),
            period,
            pulse_steps,
            outstanding_impulse: [0.0; THRUSTERS],
            firing: [0; THRUSTERS],
        })
    }

    pub fn state(&self) -> ThrustersState {
        ThrustersState {
            channels: self.channels.each_ref().map(Channel::state),
            outstanding_impulse: self.outstanding_impulse,
            firing: self.firing,
        }
    }

    pub fn restore(&mut self, state: &ThrustersState) {
        for (channel, state) in self.channels.iter_mut().zip(&state.channels) {
            channel.restore(state);
        }
        self.outstanding_impulse = state.outstanding_impulse;
        self.firing = state.firing;
    }

    /// Force, N, and torque, N m, on the base for a commanded force and couple; and the thrust of each thruster, N.
    pub fn apply(
        &mut self,
        force: &[f64; 3],
        couple: &[f64; 3],
        effect: impl Fn(usize) -> Option<Effect>,
    ) -> (Vector3<f64>, Vector3<f64>, [f64; THRUSTERS]) {
        let (mut total_force, mut total_torque) = (Vector3::zeros(), Vector3::zeros());
        let mut each = [0.0; THRUSTERS];
        for turn in 0..3 {
            let (push, arm) = (push_axis(turn), self.lever_arm[turn]);
            let difference = if arm > 0.0 { couple[turn] / arm } else { 0.0 };
            let (first, second) = (0.5 * (force[push] + difference), 0.5 * (force[push] - difference));
            let demand = [first.max(0.0), second.max(0.0), (-first).max(0.0), (-second).max(0.0)];
            let thrust: [f64; 4] = std::array::from_fn(|n| self.thrust(4 * push + n, demand[n], effect(4 * push + n)));
            each[4 * push..4 * push + 4].copy_from_slice(&thrust);
            let (first, second) = (thrust[0] - thrust[2], thrust[1] - thrust[3]);
            total_force[push] = first + second;
            total_torque[turn] = arm * (first - second);
        }
        (total_force, total_torque, each)
    }

    /// Thrust of thruster `n` over a step, N.
    fn thrust(&mut self, n: usize, demand: f64, effect: Option<Effect>) -> f64 {
        let Some(pulse_steps) = self.pulse_steps else {
            return self.channels[n].apply(demand, effect);
        };
        // Pulses: fire at full thrust for at least the minimum on-time as soon as that much impulse is outstanding.
        let thrust_max = self.thrust_max[n / 4];
        let impulse_min = thrust_max * self.period * f64::from(pulse_steps);
        self.outstanding_impulse[n] = (self.outstanding_impulse[n] + demand * self.period).min(2.0 * impulse_min);
        if self.firing[n] == 0 && self.outstanding_impulse[n] >= impulse_min && impulse_min > 0.0 {
            self.firing[n] = pulse_steps;
        }
        if self.firing[n] == 0 {
            return self.channels[n].apply(0.0, effect);
        }
        self.firing[n] -= 1;
        self.outstanding_impulse[n] -= thrust_max * self.period;
        self.channels[n].apply(thrust_max, effect)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lockstep::units::Quantity;

    #[test]
    fn an_ideal_pack_gives_the_force_to_the_last_bit() {
        let mut thrusters = Thrusters::new(&ThrusterParameters::default(), 0.001).unwrap();
        let (force, torque, _) = thrusters.apply(&[0.123_456_789, -7.1, 20.0], &[0.0; 3], |_| None);
        assert_eq!(force, Vector3::new(0.123_456_789, -7.1, 9.0));
        assert_eq!(torque, Vector3::zeros());
    }

    #[test]
    fn thruster_couples_give_torque_without_force() {
        let mut thrusters = Thrusters::new(&ThrusterParameters::default(), 0.001).unwrap();
        let (force, torque, thrust) = thrusters.apply(&[0.0, 1.0, 0.0], &[0.4, 0.0, -0.6], |_| None);
        assert!((force - Vector3::new(0.0, 1.0, 0.0)).amax() < 1e-15);
        assert!((torque - Vector3::new(0.4, 0.0, -0.6)).amax() < 1e-15);
        // 0.8 N on y turn about x by 0.4 N m while pushing 1 N; 1.2 N on x turn about z and push nothing
        let expected = [0.0, 0.6, 0.6, 0.0, 0.9, 0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        assert!(
            thrust
                .iter()
                .zip(expected)
                .all(|(made, expected)| (made - expected).abs() < 1e-15),
            "{thrust:?}"
        );
    }

    #[test]
    fn firing_is_never_shorter_than_the_minimum() {
        for (on, period, steps) in [
            (0.02, 0.001, 20),
            (0.012, 0.005, 3),
            (0.0024, 0.001, 3),
            (0.0004, 0.001, 1),
            (0.3, 0.1, 3),
        ] {
            let parameters = ThrusterParameters {
                minimum_on: Some(Quantity::of(on)),
                ..ThrusterParameters::default()
            };
            let thrusters = Thrusters::new(&parameters, period).unwrap();
            assert_eq!(thrusters.pulse_steps, Some(steps), "{on} s in steps of {period} s");
        }
    }

    #[test]
    fn a_thruster_that_fails_halves_the_force_and_turns_the_base() {
        let mut thrusters = Thrusters::new(&ThrusterParameters::default(), 0.001).unwrap();
        let off = |n| (n == 0).then_some(Effect::Off);
        let (force, torque, _) = thrusters.apply(&[8.0, 0.0, 0.0], &[0.0; 3], off);
        assert_eq!(force.x, 4.0);
        assert_eq!(torque, Vector3::new(0.0, 0.0, -2.0));
    }

    #[test]
    fn pulses_last_the_minimum_on_time_and_keep_the_impulse() {
        let parameters = ThrusterParameters {
            minimum_on: Some(Quantity::of(0.02)),
            ..ThrusterParameters::default()
        };
        let mut thrusters = Thrusters::new(&parameters, 0.001).unwrap();
        let (mut impulse, mut run, mut shortest) = (0.0, 0, u32::MAX);
        for _ in 0..60_000 {
            let force = thrusters.apply(&[0.7, 0.0, 0.0], &[0.0; 3], |_| None).0.x;
            assert!(force == 0.0 || force == 9.0, "{force}");
            impulse += force * 0.001;
            if force > 0.0 {
                run += 1;
            } else if run > 0 {
                shortest = shortest.min(run);
                run = 0;
            }
        }
        assert_eq!(shortest, 20);
        assert!((impulse - 42.0).abs() <= 0.18 + 1e-9, "{impulse}");
    }
}
