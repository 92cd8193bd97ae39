//! Distributions of one number.

use super::impossible::{Impossible, impossible};
use super::normal::{cumulative, quantile};

/// A distribution of one number. Values are in any unit, the same for all parameters that have one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Scalar {
    /// Equally likely between two ends.
    Uniform {
        /// The lower end.
        from: f64,
        /// The upper end.
        to: f64,
    },
    /// Normal.
    Normal {
        /// The mean.
        mean: f64,
        /// The standard deviation.
        deviation: f64,
    },
    /// Normal, given that it lies between two ends.
    TruncatedNormal {
        /// The mean before the cut.
        mean: f64,
        /// The standard deviation before the cut.
        deviation: f64,
        /// The lower end; may be -∞.
        from: f64,
        /// The upper end; may be ∞.
        to: f64,
    },
    /// Its logarithm is normal.
    LogNormal {
        /// The median.
        median: f64,
        /// The standard deviation of the natural logarithm.
        log_deviation: f64,
    },
    /// The density rises in a straight line to the mode, and falls in one.
    Triangular {
        /// The lower end.
        from: f64,
        /// The most likely value.
        mode: f64,
        /// The upper end.
        to: f64,
    },
}

/// Less than this of a normal distribution is nothing that can be drawn from.
const NOTHING: f64 = 1e-250;

impl Scalar {
    /// Whether there is such a distribution.
    ///
    /// # Errors
    /// Names the parameter that is wrong.
    pub fn check(&self) -> Result<(), Impossible> {
        let ordered = |from: f64, to: f64| {
            if from < to {
                Ok(())
            } else {
                Err(impossible("to", format!("{to} is not above `from` = {from}")))
            }
        };
        let positive = |name, value: f64| {
            if value > 0.0 {
                Ok(())
            } else {
                Err(impossible(name, format!("{value} is not above zero")))
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
                if cumulative(high) - cumulative(low) > NOTHING {
                    Ok(())
                } else {
                    let text = format!("no draw of a normal distribution around {mean} lies between {from} and {to}");
                    Err(impossible("mean", text))
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
                    Err(impossible("mode", format!("{mode} is not from {from} to {to}")))
                }
            }
        }
    }

    /// The value that a draw exceeds with probability 1 - `u`, for `u` in (0, 1).
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
                // In the upper tail differences of numbers close to one would lose all digits: there the mirror image is drawn.
                let turned = from_z > 0.0;
                let (low, high) = mirrored(from_z, to_z);
                let u = if turned { 1.0 - u } else { u };
                let z = quantile(cumulative(low) + u * (cumulative(high) - cumulative(low)));
                (mean + deviation * if turned { -z } else { z }).clamp(from, to)
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

/// An interval, or its mirror image where it lies above zero.
fn mirrored(from: f64, to: f64) -> (f64, f64) {
    if from > 0.0 { (-to, -from) } else { (from, to) }
}

/// Choices with weights.
#[derive(Debug, Clone, PartialEq)]
pub struct Weights(Vec<f64>);

impl Weights {
    /// One choice for each weight; the weights need not add up to one.
    ///
    /// # Errors
    /// Weights that are negative or not finite, and none above zero.
    pub fn new(weights: &[f64]) -> Result<Weights, Impossible> {
        if let Some(wrong) = weights.iter().find(|weight| !(weight.is_finite() && **weight >= 0.0)) {
            return Err(impossible("weights", format!("{wrong} is negative or not finite")));
        }
        let mut below = 0.0;
        let sums = weights.iter().map(|weight| {
            below += weight;
            below
        });
        let sums: Vec<f64> = sums.collect();
        if below > 0.0 {
            Ok(Weights(sums))
        } else {
            Err(impossible("weights", "none is above zero"))
        }
    }

    /// The choice, from 0, of a number in (0, 1). What has no weight is never chosen.
    pub fn choice(&self, u: f64) -> usize {
        let all = self.0.last().copied().unwrap_or(0.0);
        let at = self.0.partition_point(|sum| *sum <= u * all);
        // Rounding may put a draw at the very end.
        at.min(self.0.partition_point(|sum| *sum < all))
    }
}
