//! Parameter error: the only error that the construction of a law can return.

use thiserror::Error;

/// A parameter outside its range: names the field, the value found and what to write instead.
#[derive(Debug, Clone, PartialEq, Error)]
#[error("{field} = {value}: {remedy}")]
pub struct ParameterError {
    /// The field, as a path below the law's `Parameters`.
    pub field: &'static str,
    /// The rejected value, as text.
    pub value: String,
    /// Remedy: what is allowed.
    pub remedy: &'static str,
}

impl ParameterError {
    /// An error for `field` with the rejected `value` and its `remedy`.
    pub fn new(field: &'static str, value: impl std::fmt::Debug, remedy: &'static str) -> Self {
        Self {
            field,
            value: format!("{value:?}"),
            remedy,
        }
    }

    /// Rejects zero, negative, infinite and NaN values.
    pub fn positive(field: &'static str, value: f64) -> Result<f64, Self> {
        if value.is_finite() && value > 0.0 {
            Ok(value)
        } else {
            Err(Self::new(field, value, "must be a finite number above zero"))
        }
    }

    /// Rejects negative, infinite and NaN values.
    pub fn non_negative(field: &'static str, value: f64) -> Result<f64, Self> {
        if value.is_finite() && value >= 0.0 {
            Ok(value)
        } else {
            Err(Self::new(field, value, "must be a finite number, zero or above"))
        }
    }

    /// Rejects infinite and NaN values.
    pub fn finite(field: &'static str, values: &[f64]) -> Result<(), Self> {
        if values.iter().all(|value| value.is_finite()) {
            Ok(())
        } else {
            Err(Self::new(field, values, "every component must be finite"))
        }
    }
}
