//! From figures to a verdict.

use engine::assessment::Criterion;

use super::parameters::Criteria;
use super::summary::Summary;

const DEGREE: f64 = std::f64::consts::PI / 180.0;

/// Name, unit, figure and limit of a criterion; without a limit there is none.
type Row = (&'static str, &'static str, Option<f64>, Option<f64>);

/// Compares the figures of `summary` with the criteria and puts the verdict in.
pub fn judge(criteria: &Criteria, summary: &mut Summary) {
    let mut judged = Vec::new();
    let rows = at_grasp(criteria, summary)
        .into_iter()
        .chain(on_the_way(criteria, summary))
        .chain(at_the_end(criteria, summary));
    for (name, unit, value, limit) in rows {
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
    }
    summary.captured = summary.incomplete.is_none() && judged.iter().all(|criterion| criterion.met);
    summary.criteria = judged;
}

fn millimetres(metres: Option<f64>) -> Option<f64> {
    metres.map(|value| value * 1e3)
}

fn at_grasp(criteria: &Criteria, summary: &Summary) -> [Row; 4] {
    [
        (
            "position_error_at_grasp",
            "mm",
            millimetres(summary.position_error_at_grasp_m),
            millimetres(criteria.position_error_at_grasp.map(|limit| limit.si())),
        ),
        (
            "attitude_error_at_grasp",
            "deg",
            summary.attitude_error_at_grasp_deg,
            criteria.attitude_error_at_grasp.map(|limit| limit.si() / DEGREE),
        ),
        (
            "relative_speed_at_grasp",
            "mm/s",
            millimetres(summary.relative_speed_at_grasp_m_s),
            millimetres(criteria.relative_speed_at_grasp.map(|limit| limit.si())),
        ),
        (
            "largest_error_after_grasp",
            "mm",
            millimetres(summary.largest_error_after_grasp_m),
            millimetres(criteria.largest_error_after_grasp.map(|limit| limit.si())),
        ),
    ]
}

/// What is looked at over the whole flight: actuators, propellant, conservation, joints.
fn on_the_way(criteria: &Criteria, summary: &Summary) -> [Row; 9] {
    let of = Some::<f64>;
    let (low, high) = (&summary.joint_angles_min_deg, &summary.joint_angles_max_deg);
    [
        (
            "saturated_fraction",
            "1",
            of(summary.saturated_fraction),
            criteria.saturated_fraction,
        ),
        (
            "peak_base_torque",
            "N m",
            of(summary.peak_base_torque_n_m),
            criteria.peak_base_torque.map(|limit| limit.si()),
        ),
        (
            "peak_base_force",
            "N",
            of(summary.peak_base_force_n),
            criteria.peak_base_force.map(|limit| limit.si()),
        ),
        (
            "peak_joint_torque",
            "N m",
            of(summary.peak_joint_torque_n_m),
            criteria.peak_joint_torque.map(|limit| limit.si()),
        ),
        (
            "slosh_max",
            "deg",
            of(summary.slosh_max_deg),
            criteria.slosh_max.map(|limit| limit.si() / DEGREE),
        ),
        (
            "wheel_momentum_max",
            "N m s",
            of(summary.wheel_momentum_max_n_m_s),
            criteria.wheel_momentum_max.map(|limit| limit.si()),
        ),
        (
            "momentum_residual",
            "N m s or kg m/s",
            of(summary
                .linear_momentum_residual_kg_m_s
                .max(summary.angular_momentum_residual_n_m_s)),
            criteria.momentum_residual,
        ),
        (
            "energy_residual",
            "J",
            of(summary.energy_residual_j),
            criteria.energy_residual.map(|limit| limit.si()),
        ),
        (
            "joint_ranges",
            "1",
            criteria.joint_ranges.map(|ranges| {
                let used = (0..7).map(|joint| low[joint].abs().max(high[joint].abs()) * DEGREE / ranges.si()[joint]);
                used.fold(0.0, f64::max)
            }),
            criteria.joint_ranges.map(|_| 1.0),
        ),
    ]
}

fn at_the_end(criteria: &Criteria, summary: &Summary) -> [Row; 2] {
    let of = Some::<f64>;
    [
        (
            "base_rate_at_end",
            "deg/s",
            of(summary.base_rate_at_end_deg_s),
            criteria.base_rate_at_end.map(|limit| limit.si() / DEGREE),
        ),
        (
            "joint_rate_at_end",
            "deg/s",
            of(summary.joint_rate_at_end_deg_s),
            criteria.joint_rate_at_end.map(|limit| limit.si() / DEGREE),
        ),
    ]
}
