//! Values in a scenario: lengths, angles, directions, colours, fields.

use lockstep::units;
use toml::Value;

use crate::view::Signal;

/// A number in `unit`, or a quantity with a unit of the same dimension; returned in `unit`.
pub(super) fn quantity(value: &Value, unit: &str) -> Result<f64, String> {
    let number = match value {
        Value::Float(x) => Some(*x),
        Value::Integer(x) => Some(*x as f64),
        Value::String(text) => match units::convert(text, unit) {
            Ok((values, false)) => values.first().copied(),
            Ok(_) => None,
            Err(error) => return Err(error.to_string()),
        },
        _ => None,
    };
    let number = number.filter(|x| x.is_finite());
    number.ok_or_else(|| format!("`{value}` is not a single quantity: write one such as \"0.5 {unit}\""))
}

/// A quantity above zero.
pub(super) fn positive(value: &Value, unit: &str) -> Result<f64, String> {
    let number = quantity(value, unit)?;
    if number > 0.0 {
        Ok(number)
    } else {
        Err(format!(
            "{value} is not above zero: write a quantity such as \"0.5 {unit}\""
        ))
    }
}

/// Three quantities: `["1 m", 0, "20 cm"]` or `"[1, 0, 0.2] m"`.
pub(super) fn vector3(value: &Value, unit: &str) -> Result<[f64; 3], String> {
    let numbers = match value {
        Value::Array(items) => items
            .iter()
            .map(|item| quantity(item, unit))
            .collect::<Result<Vec<f64>, String>>()?,
        Value::String(text) => units::convert(text, unit).map_err(|error| error.to_string())?.0,
        _ => Vec::new(),
    };
    let finite = <[f64; 3]>::try_from(numbers)
        .ok()
        .filter(|all| all.iter().all(|x| x.is_finite()));
    finite.ok_or_else(|| format!("`{value}` is not three quantities: write such as \"[1, 0, 0.5] {unit}\""))
}

/// Three numbers that are not all zero.
pub(super) fn direction(value: &Value) -> Result<[f64; 3], String> {
    let number = |item: &Value| item.as_float().or_else(|| item.as_integer().map(|x| x as f64));
    let numbers: Option<Vec<f64>> = value.as_array().and_then(|items| items.iter().map(number).collect());
    let vector3 = numbers.and_then(|numbers| <[f64; 3]>::try_from(numbers).ok());
    let vector3 = vector3.filter(|all| all.iter().all(|x| x.is_finite()) && all.iter().any(|x| *x != 0.0));
    vector3.ok_or_else(|| {
        format!("`{value}` is not a direction: write three numbers that are not all zero, such as [0, 0, 1]")
    })
}

/// `"#3366cc"` as red, green and blue from 0 to 1.
pub(super) fn colour(value: &Value) -> Result<[f64; 3], String> {
    let text = value.as_str().unwrap_or_default();
    let digits = text
        .strip_prefix('#')
        .filter(|digits| digits.len() == 6 && digits.is_ascii());
    let part = |at: usize| {
        u8::from_str_radix(digits?.get(at..at + 2)?, 16)
            .ok()
            .map(|x| f64::from(x) / 255.0)
    };
    match (part(0), part(2), part(4)) {
        (Some(r), Some(g), Some(b)) => Ok([r, g, b]),
        _ => Err(format!(
            "`{text}` is not a colour: write red, green and blue in hexadecimal, such as \"#3366cc\""
        )),
    }
}

pub(super) fn boolean(value: &Value) -> Result<bool, String> {
    value
        .as_bool()
        .ok_or_else(|| format!("`{value}` is neither true nor false"))
}

pub(super) fn signal(text: &str) -> Result<Signal, String> {
    Signal::named(text).ok_or_else(|| {
        format!("`{text}` is not a signal: write PARTICIPANT.OUTPUT.FIELD, such as \"plant.motion.position\" or \"plant.truth.q[2]\"")
    })
}
