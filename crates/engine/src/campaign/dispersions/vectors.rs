//! Dispersions of several numbers, read from their keys.

use sampling::distribution::{Correlated, Inertia};

use super::keys::{Keys, possible};
use super::quantity::{Quantity, number};
use super::{Draws, Frame, Mode};

pub(super) fn correlated(keys: &mut Keys<'_>, mode: Mode) -> Option<Draws> {
    keys.need("deviations", "\"[1, 1, 2] mm\"");
    let mean = match mode {
        Mode::Offset | Mode::Relative if keys.value("mean").is_none() => None,
        _ => {
            keys.need("mean", "\"[0, 0, 1] m\"");
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
    let made = Correlated::new(&mean, &deviations, correlations.as_deref());
    possible(keys, made).map(Draws::Correlated)
}

pub(super) fn direction(keys: &mut Keys<'_>, kind: &str) -> Option<Draws> {
    let length = match keys.value("length") {
        None => Some(1.0),
        Some(_) => keys.number("length"),
    };
    if length.is_some_and(|length| length <= 0.0) {
        keys.refuse("length", "is not above zero");
    }
    if kind == "sphere" {
        return Some(Draws::Sphere(length?));
    }
    keys.need("axis", "[0, 0, 1]");
    keys.need("half-angle", "\"10 deg\"");
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
    Some(Draws::Cone {
        length: length?,
        axis: [axis[0], axis[1], axis[2]],
        half_angle,
    })
}

pub(super) fn attitude(keys: &mut Keys<'_>, kind: &str, own_unit: Option<&str>) -> Option<Draws> {
    #[derive(Clone, Copy, PartialEq)]
    enum Written {
        Quaternion,
        RollPitchYaw,
        Direction,
    }
    let words = [
        ("quaternion", Written::Quaternion),
        ("roll-pitch-yaw", Written::RollPitchYaw),
        ("direction", Written::Direction),
    ];
    let known = if kind == "rotation" { &words[..2] } else { &words[..] };
    let written = match keys.value("written") {
        None => Written::Quaternion,
        Some(_) => keys.word("written", known)?,
    };
    let frame = match written {
        Written::Quaternion => {
            keys.unit = Some(String::new());
            Frame::Quaternion
        }
        Written::Direction => {
            keys.unit = Some(own_unit.unwrap_or_default().to_owned());
            Frame::Direction
        }
        Written::RollPitchYaw => {
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
            Frame::RollPitchYaw { per_rad }
        }
    };
    if kind == "rotation" {
        return Some(Draws::Rotation(frame));
    }
    keys.need("deviation", "\"0.1 deg\"");
    let deviation = keys.angle("deviation")?;
    if deviation <= 0.0 {
        keys.refuse("deviation", "is not above zero");
        return None;
    }
    Some(Draws::Misalignment(deviation, frame))
}

pub(super) fn inertia(keys: &mut Keys<'_>) -> Option<Draws> {
    keys.need("log-deviation", "0.05");
    let log_deviation = keys.part("log-deviation")?;
    let turn = match keys.value("turn") {
        None => 0.0,
        Some(_) => keys.angle("turn")?,
    };
    if log_deviation < 0.0 || turn < 0.0 || log_deviation + turn == 0.0 {
        keys.refuse("log-deviation", "is not above zero");
        return None;
    }
    Some(Draws::Inertia(Inertia { log_deviation, turn }))
}
