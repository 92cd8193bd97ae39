//! The assessment `capture`: figures of merit and criteria of a capture.

mod capture;
mod criteria;
mod jerk;
mod parameters;
mod peak;
mod summary;

#[cfg(test)]
mod tests;

use engine::assessment::{Assessment, AssessmentSetup};
use lockstep::participant::ParameterError;

pub use summary::Summary;

/// Creates the assessment that the table `assessment` of a scenario describes.
///
/// # Errors
/// Names the key that is rejected, or the stream that is missing.
pub fn from_setup(setup: &AssessmentSetup) -> Result<Box<dyn Assessment>, ParameterError> {
    Ok(Box::new(read(setup)?))
}

fn read(setup: &AssessmentSetup) -> Result<capture::Capture, ParameterError> {
    let parameters = lockstep::units::read(setup.table)?;
    capture::Capture::new(&parameters, setup)
}
