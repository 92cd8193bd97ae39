//! Figures of a capture.
//!
//! Peaks and saturation are those of the unlimited command, at the controller's samples: the largest absolute component of
//! the group. All other figures are computed from the truth.

use engine::assessment::{Assessment, AssessmentSetup, Figures, Measured, Numbers, stream};
use lockstep::participant::ParameterError;
use lockstep::wire;
use serde::{Deserialize, Serialize};
use tape::StreamSpec;

use super::Summary;
use super::criteria::evaluate_criteria;
use super::jerk::Jerk;
use super::parameters::{Criteria, Parameters};
use super::peak::{larger, largest, smaller};

const DEGREE: f64 = std::f64::consts::PI / 180.0;

/// Maximum distance of two stamps of the same instant: stamps are the doubles nearest to exact times.
const SAME_INSTANT_S: f64 = 1e-9;

/// An assessment of a capture.
#[derive(Debug)]
pub struct Capture {
    truth: TruthFields,
    command: CommandFields,
    grasp_at: f64,
    criteria: Criteria,
    pub(super) limits: [f64; 13],
    accumulated: Accumulated,
}

/// The fields of the truth.
#[derive(Debug)]
struct TruthFields {
    stream: usize,
    period: f64,
    base_position: Numbers<3>,
    joints: Numbers<7>,
    slosh: Numbers<2>,
    slosh_swing: Numbers<1>,
    thruster_force: Numbers<3>,
    thrust: Numbers<12>,
    wheel_momentum: Numbers<3>,
    end_effector_velocity: Numbers<3>,
    grasped: Numbers<1>,
    linear_residual: Numbers<3>,
    angular_residual: Numbers<3>,
    energy_residual: Numbers<1>,
    impact_loss: Numbers<1>,
}

/// The fields of the command.
#[derive(Debug)]
struct CommandFields {
    stream: usize,
    offset: f64,
    period: f64,
    torque: Numbers<3>,
    force: Numbers<3>,
    joints: Numbers<7>,
}

/// The state accumulated so far.
#[derive(Debug, Default, Serialize, Deserialize)]
struct Accumulated {
    peaks: [f64; 13],
    integrals: [f64; 3],
    commands: u64,
    /// Number of commands with a wheel, a thruster axis, a joint, or any of them over its limit.
    over: [u64; 4],
    /// The impulse of all thrusters, and of their resultant.
    impulses: [f64; 2],
    swing: f64,
    slosh: f64,
    wheel_momentum: f64,
    residuals: [f64; 3],
    jerk: Jerk,
    /// The newest truth.
    last: Option<LastTruth>,
    joint_range: Option<[[f64; 7]; 2]>,
}

#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
struct LastTruth {
    stamp: f64,
    base_position: [f64; 3],
    joints: [f64; 7],
    grasped: bool,
    impact_loss: f64,
}

fn norm(vector: [f64; 3]) -> f64 {
    vector.iter().map(|value| value * value).sum::<f64>().sqrt()
}

impl Capture {
    /// Creates an assessment without samples.
    ///
    /// # Errors
    /// Names the stream or field that is missing, or the value that is out of range.
    pub fn new(parameters: &Parameters, setup: &AssessmentSetup) -> Result<Self, ParameterError> {
        let streams = setup.streams;
        let number = stream(streams, "truth", parameters.truth.as_ref(), "Truth")?;
        let truth = TruthFields::new(number, &streams[number])?;
        let plant = setup.parameters.get(&*streams[number].participant).copied();
        let number = stream(streams, "command", parameters.command.as_ref(), "Command")?;
        let command = CommandFields::new(number, &streams[number])?;
        let grasp_at = parameters.grasp_at.si();
        if grasp_at <= 0.0 {
            let reason = format!("{grasp_at} s is not after the start");
            return Err(ParameterError::new("grasp_at", reason));
        }
        parameters.criteria.validate()?;
        Ok(Self {
            truth,
            command,
            grasp_at,
            criteria: parameters.criteria.clone(),
            limits: parameters.limits.or_of(plant)?,
            accumulated: Accumulated::default(),
        })
    }

    fn truth(&mut self, stamp: f64, payload: &[u8]) {
        let (fields, figures) = (&self.truth, &mut self.accumulated);
        figures.slosh = larger(figures.slosh, largest(&fields.slosh.read(payload)));
        let momentum = largest(&fields.wheel_momentum.read(payload));
        figures.wheel_momentum = larger(figures.wheel_momentum, momentum);
        let force = fields.thruster_force.read(payload);
        let sum = |values: &[f64]| values.iter().map(|value| value.abs()).sum::<f64>() * fields.period;
        figures.impulses[0] += sum(&fields.thrust.read(payload));
        figures.impulses[1] += sum(&force);
        figures.swing = larger(figures.swing, fields.slosh_swing.read(payload)[0]);
        let residuals = [
            norm(fields.linear_residual.read(payload)),
            norm(fields.angular_residual.read(payload)),
            largest(&fields.energy_residual.read(payload)),
        ];
        for (worst, residual) in figures.residuals.iter_mut().zip(residuals) {
            *worst = larger(*worst, residual);
        }
        let samples = (stamp - self.command.offset) / self.command.period;
        if (samples - samples.round()).abs() * self.command.period < 0.5 * fields.period {
            let velocity = fields.end_effector_velocity.read(payload);
            figures.jerk.sample(stamp, velocity, self.command.period);
        }
        let joints = fields.joints.read(payload);
        let [low, high] = figures.joint_range.get_or_insert([joints; 2]);
        for joint in 0..7 {
            low[joint] = smaller(low[joint], joints[joint]);
            high[joint] = larger(high[joint], joints[joint]);
        }
        let [grasped] = fields.grasped.read(payload);
        let [impact_loss] = fields.impact_loss.read(payload);
        figures.last = Some(LastTruth {
            stamp,
            base_position: fields.base_position.read(payload),
            joints,
            grasped: grasped > 0.5,
            impact_loss,
        });
    }

    fn command(&mut self, payload: &[u8]) {
        let (fields, figures) = (&self.command, &mut self.accumulated);
        let mut command = [0.0; 13];
        let parts = fields
            .torque
            .read(payload)
            .into_iter()
            .chain(fields.force.read(payload));
        let parts = parts.chain(fields.joints.read(payload));
        command.iter_mut().zip(parts).for_each(|(slot, value)| *slot = value);
        let mut over = [false; 4];
        for (channel, value) in command.iter().enumerate() {
            let group = match channel {
                0..3 => 0,
                3..6 => 1,
                _ => 2,
            };
            figures.peaks[channel] = larger(figures.peaks[channel], value.abs());
            figures.integrals[group] += value.abs() * fields.period;
            // a command that is not a number is none that an actuator could follow
            over[group] |= value.abs() > self.limits[channel] || value.is_nan();
        }
        over[3] = over[..3].contains(&true);
        figures.commands += 1;
        for (count, over) in figures.over.iter_mut().zip(over) {
            *count += u64::from(over);
        }
    }
}

impl TruthFields {
    fn new(number: usize, spec: &StreamSpec) -> Result<Self, ParameterError> {
        let key = "truth";
        Ok(Self {
            stream: number,
            period: spec.period.seconds(),
            base_position: Numbers::find(spec, key, "p_NB_N", "m")?,
            joints: Numbers::find(spec, key, "q", "rad")?,
            slosh: Numbers::find(spec, key, "slosh", "rad")?,
            slosh_swing: Numbers::find(spec, key, "slosh_swing", "rad")?,
            thrust: Numbers::find(spec, key, "thrust", "N")?,
            thruster_force: Numbers::find(spec, key, "thruster_force_B", "N")?,
            wheel_momentum: Numbers::find(spec, key, "wheel_momentum_B", "N m s")?,
            end_effector_velocity: Numbers::find(spec, key, "v_NE_N", "m/s")?,
            grasped: Numbers::find(spec, key, "grasped", "1")?,
            linear_residual: Numbers::find(spec, key, "linear_residual_N", "kg m/s")?,
            angular_residual: Numbers::find(spec, key, "angular_residual_N", "N m s")?,
            energy_residual: Numbers::find(spec, key, "energy_residual", "J")?,
            impact_loss: Numbers::find(spec, key, "impact_loss", "J")?,
        })
    }
}

impl CommandFields {
    fn new(number: usize, spec: &StreamSpec) -> Result<Self, ParameterError> {
        let key = "command";
        Ok(Self {
            stream: number,
            offset: spec.offset.seconds(),
            period: spec.period.seconds(),
            torque: Numbers::find(spec, key, "torque_B", "N m")?,
            force: Numbers::find(spec, key, "force_B", "N")?,
            joints: Numbers::find(spec, key, "tau", "N m")?,
        })
    }
}

impl Assessment for Capture {
    fn reads(&self, stream: usize) -> bool {
        [self.truth.stream, self.command.stream].contains(&stream)
    }

    fn sample(&mut self, stream: usize, stamp_s: f64, payload: &[u8]) {
        if stream == self.truth.stream {
            self.truth(stamp_s, payload);
        } else if stream == self.command.stream {
            self.command(payload);
        }
    }

    fn save(&self) -> Option<Vec<u8>> {
        wire::encode("the figures of a capture", &self.accumulated).ok()
    }

    fn restore(&mut self, saved: &[u8], _: &[bool]) -> Result<(), String> {
        let accumulated = wire::decode("the figures of a capture", saved);
        self.accumulated = accumulated.map_err(|error| error.to_string())?;
        Ok(())
    }

    fn finish(&mut self, measures: Vec<Measured>) -> Figures {
        let summary = self.summary();
        let criteria = evaluate_criteria(&self.criteria, &summary);
        summary.figures(criteria, measures)
    }
}

impl Capture {
    /// The figures of the samples so far.
    pub fn summary(&self) -> Summary {
        let figures = &self.accumulated;
        let last = figures.last;
        let part = |count: u64| count as f64 / figures.commands.max(1) as f64;
        let [low, high] = figures.joint_range.unwrap_or_default();
        let end_s = last.map_or(0.0, |last| last.stamp);
        let incomplete = if last.is_none_or(|last| last.stamp < self.grasp_at - SAME_INSTANT_S) {
            Some(format!(
                "the run ended at {end_s} s, before the grasp at {} s",
                self.grasp_at
            ))
        } else if figures.commands == 0 {
            Some("nothing was ever commanded".to_owned())
        } else {
            None
        };
        Summary {
            incomplete,
            peak_base_torque_n_m: largest(&figures.peaks[..3]),
            peak_base_force_n: largest(&figures.peaks[3..6]),
            peak_joint_torque_n_m: largest(&figures.peaks[6..]),
            peak_torque_of_joints_n_m: std::array::from_fn(|joint| figures.peaks[6 + joint]),
            saturated_fraction: part(figures.over[3]),
            wheels_saturated_fraction: part(figures.over[0]),
            thrusters_saturated_fraction: part(figures.over[1]),
            joints_saturated_fraction: part(figures.over[2]),
            base_torque_integral_n_m_s: figures.integrals[0],
            base_force_integral_n_s: figures.integrals[1],
            joint_torque_integral_n_m_s: figures.integrals[2],
            thruster_impulse_n_s: figures.impulses[0],
            net_force_impulse_n_s: figures.impulses[1],
            jerk_squared_integral_m2_s5: figures.jerk.integral,
            slosh_max_deg: figures.swing / DEGREE,
            slosh_joint_max_deg: figures.slosh / DEGREE,
            wheel_momentum_max_n_m_s: figures.wheel_momentum,
            linear_momentum_residual_kg_m_s: figures.residuals[0],
            angular_momentum_residual_n_m_s: figures.residuals[1],
            energy_residual_j: figures.residuals[2],
            impact_loss_j: last.map_or(0.0, |last| last.impact_loss),
            base_position_at_end_m: last.map_or([0.0; 3], |last| last.base_position),
            joint_angles_at_end_rad: last.map_or([0.0; 7], |last| last.joints),
            joint_angles_min_deg: low.map(|angle| angle / DEGREE),
            joint_angles_max_deg: high.map(|angle| angle / DEGREE),
            grasped: last.is_some_and(|last| last.grasped),
            end_s,
        }
    }
}
