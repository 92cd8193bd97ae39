//! Sobol' indices: variance-based sensitivity of a figure to its inputs.

use super::moments::moments;

/// The indices of one input.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Index {
    /// First-order index: the part of the variance due to the input alone.
    pub first: f64,
    /// Half-width of its 95 % confidence interval.
    pub first_half_width: f64,
    /// Total index: the part due to the input, alone or in interaction with others.
    pub total: f64,
    /// Half-width of its 95 % confidence interval.
    pub total_half_width: f64,
}

/// The indices of all inputs. A row holds the figure at a point of A, at a point of B, and for each input at the point of A with this
/// input taken from B. First-order indices use the estimator of Saltelli and others (2010), total ones that of Jansen (1999).
/// `None` for fewer than two rows, or when the figure is constant.
pub fn indices(rows: &[Vec<f64>]) -> Option<Vec<Index>> {
    let n = rows.len();
    let inputs = rows.first()?.len().checked_sub(2)?;
    if n < 2 || rows.iter().any(|row| row.len() != inputs + 2) {
        return None;
    }
    let both: Vec<f64> = rows.iter().flat_map(|row| [row[0], row[1]]).collect();
    let (mean, deviation) = moments(&both)?;
    let variance = deviation * deviation;
    if !(variance > 0.0 && variance.is_finite()) {
        return None;
    }
    let of = |terms: Vec<f64>| -> Option<(f64, f64)> {
        let (mean, deviation) = moments(&terms)?;
        Some((
            mean / variance,
            1.959_963_984_540_054 * deviation / variance / libm::sqrt(n as f64),
        ))
    };
    let all = (2..inputs + 2).map(|input| {
        // Without the mean the terms vary less, and their mean is the same.
        let first = rows.iter().map(|row| (row[1] - mean) * (row[input] - row[0])).collect();
        let total = rows
            .iter()
            .map(|row| 0.5 * (row[0] - row[input]) * (row[0] - row[input]))
            .collect();
        let ((first, first_half_width), (total, total_half_width)) = (of(first)?, of(total)?);
        Some(Index {
            first,
            first_half_width,
            total,
            total_half_width,
        })
    });
    all.collect()
}
