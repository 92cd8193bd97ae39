//! Compensated summation.

use serde::{Deserialize, Serialize};

/// A running sum with its accumulated rounding error (Neumaier's algorithm).
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
pub(super) struct CompensatedSum {
    sum: f64,
    compensation: f64,
}

impl CompensatedSum {
    /// Adds a term.
    pub(super) fn add(&mut self, term: f64) {
        let sum = self.sum + term;
        self.compensation += if self.sum.abs() >= term.abs() {
            (self.sum - sum) + term
        } else {
            (term - sum) + self.sum
        };
        self.sum = sum;
    }

    /// The sum of all terms.
    pub(super) fn value(&self) -> f64 {
        self.sum + self.compensation
    }
}

#[cfg(test)]
mod tests {
    use super::CompensatedSum;

    #[test]
    fn compensated_sum_keeps_small_terms_beside_large_ones() {
        let mut total = CompensatedSum::default();
        for term in [1.0, 1e100, 1.0, -1e100] {
            total.add(term);
        }
        assert_eq!(total.value(), 2.0);
    }
}
