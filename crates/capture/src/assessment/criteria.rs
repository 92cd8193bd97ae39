//! Criteria that a scenario's measures cannot express.

use engine::assessment::Criterion;

use super::parameters::Criteria;
use super::summary::Summary;

const DEGREE: f64 = std::f64::consts::PI / 180.0;

/// Evaluates `criteria` on the figures of `summary`.
pub fn evaluate_criteria(criteria: &Criteria, summary: &Summary) -> Vec<Criterion> {
    let saturated = criteria.saturated_fraction.map(|limit| {
        let value = summary.saturated_fraction;
        criterion("saturated_fraction", value, limit)
    });
    let ranges = criteria.joint_ranges.map(|ranges| {
        let (low, high) = (&summary.joint_angles_min_deg, &summary.joint_angles_max_deg);
        let used = (0..7).map(|joint| low[joint].abs().max(high[joint].abs()) * DEGREE / ranges.si()[joint]);
        criterion("joint_ranges", used.fold(0.0, f64::max), 1.0)
    });
    saturated.into_iter().chain(ranges).collect()
}

fn criterion(name: &str, value: f64, limit: f64) -> Criterion {
    Criterion {
        name: name.to_owned(),
        value: Some(value),
        limit: Some(limit),
        unit: "1".to_owned(),
        met: value <= limit,
        ..Criterion::default()
    }
}
