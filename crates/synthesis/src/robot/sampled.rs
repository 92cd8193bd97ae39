//! The loop as implemented: a sampled controller, delays in ticks of the plant's period, an exactly discretised plant.
//!
//! Over one controller period the whole loop is a linear map of its state (velocities, actuator lags, samples in transit,
//! integrators). Its spectral radius decides stability exactly, without a Padé approximant or an approximation of the hold.

use super::linearise::{Body, Robot, RobotError};
use super::plant::Gains;
use super::spec::{ModelSpec, SamplingSpec, Spec};
use crate::linalg::{self, Matrix};

/// Stability results of the sampled loop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SampledStability {
    /// Spectral radius of the map over one controller period; stable below one.
    pub spectral_radius: f64,
    /// Largest factor on all gains at once for which the loop is stable (searched up to 1000); zero when unstable.
    pub gain_margin_up: f64,
    /// Smallest such factor (searched down to 1/1000): above zero only for loops that need feedback to be stable.
    pub gain_margin_down: f64,
    /// Delay that may be added to the loop, s, in whole ticks of the plant (searched up to 0.5 s); zero when unstable.
    pub delay_margin_s: f64,
}

/// The times of a sampled loop.
#[derive(Debug, Clone, PartialEq)]
pub struct LoopTiming {
    /// Period of the controller, s.
    pub controller_period_s: f64,
    /// Time quantum of the delays, s: the controller's period is an integer multiple of it.
    pub tick_s: f64,
    /// Age of the state read by the controller, s; rounded up to whole ticks.
    pub sensor_delay_s: f64,
    /// Time from that reading to the instant at which the command acts, s; rounded up to whole ticks.
    pub command_delay_s: f64,
    /// First-order time constant of the actuator of each channel, s; zero for none.
    pub lag_s: Vec<f64>,
}

impl LoopTiming {
    /// The times of a specification for a robot of `channels` channels.
    pub fn new(sampling: &SamplingSpec, channels: usize) -> Self {
        Self {
            controller_period_s: sampling.controller_period_s,
            tick_s: sampling.plant_period_s,
            sensor_delay_s: sampling.sensor_delay_s,
            command_delay_s: sampling.computing_s + sampling.actuator_delay_s,
            lag_s: vec![sampling.actuator_lag_s; channels],
        }
    }
}

/// One tick of the plant with its actuator lags, under a zero-order hold of the command.
#[derive(Debug, Clone)]
struct Tick {
    transition: Matrix,
    input: Matrix,
    states: usize,
    channels: usize,
}

impl Tick {
    fn new(timing: &LoopTiming, body: &Body) -> Result<Self, RobotError> {
        let (n, nv) = (body.channels, body.a.nrows());
        let lag = |channel: usize| timing.lag_s.get(channel).copied().unwrap_or(0.0);
        let lagged: Vec<usize> = (0..n).filter(|&channel| lag(channel) > 0.0).collect();
        let states = nv + lagged.len();
        // [ẋ; 0] = [A B; 0 0] [x; u]: its exponential holds both the transition and the input matrix (van Loan 1978).
        let mut a = Matrix::zeros(states + n, states + n);
        a.set_block(0, 0, &body.a);
        a.set_block(0, states, &body.b);
        for (k, &channel) in lagged.iter().enumerate() {
            // The force is the lag's output, and no longer the command.
            for i in 0..nv {
                a[(i, nv + k)] = body.b[(i, channel)];
                a[(i, states + channel)] = 0.0;
            }
            a[(nv + k, nv + k)] = -1.0 / lag(channel);
            a[(nv + k, states + channel)] = 1.0 / lag(channel);
        }
        let e = linalg::expm(&(a * timing.tick_s))?;
        Ok(Self {
            transition: e.block(0, 0, states, states),
            input: e.block(0, states, states, n),
            states,
            channels: n,
        })
    }
}

/// The map over one controller period, for `kp`, `ki` (per tick; without columns for a proportional law) and the given delays
/// in ticks.
///
/// Only samples that the controller will read, and commands still to be applied, are states: one sample per period in transit,
/// however fine the ticks.
fn monodromy(t: &Tick, kp: &Matrix, ki: &Matrix, period: usize, sensor: usize, actuator: usize) -> Matrix {
    let (n, s) = (t.channels, t.states);
    // A reading for period k is taken at tick `phase` of an earlier period and waits in `readings_in_transit` slots.
    let phase = (period - sensor % period) % period;
    let readings_in_transit = sensor / period + usize::from(phase > 0);
    // Until tick `switch_tick` of a period the command before the due one is still applied.
    let (due, switch_tick) = (actuator / period, actuator % period);
    let commands_in_transit = due + usize::from(switch_tick > 0);
    let at_y = s;
    let at_u = at_y + n * readings_in_transit;
    let at_i = at_u + n * commands_in_transit;
    let integrators = ki.ncols();
    let length = at_i + integrators;
    let mut x = Matrix::identity(length, length);
    let rows = |x: &Matrix, first: usize, count: usize| x.block(first, 0, count, length);
    let store_reading = |x: &mut Matrix| {
        if readings_in_transit > 0 {
            let (kept, now) = (rows(x, at_y, n * (readings_in_transit - 1)), rows(x, 0, n));
            x.set_block(at_y + n, 0, &kept);
            x.set_block(at_y, 0, &now);
        }
    };
    let mut commands = Vec::new();
    for tick in 0..period {
        if tick == 0 {
            let reading = if readings_in_transit == 0 {
                rows(&x, 0, n)
            } else {
                rows(&x, at_y + n * (readings_in_transit - 1), n)
            };
            let mut command = kp * &reading * -1.0;
            if integrators > 0 {
                // c = σ + T y with y = −v; u gains K_I c, and σ becomes c.
                let sigma = rows(&x, at_i, n) - &reading * (period as f64);
                command += ki * &sigma;
                x.set_block(at_i, 0, &sigma);
            }
            commands.push(command);
            commands.extend((0..commands_in_transit).map(|k| rows(&x, at_u + n * k, n)));
        }
        if tick == phase {
            store_reading(&mut x);
        }
        let applied = &commands[if tick < switch_tick { due + 1 } else { due }];
        let next = &t.transition * rows(&x, 0, s) + &t.input * applied;
        x.set_block(0, 0, &next);
    }
    for (k, command) in commands.iter().take(commands_in_transit).enumerate() {
        x.set_block(at_u + n * k, 0, command);
    }
    x
}

fn radius(m: &Matrix) -> Result<f64, RobotError> {
    let values = linalg::eigenvalues(&crate::balance::balanced(m))?;
    Ok(values.iter().map(|l| l.norm()).fold(0.0, f64::max))
}

/// Ticks of the plant in a time, rounded up: a sample that is late by a fraction of a tick is read at the next one.
fn ticks(time: f64, period: f64) -> usize {
    (time / period - 1e-9).ceil().max(0.0) as usize
}

/// The sampled loop in one situation, prepared for stability queries.
#[derive(Debug, Clone)]
pub struct SampledLoop {
    tick: Tick,
    kp: Matrix,
    /// Per tick.
    ki: Matrix,
    period: usize,
    sensor: usize,
    actuator: usize,
    tick_s: f64,
}

/// Whether `period` is a whole multiple of `tick`, to rounding.
pub(super) fn is_multiple(period: f64, tick: f64) -> bool {
    let ratio = period / tick;
    ratio.is_finite() && ratio >= 1.0 && (ratio - ratio.round()).abs() <= 1e-9 * ratio
}

impl SampledLoop {
    /// The loop of a body with K_P and K_I (n × n, or n × 0 for a proportional law).
    ///
    /// # Errors
    /// A period of the controller that is no whole multiple of the tick.
    pub fn new(timing: &LoopTiming, body: &Body, kp: &Matrix, ki: &Matrix) -> Result<Self, RobotError> {
        if !is_multiple(timing.controller_period_s, timing.tick_s) {
            let reason = "must be a whole multiple of sampling.plant_period_s";
            return Err(RobotError::Value {
                what: "sampling.controller_period_s".into(),
                value: timing.controller_period_s,
                reason,
            });
        }
        Ok(Self {
            tick: Tick::new(timing, body)?,
            kp: kp.clone(),
            // The integrator's state is the sum of errors per tick: K_I is multiplied by the tick.
            ki: ki * timing.tick_s,
            period: (timing.controller_period_s / timing.tick_s).round() as usize,
            sensor: ticks(timing.sensor_delay_s, timing.tick_s),
            actuator: ticks(timing.command_delay_s, timing.tick_s),
            tick_s: timing.tick_s,
        })
    }

    /// Spectral radius of the map over one controller period, with all gains `factor` times as large and the command
    /// `extra_delay_s` later, rounded up to whole ticks.
    ///
    /// # Errors
    /// Eigenvalues that cannot be computed.
    pub fn radius(&self, factor: f64, extra_delay_s: f64) -> Result<f64, RobotError> {
        self.radius_with_extra_ticks(factor, ticks(extra_delay_s, self.tick_s))
    }

    fn radius_with_extra_ticks(&self, factor: f64, extra: usize) -> Result<f64, RobotError> {
        let by = factor;
        radius(&monodromy(
            &self.tick,
            &(&self.kp * by),
            &(&self.ki * by),
            self.period,
            self.sensor,
            self.actuator + extra,
        ))
    }

    /// Whether this spectral radius is that of a stable loop. Slosh is free to drift and the samples in transit are nilpotent; a
    /// marginal mode of the uncontrolled part is not a mode of the loop. A radius of one is accepted to the accuracy of the eigenvalues.
    pub fn is_stable(radius: f64) -> bool {
        radius < 1.0 + 1e-9
    }
}

fn sampled_loop(spec: &Spec, robot: &Robot, model: &ModelSpec, gains: &Gains) -> Result<SampledLoop, RobotError> {
    let body = robot.linearise(model)?;
    let mut timing = LoopTiming::new(&spec.sampling, body.channels);
    timing.command_delay_s += model.extra_delay_s;
    let ki = match gains.ki.len() {
        0 => Matrix::zeros(body.channels, 0),
        _ => linalg::diagonal(&gains.ki),
    };
    SampledLoop::new(&timing, &body, &gains.proportional(&body.mass)?, &ki)
}

/// The spectral radius alone.
///
/// # Errors
/// As [`sampled`].
pub fn spectral_radius(spec: &Spec, robot: &Robot, model: &ModelSpec, gains: &Gains) -> Result<f64, RobotError> {
    sampled_loop(spec, robot, model, gains)?.radius_with_extra_ticks(1.0, 0)
}

/// The exact stability of the sampled loop in one situation.
///
/// # Errors
/// Periods that are not multiples of each other, an impossible situation.
pub fn sampled(spec: &Spec, robot: &Robot, model: &ModelSpec, gains: &Gains) -> Result<SampledStability, RobotError> {
    let s = &spec.sampling;
    let sampled = sampled_loop(spec, robot, model, gains)?;
    let period = sampled.period;
    let at = |factor: f64, extra: usize| sampled.radius_with_extra_ticks(factor, extra);
    let spectral_radius = at(1.0, 0)?;
    let stable = SampledLoop::is_stable;
    if !stable(spectral_radius) {
        return Ok(SampledStability {
            spectral_radius,
            gain_margin_up: 0.0,
            gain_margin_down: 0.0,
            delay_margin_s: 0.0,
        });
    }
    let edge = |step: f64| -> Result<f64, RobotError> {
        let (mut inside, mut outside) = (1.0f64, None);
        for k in 1..=30 {
            let factor = step.powi(k);
            if stable(at(factor, 0)?) {
                inside = factor;
            } else {
                outside = Some(factor);
                break;
            }
        }
        let Some(mut outside) = outside else {
            return Ok(if step > 1.0 { f64::INFINITY } else { 0.0 });
        };
        for _ in 0..12 {
            let middle = (inside * outside).sqrt();
            if stable(at(middle, 0)?) {
                inside = middle
            } else {
                outside = middle
            }
        }
        Ok(inside)
    };
    let gain_margin_up = edge(1.26)?;
    let gain_margin_down = edge(1.0 / 1.26)?;
    let most = ticks(0.5, s.plant_period_s);
    let (mut low, mut high) = (0usize, period.max(1));
    while high < most && stable(at(1.0, high)?) {
        low = high;
        high *= 2;
    }
    let mut high = high.min(most);
    if high == most && stable(at(1.0, most)?) {
        low = most;
    }
    while high - low > 1 {
        let middle = (low + high) / 2;
        if stable(at(1.0, middle)?) {
            low = middle
        } else {
            high = middle
        }
    }
    Ok(SampledStability {
        spectral_radius,
        gain_margin_up,
        gain_margin_down,
        delay_margin_s: low as f64 * s.plant_period_s,
    })
}
