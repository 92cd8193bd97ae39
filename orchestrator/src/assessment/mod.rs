//! What a run is judged by: figures of merit, computed while the samples pass by.

mod capture;
mod criteria;
mod fields;
mod parameters;
mod summary;

#[cfg(test)]
mod tests;

use lockstep::participant::ParameterError;
use tape::StreamSpec;

pub use summary::{Criterion, Summary};

/// An assessment under way. The order in which samples of different streams arrive does not matter.
pub trait Assessment: Send {
    /// Takes in a sample of stream number `stream` with its stamp, s.
    fn sample(&mut self, stream: usize, stamp_s: f64, payload: &[u8]);

    /// The figures of what has been seen.
    fn finish(&mut self) -> Summary;
}

/// The assessment that the table `assessment` of a scenario describes.
///
/// # Errors
/// Names the key that is refused, or the stream that is missing.
pub fn from_table(table: &toml::Table, streams: &[StreamSpec]) -> Result<Box<dyn Assessment>, ParameterError> {
    let parameters = lockstep::units::read(table)?;
    Ok(Box::new(capture::Capture::new(&parameters, streams)?))
}
