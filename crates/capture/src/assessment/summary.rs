//! Figures of a capture: their names, units, meanings and text.

use engine::assessment::{Criterion, Figures, Measured};
use engine::three_digits;
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// The figures of a run. Figures that could not be measured because the run ended too early are absent.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// Why there is no verdict, when the run ended too early.
    pub incomplete: Option<String>,
    /// Largest torque commanded of a wheel, before any limit, N m.
    pub peak_base_torque_n_m: f64,
    /// Largest force commanded along an axis of the base, before any limit, N.
    pub peak_base_force_n: f64,
    /// Largest torque commanded of a joint, before any limit, N m.
    pub peak_joint_torque_n_m: f64,
    /// Largest torque commanded of each joint, N m.
    pub peak_torque_of_joints_n_m: [f64; 7],
    /// Fraction of the controller's samples with an actuator command beyond its limit.
    pub saturated_fraction: f64,
    /// The same for the wheels alone.
    pub wheels_saturated_fraction: f64,
    /// The same for the thrusters alone.
    pub thrusters_saturated_fraction: f64,
    /// The same for the joints alone.
    pub joints_saturated_fraction: f64,
    /// Integral of the commanded wheel torque, absolute values of all axes summed, N m s.
    pub base_torque_integral_n_m_s: f64,
    /// Integral of the commanded thruster force, absolute values of all axes summed, N s.
    pub base_force_integral_n_s: f64,
    /// Integral of the commanded joint torques, absolute values of all joints summed, N m s.
    pub joint_torque_integral_n_m_s: f64,
    /// Impulse of all thrusters summed, N s, for forces and torques alike: a measure of propellant consumption.
    pub thruster_impulse_n_s: f64,
    /// Impulse of the resultant force, absolute values of all axes summed, N s: without the contribution of couples.
    pub net_force_impulse_n_s: f64,
    /// Integral of the squared jerk of the end effector, from its velocity at the controller's samples, m²/s⁵.
    pub jerk_squared_integral_m2_s5: f64,
    /// Largest swing angle of the pendulum: between the direction of its bob and the hanging one, at most 180 deg.
    pub slosh_max_deg: f64,
    /// Largest of its two joint angles, unwrapped, deg: smaller than the swing angle where both are non-zero, larger where
    /// a hinge has made a full turn.
    pub slosh_joint_max_deg: f64,
    /// Largest momentum in a wheel, N m s.
    pub wheel_momentum_max_n_m_s: f64,
    /// Largest residual of the linear momentum balance, kg m/s.
    pub linear_momentum_residual_kg_m_s: f64,
    /// Largest residual of the angular momentum balance, N m s.
    pub angular_momentum_residual_n_m_s: f64,
    /// Largest residual of the energy balance, J.
    pub energy_residual_j: f64,
    /// Energy lost in impacts, J.
    pub impact_loss_j: f64,
    /// Position of the base at the end, world axes, m.
    pub base_position_at_end_m: [f64; 3],
    /// Joint angles at the end, rad.
    pub joint_angles_at_end_rad: [f64; 7],
    /// Smallest angle of each joint, deg.
    pub joint_angles_min_deg: [f64; 7],
    /// Largest angle of each joint, deg.
    pub joint_angles_max_deg: [f64; 7],
    /// Whether the gripper has closed on the target.
    pub grasped: bool,
    /// Stamp of the last sample of the truth, s.
    pub end_s: f64,
}

impl Summary {
    /// As the figures of a run, with `criteria` next to `measures`. If there are criteria and all are met, the
    /// target is captured.
    pub fn figures(self, criteria: Vec<Criterion>, measures: Vec<Measured>) -> Figures {
        let values = serde_json::to_value(&self).expect("a summary is numbers, lists and texts");
        let Value::Object(values) = values else {
            unreachable!("a struct is written as a table");
        };
        let lines = self.lines();
        let mut figures = Figures {
            values,
            lines,
            criteria,
            incomplete: self.incomplete,
            ..Figures::default()
        }
        .with(measures);
        let captured = figures.met() && !figures.criteria.is_empty();
        figures.values.insert("captured".into(), captured.into());
        figures.success = Some("captured");
        figures.headline = Some(match (&figures.incomplete, captured) {
            (Some(reason), _) => format!("no capture: {reason}"),
            (None, true) => "captured".to_owned(),
            (None, false) if figures.criteria.is_empty() => "complete, without a criterion".to_owned(),
            (None, false) => "no capture: a criterion is not met".to_owned(),
        });
        figures
    }

    /// The most important figures, a line each.
    fn lines(&self) -> Vec<String> {
        let lines = [
            ("peak base torque", self.peak_base_torque_n_m, "N m"),
            ("peak base force", self.peak_base_force_n, "N"),
            ("peak joint torque", self.peak_joint_torque_n_m, "N m"),
            ("time in saturation", 100.0 * self.saturated_fraction, "%"),
            ("largest slosh swing", self.slosh_max_deg, "deg"),
            ("wheel momentum", self.wheel_momentum_max_n_m_s, "N m s"),
            ("thruster impulse", self.thruster_impulse_n_s, "N s"),
            ("of the resulting force", self.net_force_impulse_n_s, "N s"),
            (
                "linear momentum residual",
                self.linear_momentum_residual_kg_m_s,
                "kg m/s",
            ),
            (
                "angular momentum residual",
                self.angular_momentum_residual_n_m_s,
                "N m s",
            ),
            ("energy residual", self.energy_residual_j, "J"),
        ];
        let line = |(name, value, unit)| format!("       {name:<28} {} {unit}", three_digits(value));
        lines.map(line).into()
    }
}
