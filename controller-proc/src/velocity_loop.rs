//! The linear part of the law, for analysis of the closed velocity loop.

use lockstep::participant::{ParameterError, Setup};

use crate::parameters::Parameters;

/// The gains of the inner loop below its bound: `u = K_P y + K_I σ`, order of the generalised velocity, SI units.
#[derive(Debug, Clone, PartialEq)]
pub struct VelocityLoop {
    /// K_P by rows; X of `K_P(q) = M(q)^½ X M(q)^½` when scheduled.
    pub kp: [[f64; 13]; 13],
    /// Whether K_P follows the mass matrix.
    pub scheduled: bool,
    /// K_I by rows; none for a proportional law.
    pub ki: Option<[[f64; 13]; 13]>,
}

impl VelocityLoop {
    /// The gains of a controller with these parameters.
    ///
    /// # Errors
    /// Names the rejected parameter.
    pub fn new(setup: &Setup) -> Result<Self, ParameterError> {
        let parameters: Parameters = lockstep::units::read(&setup.parameters)?;
        let feedback = parameters.feedback()?;
        let gains = parameters.gains.gains(&feedback)?;
        // The control model's common mass factor multiplies scheduled gains; a mismatch of single links does not enter here.
        let factor = if gains.is_scheduled() {
            parameters.model.mass_factor
        } else {
            1.0
        };
        let rows = |matrix: &control_laws::Matrix13, factor: f64| {
            std::array::from_fn(|row| std::array::from_fn(|column| factor * matrix[(row, column)]))
        };
        let integrates = feedback != control_laws::inner::FeedbackLaw::Proportional;
        Ok(Self {
            kp: rows(gains.kp(), factor),
            scheduled: gains.is_scheduled(),
            ki: integrates.then(|| rows(gains.ki(), 1.0)),
        })
    }
}
