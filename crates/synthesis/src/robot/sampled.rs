//! The loop as it will run: a sampled controller, delays in ticks of the plant's period, an exactly discretised plant.
//!
//! Over one controller period the whole loop is a linear map of its state (velocities, actuator lags, samples in transit,
//! integrators). Its spectral radius decides stability exactly; no Padé approximant and no continuous hold enter.

use super::body::{Robot, RobotError};
use super::plant::Gains;
use super::spec::{ModelSpec, Spec};
use crate::linalg::{self, Matrix};

/// What the sampled loop shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sampled {
    /// Spectral radius of the map over one controller period; stable below one.
    pub spectral_radius: f64,
    /// Largest factor on all gains at once for which the loop is stable (searched up to 1000); zero when unstable.
    pub gain_margin_up: f64,
    /// Smallest such factor (searched down to 1/1000): above zero only for loops that need feedback to be stable.
    pub gain_margin_down: f64,
    /// Delay that may be added to the loop, s, in whole ticks of the plant (searched up to 0.5 s); zero when unstable.
    pub delay_margin_s: f64,
}

/// One tick of the plant with its actuator lags, for a held command.
struct Tick {
    transition: Matrix,
    input: Matrix,
    states: usize,
    channels: usize,
}

fn tick(spec: &Spec, robot: &Robot, model: &ModelSpec) -> Result<(Tick, Matrix), RobotError> {
    let body = robot.body(model)?;
    let (n, nv) = (body.channels, body.a.nrows());
    let lag = spec.sampling.actuator_lag_s;
    let na = if lag > 0.0 { n } else { 0 };
    let states = nv + na;
    // [ẋ; 0] = [A B; 0 0] [x; u]: its exponential holds both the transition and the input matrix (van Loan 1978).
    let mut a = Matrix::zeros(states + n, states + n);
    linalg::put(&mut a, 0, 0, body.a.as_ref());
    if na > 0 {
        linalg::put(&mut a, 0, nv, body.b.as_ref());
        for i in 0..n {
            a[(nv + i, nv + i)] = -1.0 / lag;
            a[(nv + i, states + i)] = 1.0 / lag;
        }
    } else {
        linalg::put(&mut a, 0, states, body.b.as_ref());
    }
    let e = linalg::expm(&(a * faer::Scale(spec.sampling.plant_period_s)))?;
    let transition = linalg::sub(&e, 0, 0, states, states);
    let input = linalg::sub(&e, 0, states, states, n);
    Ok((
        Tick {
            transition,
            input,
            states,
            channels: n,
        },
        body.mass,
    ))
}

/// The map over one controller period, for `kp`, `ki` (per tick) and the given delays in ticks.
///
/// Only what the controller will read, and only commands still to be applied, are states: one sample per period in transit,
/// however fine the ticks.
fn monodromy(t: &Tick, kp: &Matrix, ki: &[f64], period: usize, sensor: usize, actuator: usize) -> Matrix {
    let (n, s) = (t.channels, t.states);
    // A reading for period k is taken at tick `phase` of an earlier period and waits in `waiting` slots.
    let phase = (period - sensor % period) % period;
    let waiting = sensor / period + usize::from(phase > 0);
    // Until tick `turn` of a period the command before the due one is still applied.
    let (due, turn) = (actuator / period, actuator % period);
    let pending = due + usize::from(turn > 0);
    let at_y = s;
    let at_u = at_y + n * waiting;
    let at_i = at_u + n * pending;
    let length = at_i + ki.len();
    let mut x = Matrix::identity(length, length);
    let rows = |x: &Matrix, first: usize, count: usize| linalg::sub(x, first, 0, count, length);
    let store_reading = |x: &mut Matrix| {
        if waiting > 0 {
            let (kept, now) = (rows(x, at_y, n * (waiting - 1)), rows(x, 0, n));
            linalg::put(x, at_y + n, 0, kept.as_ref());
            linalg::put(x, at_y, 0, now.as_ref());
        }
    };
    let mut commands = Vec::new();
    for tick in 0..period {
        if tick == 0 {
            let seen = if waiting == 0 {
                rows(&x, 0, n)
            } else {
                rows(&x, at_y + n * (waiting - 1), n)
            };
            let mut command = kp * &seen * faer::Scale(-1.0);
            for i in 0..ki.len() {
                for j in 0..length {
                    // c = σ + T y with y = −v; u gains K_I c, and σ becomes c.
                    let c = x[(at_i + i, j)] - period as f64 * seen[(i, j)];
                    command[(i, j)] += ki[i] * c;
                    x[(at_i + i, j)] = c;
                }
            }
            commands.push(command);
            commands.extend((0..pending).map(|k| rows(&x, at_u + n * k, n)));
        }
        if tick == phase {
            store_reading(&mut x);
        }
        let applied = &commands[if tick < turn { due + 1 } else { due }];
        let next = &t.transition * rows(&x, 0, s) + &t.input * applied;
        linalg::put(&mut x, 0, 0, next.as_ref());
    }
    for (k, command) in commands.iter().take(pending).enumerate() {
        linalg::put(&mut x, at_u + n * k, 0, command.as_ref());
    }
    x
}

fn radius(m: &Matrix) -> Result<f64, RobotError> {
    let values = linalg::eigenvalues(&crate::balance::balanced(m))?;
    Ok(values.iter().map(|l| l.norm()).fold(0.0, f64::max))
}

/// Ticks of the plant in a time, rounded up: a sample that is late by a fraction of a tick is seen at the next one.
fn ticks(time: f64, period: f64) -> usize {
    (time / period - 1e-9).ceil().max(0.0) as usize
}

/// Everything about the sampled loop but the factor on the gains and the extra delay.
struct Setup {
    tick: Tick,
    kp: Matrix,
    ki: Vec<f64>,
    period: usize,
    sensor: usize,
    actuator: usize,
}

impl Setup {
    fn radius(&self, factor: f64, extra: usize) -> Result<f64, RobotError> {
        let scaled: Vec<f64> = self.ki.iter().map(|k| k * factor).collect();
        let kp = &self.kp * faer::Scale(factor);
        radius(&monodromy(
            &self.tick,
            &kp,
            &scaled,
            self.period,
            self.sensor,
            self.actuator + extra,
        ))
    }
}

fn setup(spec: &Spec, robot: &Robot, model: &ModelSpec, gains: &Gains) -> Result<Setup, RobotError> {
    let s = &spec.sampling;
    let ratio = s.controller_period_s / s.plant_period_s;
    if !ratio.is_finite() || ratio < 1.0 || (ratio - ratio.round()).abs() > 1e-9 * ratio {
        let reason = "must be a whole multiple of sampling.plant_period_s";
        return Err(RobotError::Value {
            what: "sampling.controller_period_s".into(),
            value: s.controller_period_s,
            reason,
        });
    }
    let period = ratio.round() as usize;
    let (tick, mass) = tick(spec, robot, model)?;
    let kp = gains.proportional(&mass)?;
    // The integrator's state is the sum of errors per plant tick: K_I takes the tick along.
    let ki: Vec<f64> = gains.ki.iter().map(|k| k * s.plant_period_s).collect();
    let sensor = ticks(s.sensor_delay_s, s.plant_period_s);
    let actuator = ticks(
        s.computing_s + s.actuator_delay_s + model.extra_delay_s,
        s.plant_period_s,
    );
    Ok(Setup {
        tick,
        kp,
        ki,
        period,
        sensor,
        actuator,
    })
}

/// The spectral radius alone.
///
/// # Errors
/// As [`sampled`].
pub fn spectral_radius(spec: &Spec, robot: &Robot, model: &ModelSpec, gains: &Gains) -> Result<f64, RobotError> {
    setup(spec, robot, model, gains)?.radius(1.0, 0)
}

/// The exact stability of the sampled loop in one situation.
///
/// # Errors
/// Periods that are not multiples of each other, an impossible situation.
pub fn sampled(spec: &Spec, robot: &Robot, model: &ModelSpec, gains: &Gains) -> Result<Sampled, RobotError> {
    let s = &spec.sampling;
    let setup = setup(spec, robot, model, gains)?;
    let period = setup.period;
    let at = |factor: f64, extra: usize| setup.radius(factor, extra);
    let spectral_radius = at(1.0, 0)?;
    // Slosh is free to drift and the samples in transit are nilpotent; a marginal mode of the uncontrolled part is not one
    // of the loop. One is allowed to the accuracy of the eigenvalues.
    let stable = |r: f64| r < 1.0 + 1e-9;
    if !stable(spectral_radius) {
        return Ok(Sampled {
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
    Ok(Sampled {
        spectral_radius,
        gain_margin_up,
        gain_margin_down,
        delay_margin_s: low as f64 * s.plant_period_s,
    })
}
