//! Command-shaping filter: second order, discretised exactly for a zero-order hold.
//!
//! `ẍ = ω² (u − x) − 2 ξ ω ẋ` on every channel. It turns the virtual velocity of the outer loop into a virtual acceleration `ẋ` that the
//! inner loop can feed forward (Eq 5). It differentiates, so it amplifies noise on its input: noisy measurements must pass through the
//! navigation filter first.

use crate::{Dof, ParameterError};
use serde::{Deserialize, Serialize};

/// User parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FilterParameters {
    /// Natural frequency ω, rad/s.
    pub frequency_rad_s: f64,
    /// Damping ratio ξ.
    pub damping: f64,
}

impl Default for FilterParameters {
    /// ω = 10 rad/s and ξ = 0.9, as in the paper.
    fn default() -> Self {
        Self {
            frequency_rad_s: 10.0,
            damping: 0.9,
        }
    }
}

/// Complete state of the filter, as plain numbers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FilterState {
    /// Whether a first input has been received.
    pub started: bool,
    /// Filtered velocity `x`, order and units of the generalised velocity.
    pub velocity: [f64; 13],
    /// Its rate `ẋ`.
    pub acceleration: [f64; 13],
}

impl FilterState {
    /// Initial state.
    pub const START: Self = Self {
        started: false,
        velocity: [0.0; 13],
        acceleration: [0.0; 13],
    };
}

/// The output of the filter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Filtered {
    /// Filtered velocity.
    pub velocity: Dof,
    /// Virtual acceleration.
    pub acceleration: Dof,
}

/// The filter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShapingFilter {
    transition: [[f64; 2]; 2],
    state: FilterState,
}

impl ShapingFilter {
    /// A filter in its initial state, for inputs held over `period_s`.
    ///
    /// # Errors
    ///
    /// If frequency, damping or period is not above zero.
    pub fn new(parameters: &FilterParameters, period_s: f64) -> Result<Self, ParameterError> {
        let frequency = ParameterError::positive("filter.frequency_rad_s", parameters.frequency_rad_s)?;
        let damping = ParameterError::positive("filter.damping", parameters.damping)?;
        let period_s = ParameterError::positive("period_s", period_s)?;
        Ok(Self {
            transition: transition(frequency, damping, period_s),
            state: FilterState::START,
        })
    }

    /// Complete state of the filter.
    pub fn state(&self) -> &FilterState {
        &self.state
    }

    /// Continues from `state`, bit for bit.
    pub fn restore(&mut self, state: &FilterState) {
        self.state = *state;
    }

    /// Advances by one period with `input` held and returns the resulting state. The first input initialises the filter, at rest.
    ///
    /// The returned state is that at the end of the coming period, not at its start: the force computed from it is held over that
    /// period, and the state at the start would add one period of lag to the feed-forward.
    pub fn step(&mut self, input: &Dof) -> Filtered {
        let state = &mut self.state;
        if !state.started {
            *state = FilterState {
                started: true,
                velocity: (*input).into(),
                acceleration: [0.0; 13],
            };
        }
        let [[a11, a12], [a21, a22]] = self.transition;
        for channel in 0..13 {
            let offset = state.velocity[channel] - input[channel];
            let rate = state.acceleration[channel];
            state.velocity[channel] = input[channel] + a11 * offset + a12 * rate;
            state.acceleration[channel] = a21 * offset + a22 * rate;
        }
        Filtered {
            velocity: state.velocity.into(),
            acceleration: state.acceleration.into(),
        }
    }
}

/// `exp(A T)` for `A = [0 1; −ω² −2ξω]`: the motion of (x − u, ẋ) over a period with the input held.
fn transition(frequency: f64, damping: f64, period_s: f64) -> [[f64; 2]; 2] {
    let decay_rate = damping * frequency;
    // square of the damped angle; negative when overdamped
    let square = frequency * frequency * (1.0 - damping * damping) * period_s * period_s;
    let (cosine, sine_per_rate) = if square.abs() < 1e-6 {
        let cosine = 1.0 - square / 2.0 * (1.0 - square / 12.0);
        (cosine, period_s * (1.0 - square / 6.0 * (1.0 - square / 20.0)))
    } else if square > 0.0 {
        let angle = square.sqrt();
        (libm::cos(angle), period_s * libm::sin(angle) / angle)
    } else {
        let angle = (-square).sqrt();
        (libm::cosh(angle), period_s * libm::sinh(angle) / angle)
    };
    let decay = libm::exp(-decay_rate * period_s);
    [
        [decay * (cosine + decay_rate * sine_per_rate), decay * sine_per_rate],
        [
            -decay * frequency * frequency * sine_per_rate,
            decay * (cosine - decay_rate * sine_per_rate),
        ],
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// One channel by Runge-Kutta with very small steps: an independent solution of the same equation.
    fn integrated(frequency: f64, damping: f64, period_s: f64, mut x: [f64; 2], input: f64) -> [f64; 2] {
        let rate = |x: [f64; 2]| {
            [
                x[1],
                frequency * frequency * (input - x[0]) - 2.0 * damping * frequency * x[1],
            ]
        };
        let steps = 2000;
        let h = period_s / f64::from(steps);
        let plus = |x: [f64; 2], k: [f64; 2], h: f64| [x[0] + h * k[0], x[1] + h * k[1]];
        for _ in 0..steps {
            let k1 = rate(x);
            let k2 = rate(plus(x, k1, h / 2.0));
            let k3 = rate(plus(x, k2, h / 2.0));
            let k4 = rate(plus(x, k3, h));
            for i in 0..2 {
                x[i] += h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
            }
        }
        x
    }

    proptest! {
        #[test]
        fn filter_solves_its_equation_exactly_for_held_input(
            frequency_rad_s in 0.5..20.0,
            damping in prop_oneof![0.05..3.0, Just(1.0), 0.999_999..1.000_001],
            period_s in 1e-3..0.1,
            inputs in proptest::collection::vec(-2.0..2.0, 5),
        ) {
            let mut filter = ShapingFilter::new(&FilterParameters { frequency_rad_s, damping }, period_s).unwrap();
            let mut expected = [inputs[0], 0.0];
            for input in inputs {
                let output = filter.step(&Dof::repeat(input));
                expected = integrated(frequency_rad_s, damping, period_s, expected, input);
                for channel in 0..13 {
                    prop_assert!((output.velocity[channel] - expected[0]).abs() < 1e-10);
                    prop_assert!((output.acceleration[channel] - expected[1]).abs() < 1e-9);
                }
            }
        }
    }

    #[test]
    fn filter_starts_from_the_first_input_at_rest() {
        let mut filter = ShapingFilter::new(&FilterParameters::default(), 0.01).unwrap();
        let input = Dof::from_fn(|channel, _| channel as f64 - 4.0);
        for _ in 0..20 {
            let output = filter.step(&input);
            assert_eq!(output.velocity, input);
            assert_eq!(output.acceleration, Dof::zeros());
        }
    }

    #[test]
    fn invalid_filter_parameter_is_rejected_with_the_field() {
        let refuse = |frequency_rad_s, damping, period_s| {
            ShapingFilter::new(
                &FilterParameters {
                    frequency_rad_s,
                    damping,
                },
                period_s,
            )
            .unwrap_err()
            .field
        };
        assert_eq!(refuse(0.0, 0.9, 0.01), "filter.frequency_rad_s");
        assert_eq!(refuse(10.0, -0.1, 0.01), "filter.damping");
        assert_eq!(refuse(10.0, 0.9, f64::NAN), "period_s");
    }
}
