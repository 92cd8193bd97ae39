//! Dispersions of several numbers, read from their keys.

use sampling::distribution::{Correlated, Inertia};

use super::keys::{KeyReader, valid_or_record};
use super::quantity::{Quantity, number};
use super::{AttitudeFormat, Mode, ValueSource};

pub(super) fn correlated(keys: &mut KeyReader<'_>, mode: Mode) -> Option<ValueSource> {
    keys.required_value("deviations", "\"[1, 1, 2] mm\"");
    let mean = match mode {
        Mode::Offset | Mode::Relative if keys.value("mean").is_none() => None,
        _ => {
            keys.required_value("mean", "\"[0, 0, 1] m\"");
            Some(keys.numbers("mean")?)
        }
    };
    let deviations = keys.numbers("deviations")?;
    let mean = mean.unwrap_or_else(|| vec![0.0; deviations.len()]);
    let correlations = match keys.value("correlations") {
        None => None,
        Some(given) => {
            let rows = given.as_array().and_then(|rows| {
                let rows = rows.iter().map(|row| {
                    let row = row.as_array()?;
                    row.iter().map(number).collect::<Option<Vec<f64>>>()
                });
                rows.collect::<Option<Vec<_>>>()
            });
            if rows.is_none() {
                keys.refuse("correlations", format!("{given} is no list of rows of numbers"));
                return None;
            }
            rows
        }
    };
    let distribution = Correlated::new(&mean, &deviations, correlations.as_deref());
    valid_or_record(keys, distribution).map(ValueSource::Correlated)
}

pub(super) fn direction(keys: &mut KeyReader<'_>, kind: &str) -> Option<ValueSource> {
    let length = match keys.value("length") {
        None => Some(1.0),
        Some(_) => keys.number("length"),
    };
    if length.is_some_and(|length| length <= 0.0) {
        keys.refuse("length", "is not above zero");
    }
    if kind == "sphere" {
        return Some(ValueSource::Sphere(length?));
    }
    keys.required_value("axis", "[0, 0, 1]");
    keys.required_value("half-angle", "\"10 deg\"");
    let axis = keys.value("axis").and_then(Quantity::of).map(|axis| axis.numbers);
    let axis = axis.filter(|axis| axis.len() == 3 && axis.iter().any(|x| *x != 0.0));
    if axis.is_none() && keys.value("axis").is_some() {
        keys.refuse(
            "axis",
            "is no direction: write three numbers that are not all zero, such as [0, 0, 1]",
        );
    }
    let half_angle = keys.angle("half-angle")?;
    if !(half_angle > 0.0 && half_angle <= std::f64::consts::PI) {
        keys.refuse("half-angle", "is not above zero and at most 180 deg");
        return None;
    }
    let axis = axis?;
    Some(ValueSource::Cone {
        length: length?,
        axis: [axis[0], axis[1], axis[2]],
        half_angle,
    })
}

pub(super) fn attitude(keys: &mut KeyReader<'_>, kind: &str, own_unit: Option<&str>) -> Option<ValueSource> {
    #[derive(Clone, Copy, PartialEq)]
    enum Notation {
        Quaternion,
        RollPitchYaw,
        Direction,
    }
    let words = [
        ("quaternion", Notation::Quaternion),
        ("roll-pitch-yaw", Notation::RollPitchYaw),
        ("direction", Notation::Direction),
    ];
    let known = if kind == "rotation" { &words[..2] } else { &words[..] };
    let notation = match keys.value("written") {
        None => Notation::Quaternion,
        Some(_) => keys.one_of("written", known)?,
    };
    let frame = match notation {
        Notation::Quaternion => {
            keys.unit = Some(String::new());
            AttitudeFormat::Quaternion
        }
        Notation::Direction => {
            keys.unit = Some(own_unit.unwrap_or_default().to_owned());
            AttitudeFormat::Direction
        }
        Notation::RollPitchYaw => {
            let unit = keys
                .unit
                .clone()
                .or(own_unit.map(str::to_owned))
                .unwrap_or_else(|| "deg".to_owned());
            let per_rad = match lockstep::units::convert("1 rad", &unit) {
                Ok((numbers, _)) => numbers[0],
                Err(error) => {
                    keys.refuse("unit", error.to_string());
                    return None;
                }
            };
            keys.unit = Some(unit);
            AttitudeFormat::RollPitchYaw { per_rad }
        }
    };
    if kind == "rotation" {
        return Some(ValueSource::Rotation(frame));
    }
    keys.required_value("deviation", "\"0.1 deg\"");
    let deviation = keys.angle("deviation")?;
    if deviation <= 0.0 {
        keys.refuse("deviation", "is not above zero");
        return None;
    }
    Some(ValueSource::Misalignment(deviation, frame))
}

pub(super) fn inertia(keys: &mut KeyReader<'_>) -> Option<ValueSource> {
    keys.required_value("log-deviation", "0.05");
    let log_deviation = keys.fraction("log-deviation")?;
    let turn = match keys.value("turn") {
        None => 0.0,
        Some(_) => keys.angle("turn")?,
    };
    if log_deviation < 0.0 || turn < 0.0 || log_deviation + turn == 0.0 {
        keys.refuse("log-deviation", "is not above zero");
        return None;
    }
    Some(ValueSource::Inertia(Inertia {
        log_deviation,
        rotation_deviation: turn,
    }))
}
