//! Errors in a measure, and conversion between units.

use lockstep::units;

/// The key below the measure that is wrong, and why.
pub type Refusal = (String, String);

pub(super) fn refusal<T>(key: &str, reason: impl Into<String>) -> Result<T, Refusal> {
    Err((key.to_owned(), reason.into()))
}

/// The factor from the unit `text` into the unit `unit`.
pub(super) fn conversion_factor(text: &str, unit: &str) -> Result<f64, String> {
    if text == unit {
        return Ok(1.0);
    }
    let (numbers, _) = units::convert(&format!("1 {text}"), unit).map_err(|error| error.to_string())?;
    Ok(numbers[0])
}
