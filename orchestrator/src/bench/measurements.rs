//! Statistics of repeated measurements.

/// Results of repeated measurements, in the order of measurement.
#[derive(Debug, Clone, Default)]
pub struct Measurements(Vec<f64>);

impl Measurements {
    /// Adds a result.
    pub fn add(&mut self, figure: f64) {
        self.0.push(figure);
    }

    /// The percentile: the value below which `percent` of all results lie.
    pub fn percentile(&self, percent: usize) -> f64 {
        let mut sorted = self.0.clone();
        sorted.sort_by(f64::total_cmp);
        let last = sorted.len().saturating_sub(1);
        sorted.get(last * percent / 100).copied().unwrap_or(f64::NAN)
    }

    /// The ratio of each measurement to the one of `other` taken next to it: varying load of the machine affects both.
    pub fn ratios_to(&self, other: &Measurements) -> Measurements {
        Measurements(self.0.iter().zip(&other.0).map(|(one, other)| one / other).collect())
    }
}
