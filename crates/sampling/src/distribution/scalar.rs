//! Scalar distributions.

use super::invalid::{InvalidParameter, invalid};
use super::normal::{cumulative, quantile};

/// A scalar distribution. Values are in any unit, the same for all parameters with a unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Scalar {
    /// Uniform between two bounds.
    Uniform {
        /// The lower bound.
        from: f64,
        /// The upper bound.
        to: f64,
    },
    /// Normal.
    Normal {
        /// The mean.
        mean: f64,
        /// The standard deviation.
        deviation: f64,
    },
    /// Normal, truncated to two bounds.
    TruncatedNormal {
        /// The mean before truncation.
        mean: f64,
        /// The standard deviation before truncation.
        deviation: f64,
        /// The lower bound; may be -∞.
        from: f64,
        /// The upper bound; may be ∞.
        to: f64,
    },
    /// Log-normal: the logarithm is normal.
    LogNormal {
        /// The median.
        median: f64,
        /// The standard deviation of the natural logarithm.
        log_deviation: f64,
    },
    /// Triangular: the density rises linearly to the mode, and falls linearly after it.
    Triangular {
        /// The lower bound.
        from: f64,
        /// The most likely value.
        mode: f64,
        /// The upper bound.
        to: f64,
    },
}

/// Smallest probability mass of a normal distribution that can be sampled.
const MASS_MIN: f64 = 1e-250;

/// Number of standard deviations beyond which a tail of a normal distribution has less than [`MASS_MIN`], rounded down.
const DEVIATIONS_MAX: f64 = 33.0;

impl Scalar {
    /// Checks the parameters.
    ///
    /// # Errors
    /// Names the invalid parameter.
    pub fn check(&self) -> Result<(), InvalidParameter> {
        let ordered = |from: f64, to: f64| {
            if from < to {
                Ok(())
            } else {
                Err(invalid("to", format!("{to} is not above `from` = {from}")))
            }
        };
        let positive = |name, value: f64| {
            if value > 0.0 {
                Ok(())
            } else {
                Err(invalid(name, format!("{value} is not above zero")))
            }
        };
        match *self {
            Scalar::Uniform { from, to } => ordered(from, to),
            Scalar::Normal { deviation, .. } => positive("deviation", deviation),
            Scalar::TruncatedNormal {
                mean,
                deviation,
                from,
                to,
            } => {
                positive("deviation", deviation)?;
                ordered(from, to)?;
                let (low, high) = mirrored((from - mean) / deviation, (to - mean) / deviation);
                if cumulative(high) - cumulative(low) > MASS_MIN {
                    Ok(())
                } else {
                    Err(too_little_mass(mean, deviation, from, to))
                }
            }
            Scalar::LogNormal { median, log_deviation } => {
                positive("median", median)?;
                positive("log-deviation", log_deviation)
            }
            Scalar::Triangular { from, mode, to } => {
                ordered(from, to)?;
                if (from..=to).contains(&mode) {
                    Ok(())
                } else {
                    Err(invalid("mode", format!("{mode} is not from {from} to {to}")))
                }
            }
        }
    }

    /// The quantile, exceeded with probability 1 - `u`, for `u` in (0, 1).
    pub fn quantile(&self, u: f64) -> f64 {
        match *self {
            Scalar::Uniform { from, to } => from + u * (to - from),
            Scalar::Normal { mean, deviation } => mean + deviation * quantile(u),
            Scalar::TruncatedNormal {
                mean,
                deviation,
                from,
                to,
            } => {
                let (from_z, to_z) = ((from - mean) / deviation, (to - mean) / deviation);
                // In the upper tail differences of numbers close to one would lose all digits: there the mirror image is used.
                let is_mirrored = from_z > 0.0;
                let (low, high) = mirrored(from_z, to_z);
                let u = if is_mirrored { 1.0 - u } else { u };
                let z = quantile(cumulative(low) + u * (cumulative(high) - cumulative(low)));
                (mean + deviation * if is_mirrored { -z } else { z }).clamp(from, to)
            }
            Scalar::LogNormal { median, log_deviation } => median * libm::exp(log_deviation * quantile(u)),
            Scalar::Triangular { from, mode, to } => {
                let (width, rise) = (to - from, mode - from);
                if u * width < rise {
                    from + libm::sqrt(u * width * rise)
                } else {
                    to - libm::sqrt((1.0 - u) * width * (to - mode))
                }
            }
        }
    }
}

/// The reason why the part of a normal distribution between two bounds cannot be drawn from: it is far out, or narrow.
fn too_little_mass(mean: f64, deviation: f64, from: f64, to: f64) -> InvalidParameter {
    let (key, bound) = if from > mean { ("from", from) } else { ("to", to) };
    let away = (bound - mean).abs() / deviation;
    if (from..=to).contains(&mean) || away < DEVIATIONS_MAX {
        let reason = format!("{to} is too close to `from` = {from} to draw a number between them: widen the interval");
        return invalid("to", reason);
    }
    let side = if key == "to" { "below" } else { "above" };
    let reason = format!(
        "{bound} is {away:.0} deviations {side} the mean {mean}, and numbers more than {DEVIATIONS_MAX} away cannot be drawn: move it or the mean"
    );
    invalid(key, reason)
}

/// An interval, or its mirror image where it lies above zero.
fn mirrored(from: f64, to: f64) -> (f64, f64) {
    if from > 0.0 { (-to, -from) } else { (from, to) }
}

/// Weighted choice.
#[derive(Debug, Clone, PartialEq)]
pub struct Weights(Vec<f64>);

impl Weights {
    /// One choice for each weight; the weights need not add up to one.
    ///
    /// # Errors
    /// Weights that are negative or not finite, or no weight above zero.
    pub fn new(weights: &[f64]) -> Result<Weights, InvalidParameter> {
        if let Some(wrong) = weights.iter().find(|weight| !(weight.is_finite() && **weight >= 0.0)) {
            return Err(invalid("weights", format!("{wrong} is negative or not finite")));
        }
        let mut sum = 0.0;
        let sums = weights.iter().map(|weight| {
            sum += weight;
            sum
        });
        let sums: Vec<f64> = sums.collect();
        if sum > 0.0 {
            Ok(Weights(sums))
        } else {
            Err(invalid("weights", "none is above zero"))
        }
    }

    /// The choice, from 0, for a number in (0, 1). A choice with zero weight is never made.
    pub fn choice(&self, u: f64) -> usize {
        let all = self.0.last().copied().unwrap_or(0.0);
        let at = self.0.partition_point(|sum| *sum <= u * all);
        // Rounding may put a number at the very end.
        at.min(self.0.partition_point(|sum| *sum < all))
    }
}
