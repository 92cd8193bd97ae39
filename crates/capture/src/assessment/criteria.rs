//! From figures to a verdict.

use engine::assessment::Criterion;

use super::parameters::Criteria;
use super::summary::Summary;

const DEGREE: f64 = std::f64::consts::PI / 180.0;

/// Compares the figures of `summary` with the criteria and puts the verdict in.
pub fn judge(criteria: &Criteria, summary: &mut Summary) {
    let mut judged = Vec::new();
    let mut at_most = |name: &str, unit: &str, value: Option<f64>, limit: Option<f64>| {
        if let Some(limit) = limit {
            judged.push(Criterion {
                name: name.to_owned(),
                value,
                limit: Some(limit),
                unit: unit.to_owned(),
                // what was not measured, and what is not a number, is not met
                met: value.is_some_and(|value| value <= limit),
                ..Criterion::default()
            });
        }
    };
    let of = Some::<f64>;
    let millimetres = |value: Option<f64>| value.map(|value| value * 1e3);
    at_most(
        "position_error_at_grasp",
        "mm",
        millimetres(summary.position_error_at_grasp_m),
        millimetres(criteria.position_error_at_grasp.map(|limit| limit.si())),
    );
    at_most(
        "attitude_error_at_grasp",
        "deg",
        summary.attitude_error_at_grasp_deg,
        criteria.attitude_error_at_grasp.map(|limit| limit.si() / DEGREE),
    );
    at_most(
        "relative_speed_at_grasp",
        "mm/s",
        millimetres(summary.relative_speed_at_grasp_m_s),
        millimetres(criteria.relative_speed_at_grasp.map(|limit| limit.si())),
    );
    at_most(
        "largest_error_after_grasp",
        "mm",
        millimetres(summary.largest_error_after_grasp_m),
        millimetres(criteria.largest_error_after_grasp.map(|limit| limit.si())),
    );
    at_most(
        "saturated_fraction",
        "1",
        of(summary.saturated_fraction),
        criteria.saturated_fraction,
    );
    at_most(
        "peak_base_torque",
        "N m",
        of(summary.peak_base_torque_n_m),
        criteria.peak_base_torque.map(|limit| limit.si()),
    );
    at_most(
        "peak_base_force",
        "N",
        of(summary.peak_base_force_n),
        criteria.peak_base_force.map(|limit| limit.si()),
    );
    at_most(
        "peak_joint_torque",
        "N m",
        of(summary.peak_joint_torque_n_m),
        criteria.peak_joint_torque.map(|limit| limit.si()),
    );
    at_most(
        "slosh_max",
        "deg",
        of(summary.slosh_max_deg),
        criteria.slosh_max.map(|limit| limit.si() / DEGREE),
    );
    at_most(
        "wheel_momentum_max",
        "N m s",
        of(summary.wheel_momentum_max_n_m_s),
        criteria.wheel_momentum_max.map(|limit| limit.si()),
    );
    at_most(
        "momentum_residual",
        "N m s or kg m/s",
        of(summary
            .linear_momentum_residual_kg_m_s
            .max(summary.angular_momentum_residual_n_m_s)),
        criteria.momentum_residual,
    );
    at_most(
        "energy_residual",
        "J",
        of(summary.energy_residual_j),
        criteria.energy_residual.map(|limit| limit.si()),
    );
    let (low, high) = (&summary.joint_angles_min_deg, &summary.joint_angles_max_deg);
    at_most(
        "joint_ranges",
        "1",
        criteria.joint_ranges.map(|ranges| {
            let used = (0..7).map(|joint| low[joint].abs().max(high[joint].abs()) * DEGREE / ranges.si()[joint]);
            used.fold(0.0, f64::max)
        }),
        criteria.joint_ranges.map(|_| 1.0),
    );
    at_most(
        "base_rate_at_end",
        "deg/s",
        of(summary.base_rate_at_end_deg_s),
        criteria.base_rate_at_end.map(|limit| limit.si() / DEGREE),
    );
    at_most(
        "joint_rate_at_end",
        "deg/s",
        of(summary.joint_rate_at_end_deg_s),
        criteria.joint_rate_at_end.map(|limit| limit.si() / DEGREE),
    );
    summary.captured = summary.incomplete.is_none() && judged.iter().all(|criterion| criterion.met);
    summary.criteria = judged;
}
