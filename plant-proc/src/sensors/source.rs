//! Source of the sensors' random numbers.

/// Source of a sensor's random numbers.
#[derive(Debug, Clone, Copy)]
pub struct RandomSource<'a> {
    /// The seed of the run.
    pub seed: u64,
    /// The participant's name.
    pub participant: &'a str,
    /// The period of the plant, s.
    pub period: f64,
}
