//! A law's parameter error in the terms of the scenario: its keys, and quantities with their units.

use lockstep::participant::ParameterError;
use lockstep::units::{Angle, AngularMomentum, AngularRate, Force, Length, PerTime, QuantityKind, Speed, Torque};

/// The ending of a field's name, and the text of a value in its unit.
type Unit = (&'static str, fn(f64) -> String);

/// Endings of the laws' field names, and how a value of that unit is written in a scenario. A longer one comes before its own
/// ending.
const UNITS: [Unit; 9] = [
    ("_rad_s", AngularRate::text),
    ("_rad", Angle::text),
    ("_nms", AngularMomentum::text),
    ("_nm", Torque::text),
    ("_1_s", PerTime::text),
    ("_n", Force::text),
    ("_m_s", Speed::text),
    ("_s", |value| format!("{value} s")),
    ("_m", Length::text),
];

/// Maps a law's parameter error to the scenario's key. Field names of the laws end in their units; in the scenario the unit
/// is written with the value instead.
pub fn scenario_error(error: &control_laws::ParameterError) -> ParameterError {
    // prose has no such names in it
    let remedy: Vec<&str> = error.remedy.split(' ').map(key).collect();
    let reason = format!("{} {}", value_text(error), remedy.join(" "));
    ParameterError::new(key(error.field), reason)
}

/// The scenario's key of a law's field.
fn key(field: &str) -> &str {
    match field {
        "outer.attitude.hysteresis" => "outer.hysteresis",
        "outer.weights.arm" => "outer.weights.arm_fixed",
        "outer.weights.arm.near_m" => "outer.weights.near",
        "outer.weights.arm.far_m" => "outer.weights.far",
        "outer.weights.arm.near_weight" => "outer.weights.near_weight",
        "outer.weights.arm.far_weight" => "outer.weights.far_weight",
        "inner.kp" => "gains.kp",
        "inner.ki" => "gains.ki",
        "inner.bound" => "inner",
        "base_position_gain" => "reference.base_position_gain",
        "least_squares_damping" => "reference.least_squares_damping",
        "attitude_gain" => "outer.attitude_gain",
        "position_gain" => "outer.position_gain",
        other => unit(other).map_or(other, |(ending, _)| other.trim_end_matches(ending)),
    }
}

fn unit(field: &str) -> Option<&'static Unit> {
    UNITS.iter().find(|(ending, _)| field.ends_with(ending))
}

/// The refused value, with its unit if it is one number that has one.
fn value_text(error: &control_laws::ParameterError) -> String {
    match (unit(error.field), error.value.parse::<f64>()) {
        // a frequency of a filter is written without the angle's degrees
        (Some(_), Ok(value)) if error.field == "filter.frequency_rad_s" => format!("{value} rad/s"),
        (Some((_, text)), Ok(value)) => text(value),
        _ => error.value.clone(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_have_the_keys_and_units_of_a_scenario() {
        for (field, value, remedy, key, reason) in [
            (
                "outer.weights.arm.far_m",
                1.0,
                "must be larger than outer.weights.arm.near_m",
                "outer.weights.far",
                "1 m must be larger than outer.weights.near",
            ),
            (
                "avoidance.upper_rad",
                170.0_f64.to_radians(),
                "must be above avoidance.lower_rad by more than twice avoidance.margin_rad",
                "avoidance.upper",
                "170 deg must be above avoidance.lower by more than twice avoidance.margin",
            ),
            (
                "rest_speed_m_s",
                -0.002,
                "must be above zero",
                "rest_speed",
                "-2 mm/s must be above zero",
            ),
            (
                "rotation_1_s",
                0.0,
                "must be above zero",
                "rotation",
                "0 1/s must be above zero",
            ),
            (
                "filter.frequency_rad_s",
                -3.0,
                "must be above zero",
                "filter.frequency",
                "-3 rad/s must be above zero",
            ),
            (
                "inner.kp",
                2.0,
                "X must be symmetric",
                "gains.kp",
                "2.0 X must be symmetric",
            ),
        ] {
            let error = scenario_error(&control_laws::ParameterError::new(field, value, remedy));
            assert_eq!((error.key.as_str(), error.reason.as_str()), (key, reason));
        }
    }
}
