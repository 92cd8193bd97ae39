//! The body of an FMU: one participant, or a whole scenario.

use lockstep::time::Rational;

use crate::parameter::Parameter;
use crate::refusal::Refusal;
use crate::variable::Ports;

/// The tolerance for instants and steps, relative to a period: importers add up times in doubles.
const TOLERANCE: f64 = 1e-3;

/// A state between two steps.
pub struct State {
    /// As bytes, for any instance of the same FMU.
    pub bytes: Vec<u8>,
    /// For fast restoring by the instance that saved it.
    pub checkpoint: Option<engine::run::Checkpoint>,
}

/// The body that is stepped.
pub trait Body {
    /// Its ports.
    fn ports(&self) -> &Ports;

    /// Starts at `start` with `parameters`; any earlier execution is discarded. Inputs keep their values.
    ///
    /// # Errors
    /// A parameter that is rejected, or the reason why the body cannot start.
    fn begin(&mut self, parameters: &[Parameter], start: Rational) -> Result<(), String>;

    /// Resets to the state after construction.
    fn reset(&mut self);

    /// The instant up to which the body has been stepped, s.
    fn time(&self) -> f64;

    /// The payload of input number `port`.
    fn input(&self, port: usize) -> &[u8];

    /// Copies `bytes` into the payload of input number `port`, starting at byte `at`.
    fn set(&mut self, port: usize, at: usize, bytes: &[u8]);

    /// The payload of output number `port` at [`Body::time`].
    ///
    /// # Errors
    /// When the output must be computed for this and the computation fails.
    fn output(&mut self, port: usize) -> Result<&[u8], String>;

    /// Figure of merit number `number`.
    ///
    /// # Errors
    /// When it cannot be computed.
    fn figure(&mut self, number: usize) -> Result<f64, String>;

    /// Steps from `from` to `from + span`, s.
    ///
    /// # Errors
    /// An impossible step is discarded.
    fn advance(&mut self, from: f64, span: f64) -> Result<(), Refusal>;

    /// The log lines of participants since the last call.
    fn take_log_lines(&mut self) -> Vec<String>;

    /// Whether the end of the scenario has been reached.
    fn is_over(&self) -> bool {
        false
    }

    /// The state.
    ///
    /// # Errors
    /// When it cannot be saved.
    fn save(&mut self) -> Result<State, String>;

    /// Restores a state; `parameters` are those with which it was begun.
    ///
    /// # Errors
    /// When the state is damaged or from another FMU.
    fn restore(&mut self, parameters: &[Parameter], state: &State) -> Result<(), String>;
}

/// The number of steps of `period` between `now` and `from + span`, if `from` equals `now`.
///
/// # Errors
/// States which steps are allowed.
pub fn whole_steps(now: f64, period: f64, from: f64, span: f64) -> Result<u64, Refusal> {
    if from.is_nan() || (from - now).abs() > TOLERANCE * period {
        return Err(Refusal::error(format!(
            "the step begins at t = {from} s, but it stands at t = {now} s: a step begins where the one before it ended"
        )));
    }
    let count = (span / period).round();
    let fits = (1.0..1e15).contains(&count) && (span - count * period).abs() <= TOLERANCE * period;
    if !fits {
        return Err(Refusal::discard(format!(
            "a communication step of {span} s is no whole multiple of {period} s: give steps of {period} s, or a whole multiple of it"
        )));
    }
    Ok(count as u64)
}

/// The fraction with the smallest denominator that is nearest to the double `value`, s: 0.01 is 1/100.
///
/// # Errors
/// When it is not finite, or needs more than 63 bits.
pub fn exact(value: f64) -> Result<Rational, String> {
    let refuse = || format!("{value} s is no instant: give a finite number of at most 2^40 s");
    if !value.is_finite() || value.abs() > f64::from(1 << 20) * f64::from(1 << 20) {
        return Err(refuse());
    }
    // Convergents of the continued fraction; the result is the first one that rounds to the value.
    let (mut before, mut last) = ((0_i128, 1_i128), (1_i128, 0_i128));
    let mut rest = value.abs();
    for _ in 0..64 {
        let whole = rest.floor();
        let next = (whole as i128 * last.0 + before.0, whole as i128 * last.1 + before.1);
        let found = Rational::new(next.0, next.1).ok_or_else(refuse)?;
        if found.seconds() == value.abs() {
            return Rational::new(if value < 0.0 { -next.0 } else { next.0 }, next.1).ok_or_else(refuse);
        }
        (before, last) = (last, next);
        rest = 1.0 / (rest - whole);
    }
    Err(refuse())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::refusal::Status;

    #[test]
    fn nearest_fraction_recovers_decimal_instant() {
        for (value, numerator, denominator) in [
            (0.0, 0, 1),
            (0.01, 1, 100),
            (1.0 / 300.0, 1, 300),
            (12.5, 25, 2),
            (-0.1, -1, 10),
            (3600.001, 3_600_001, 1000),
        ] {
            assert_eq!(
                exact(value),
                Ok(Rational::new(numerator, denominator).unwrap()),
                "{value}"
            );
        }
        assert!(exact(f64::NAN).is_err());
        assert!(exact(1e300).is_err());
    }

    #[test]
    fn step_is_a_whole_number_of_periods() {
        assert_eq!(whole_steps(0.1, 0.01, 0.1, 0.01).unwrap(), 1);
        // Summed up as an importer does.
        assert_eq!(whole_steps(0.3, 0.1, 0.1 + 0.2, 0.30000000000000004).unwrap(), 3);
        assert_eq!(whole_steps(0.1, 0.01, 0.1, 0.015).unwrap_err().status, Status::Discard);
        assert_eq!(whole_steps(0.1, 0.01, 0.1, 0.0).unwrap_err().status, Status::Discard);
        assert_eq!(
            whole_steps(0.1, 0.01, 0.1, f64::NAN).unwrap_err().status,
            Status::Discard
        );
        assert_eq!(whole_steps(0.1, 0.01, 0.2, 0.01).unwrap_err().status, Status::Error);
    }
}
