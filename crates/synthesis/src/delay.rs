//! Rational approximation of a pure delay.

use crate::state_space::{ModelError, StateSpace};

/// Errors of a delay approximation.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum DelayError {
    /// A delay must be zero or positive, and finite.
    #[error("a delay of {0} s is not possible: it must be zero or positive, and finite")]
    Negative(f64),
    /// The order must lie between 1 and 12: beyond, the coefficients no longer fit a double.
    #[error("order {0} of the approximant is outside 1 to 12")]
    Order(usize),
    /// The transfer function could not be realised.
    #[error(transparent)]
    Model(#[from] ModelError),
}

/// The [order/order] Padé approximant of `exp(−s delay)`, all-pass, DC gain 1; a delay of zero is a gain of one.
///
/// Source: numerator Σ (2n−k)! n! / ((2n)! k! (n−k)!) (−s T)^k, denominator the same with +s T (Golub and Van Loan,
/// *Matrix Computations*, section 9.3). The phase error at ωT is about 2 (ωT/2)^(2n+1) (n!)²/((2n)!(2n+1)!)·2^(2n).
///
/// # Errors
/// A negative or infinite delay, an order outside 1 to 12.
pub fn pade(delay: f64, order: usize) -> Result<StateSpace, DelayError> {
    if !delay.is_finite() || delay < 0.0 {
        return Err(DelayError::Negative(delay));
    }
    if !(1..=12).contains(&order) {
        return Err(DelayError::Order(order));
    }
    if delay == 0.0 {
        return Ok(StateSpace::gain(crate::linalg::diagonal(&[1.0])));
    }
    // Coefficients in rising powers of x = s T; the ratio of neighbours is (n−k)/((2n−k)(k+1)).
    let mut rising = vec![1.0f64];
    for k in 0..order {
        let next = rising[k] * (order - k) as f64 / ((2 * order - k) as f64 * (k + 1) as f64);
        rising.push(next);
    }
    // Realise in the normalised variable, then restore the time scale: well scaled for any delay.
    let denominator: Vec<f64> = rising.iter().rev().copied().collect();
    let numerator: Vec<f64> = rising
        .iter()
        .enumerate()
        .rev()
        .map(|(k, x)| if k % 2 == 0 { *x } else { -x })
        .collect();
    let mut g = StateSpace::transfer_function(&numerator, &denominator)?;
    let per_second = 1.0 / delay;
    g.a = &g.a * per_second;
    g.b = &g.b * per_second;
    Ok(g.balanced())
}
