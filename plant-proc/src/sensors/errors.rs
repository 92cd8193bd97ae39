//! Error model of one sensor with `N` channels.

use lockstep::participant::ParameterError;
use lockstep::random::Stream;
use lockstep::units::{PerAxis, Quantity, QuantityKind, Time};
use serde::{Deserialize, Serialize};

use super::RandomSource;

/// Errors of a sensor, all zero by default.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields, default, bound = "K: QuantityKind")]
pub struct SensorErrorParameters<K, const N: usize> {
    /// Sampling period, a multiple of the plant's period; the last sample is held. The plant's period by default.
    pub period: Option<Quantity<Time>>,
    /// Constant error of each channel.
    pub bias: PerAxis<K, N>,
    /// Standard deviation that the random walk of each channel's error accumulates in one second.
    pub walk: Quantity<K>,
    /// Standard deviation of a slow error of each channel, first-order Gauss-Markov.
    pub drift: Quantity<K>,
    /// Time constant of the slow error.
    pub drift_time: Option<Quantity<Time>>,
    /// Standard deviation of the white noise of each sample.
    pub white: Quantity<K>,
    /// Quantisation step of the reading.
    pub quantum: Quantity<K>,
}

impl<K, const N: usize> Default for SensorErrorParameters<K, N> {
    fn default() -> Self {
        Self {
            period: None,
            bias: PerAxis::of([0.0; N]),
            walk: Quantity::of(0.0),
            drift: Quantity::of(0.0),
            drift_time: None,
            white: Quantity::of(0.0),
            quantum: Quantity::of(0.0),
        }
    }
}

/// State of a sensor's errors.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct SensorErrorState {
    walk: Vec<f64>,
    drift: Vec<f64>,
}

/// The errors of a sensor.
#[derive(Debug, Clone)]
pub struct SensorErrors<const N: usize> {
    every: u64,
    bias: [f64; N],
    /// Standard deviation of the walk's increment per sample.
    walk_step: f64,
    /// Drift: decay factor per sample, standard deviation, and standard deviation of the driving noise.
    drift: (f64, f64, f64),
    white: f64,
    quantum: f64,
    streams: [[Stream; N]; 3],
    walk_errors: [f64; N],
    drift_errors: [f64; N],
}

impl<const N: usize> SensorErrors<N> {
    /// Error model of the sensor with its parameters at `key`.
    ///
    /// # Errors
    /// Names the parameter that is out of range.
    pub fn new<K: QuantityKind>(
        key: &str,
        parameters: &SensorErrorParameters<K, N>,
        source: RandomSource,
    ) -> Result<Self, ParameterError> {
        let refuse = |name: &str, reason: String| ParameterError::new(format!("{key}.{name}"), reason);
        for (name, value) in [
            ("walk", parameters.walk.si()),
            ("drift", parameters.drift.si()),
            ("white", parameters.white.si()),
            ("quantum", parameters.quantum.si()),
        ] {
            if value < 0.0 {
                let reason = format!(
                    "{value} {} is negative; write a size such as \"{}\"",
                    K::DIMENSION,
                    K::EXAMPLE
                );
                return Err(refuse(name, reason));
            }
        }
        let every = period_ratio(parameters.period, source.period).map_err(|reason| refuse("period", reason))?;
        let period = every as f64 * source.period;
        let sigma = parameters.drift.si();
        let decay = match parameters.drift_time.map(|time| time.si()) {
            Some(time) if time > 0.0 => libm::exp(-period / time),
            Some(time) => return Err(refuse("drift_time", format!("{time} s is not above zero"))),
            None if sigma > 0.0 => {
                return Err(refuse(
                    "drift_time",
                    "a drift needs its time constant, such as \"5 s\"".to_owned(),
                ));
            }
            None => 0.0,
        };
        let streams = ["walk", "drift", "white"].map(|what| {
            std::array::from_fn(|channel| {
                let name = format!("{} {key} {what} {channel}", source.participant);
                Stream::new(source.seed, &name)
            })
        });
        let mut errors = Self {
            every,
            bias: parameters.bias.si(),
            walk_step: parameters.walk.si() * period.sqrt(),
            drift: (decay, sigma, sigma * (1.0 - decay * decay).sqrt()),
            white: parameters.white.si(),
            quantum: parameters.quantum.si(),
            streams,
            walk_errors: [0.0; N],
            drift_errors: [0.0; N],
        };
        // the drift is stationary from the start
        for channel in 0..N {
            errors.drift_errors[channel] = sigma * errors.streams[1][channel].normal(0);
        }
        Ok(errors)
    }

    /// Their complete state.
    pub fn state(&self) -> SensorErrorState {
        SensorErrorState {
            walk: self.walk_errors.to_vec(),
            drift: self.drift_errors.to_vec(),
        }
    }

    /// Continues from `state`; a state with another number of channels is ignored.
    pub fn restore(&mut self, state: &SensorErrorState) {
        if let (Ok(walk), Ok(drift)) = (state.walk[..].try_into(), state.drift[..].try_into()) {
            (self.walk_errors, self.drift_errors) = (walk, drift);
        }
    }

    /// Whether a reading depends on earlier ones: it is held, or its error is a walk or a drift.
    pub fn has_memory(&self) -> bool {
        self.every > 1 || self.walk_step > 0.0 || self.drift.1 > 0.0
    }

    /// The number of the sample taken at the plant's output number `k`, if one is due.
    pub fn due(&self, k: u64) -> Option<u64> {
        k.is_multiple_of(self.every).then(|| k / self.every)
    }

    /// The error of sample number `n`, without quantisation. Samples are taken in order.
    pub fn error(&mut self, n: u64) -> [f64; N] {
        let [walk, drift, white] = &self.streams;
        let (decay, sigma, driving_sigma) = self.drift;
        std::array::from_fn(|channel| {
            if n > 0 && self.walk_step > 0.0 {
                self.walk_errors[channel] += self.walk_step * walk[channel].normal(n);
            }
            if n > 0 && sigma > 0.0 {
                self.drift_errors[channel] =
                    decay * self.drift_errors[channel] + driving_sigma * drift[channel].normal(n);
            }
            let mut error = self.bias[channel] + self.walk_errors[channel] + self.drift_errors[channel];
            if self.white > 0.0 {
                error += self.white * white[channel].normal(n);
            }
            error
        })
    }

    /// The reading nearest to `value`.
    pub fn quantised(&self, value: f64) -> f64 {
        if self.quantum > 0.0 {
            (value / self.quantum).round_ties_even() * self.quantum
        } else {
            value
        }
    }

    /// The sensor's reading of these values in sample number `n`.
    pub fn read(&mut self, n: u64, values: [f64; N]) -> [f64; N] {
        let error = self.error(n);
        std::array::from_fn(|channel| self.quantised(values[channel] + error[channel]))
    }
}

/// Number of plant periods in one sensor period.
pub fn period_ratio(period: Option<Quantity<Time>>, plant: f64) -> Result<u64, String> {
    let Some(period) = period.map(|period| period.si()) else {
        return Ok(1);
    };
    let every = (period / plant).round_ties_even();
    if !(1.0..1e9).contains(&every) || (every * plant - period).abs() > 1e-9 * period {
        return Err(format!(
            "{period} s is not a multiple of the plant's period, {plant} s; a sensor samples at the plant's instants"
        ));
    }
    Ok(every as u64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use lockstep::units::Length;

    fn errors(parameters: &SensorErrorParameters<Length, 3>) -> SensorErrors<3> {
        let source = RandomSource {
            seed: 7,
            participant: "plant",
            period: 0.001,
        };
        SensorErrors::new("sensors.position", parameters, source).unwrap()
    }

    #[test]
    fn sensor_is_exact_by_default() {
        let mut exact = errors(&SensorErrorParameters::default());
        assert_eq!(exact.read(0, [0.1, -0.2, 1e9]), [0.1, -0.2, 1e9]);
    }

    #[test]
    fn drift_has_its_deviation_and_time_constant() {
        let mut drifting = errors(&SensorErrorParameters {
            drift: Quantity::of(0.003),
            drift_time: Some(Quantity::of(5.0)),
            period: Some(Quantity::of(0.1)),
            ..SensorErrorParameters::default()
        });
        let n = 200_000;
        let x: Vec<f64> = (0..n).map(|i| drifting.error(i)[0]).collect();
        let correlation = |lag: usize| x.iter().zip(&x[lag..]).map(|(a, b)| a * b).sum::<f64>() / n as f64;
        assert!(
            (correlation(0).sqrt() - 0.003).abs() < 0.0003,
            "{}",
            correlation(0).sqrt()
        );
        // after 5 s, fifty samples, the correlation is 1/e
        assert!((correlation(50) / correlation(0) - 0.3679).abs() < 0.06);
    }

    #[test]
    fn random_walk_grows_with_the_root_of_time() {
        let parameters = SensorErrorParameters::<Length, 3> {
            walk: Quantity::of(0.01),
            ..SensorErrorParameters::default()
        };
        let ends: Vec<f64> = (0..300)
            .flat_map(|seed| {
                let source = RandomSource {
                    seed,
                    participant: "plant",
                    period: 0.001,
                };
                let mut walking = SensorErrors::new("a", &parameters, source).unwrap();
                (0..4000).map(|n| walking.error(n)).last().unwrap()
            })
            .collect();
        let sigma = (ends.iter().map(|x| x * x).sum::<f64>() / ends.len() as f64).sqrt();
        assert!((sigma - 0.02).abs() < 0.002, "{sigma}");
    }

    #[test]
    fn samples_are_taken_at_multiples_of_the_plants_period() {
        let slow = errors(&SensorErrorParameters {
            period: Some(Quantity::of(0.01)),
            ..SensorErrorParameters::default()
        });
        assert_eq!((slow.due(0), slow.due(9), slow.due(30)), (Some(0), None, Some(3)));
        assert!(
            period_ratio(Some(Quantity::of(0.0015)), 0.001)
                .unwrap_err()
                .contains("multiple")
        );
    }
}
