//! The assessment `capture`: figures of merit and criteria of a capture.

mod capture;
mod criteria;
mod parameters;
mod peak;
mod summary;

#[cfg(test)]
mod tests;

use engine::assessment::Assessment;
use lockstep::participant::ParameterError;
use tape::StreamSpec;

pub use summary::Summary;

/// Creates the assessment that the table `assessment` of a scenario describes.
///
/// # Errors
/// Names the key that is rejected, or the stream that is missing.
pub fn from_table(table: &toml::Table, streams: &[StreamSpec]) -> Result<Box<dyn Assessment>, ParameterError> {
    Ok(Box::new(read(table, streams)?))
}

fn read(table: &toml::Table, streams: &[StreamSpec]) -> Result<capture::Capture, ParameterError> {
    let parameters = lockstep::units::read(table)?;
    capture::Capture::new(&parameters, streams)
}
