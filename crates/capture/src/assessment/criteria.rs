//! Criteria that a scenario's measures cannot express.

use engine::assessment::Criterion;

use super::parameters::Criteria;
use super::peak::larger;
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
        let used = (0..7).map(|joint| larger(low[joint].abs(), high[joint].abs()) * DEGREE / ranges.si()[joint]);
        criterion("joint_ranges", used.fold(0.0, larger), 1.0)
    });
    saturated.into_iter().chain(ranges).collect()
}

fn criterion(name: &str, value: f64, limit: f64) -> Criterion {
    Criterion {
        name: name.to_owned(),
        value: Some(value).filter(|value| !value.is_nan()),
        limit: Some(limit),
        unit: "1".to_owned(),
        // false for NaN: a figure that could not be computed meets no limit
        met: value <= limit,
        reason: value
            .is_nan()
            .then(|| "a sample that it is computed from is not a number".to_owned()),
        ..Criterion::default()
    }
}
