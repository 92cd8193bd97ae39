//! Sobol' indices: which part of a figure's variance comes from which input.

use super::moments::moments;

/// The indices of one input.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Index {
    /// The part of the variance that the input has alone.
    pub first: f64,
    /// Half of the width of its interval with 95 % confidence.
    pub first_half: f64,
    /// The part in which the input takes part, alone or with others.
    pub total: f64,
    /// Half of the width of its interval with 95 % confidence.
    pub total_half: f64,
}

/// The indices of all inputs. A row has the figure at a point of A, at one of B, and for each input at the one that is that of A but
/// for this input, which comes from B. First-order indices are those of Saltelli and others (2010), total ones those of Jansen (1999).
/// `None` of fewer than two rows, or where the figure is constant.
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
        let ((first, first_half), (total, total_half)) = (of(first)?, of(total)?);
        Some(Index {
            first,
            first_half,
            total,
            total_half,
        })
    });
    all.collect()
}
