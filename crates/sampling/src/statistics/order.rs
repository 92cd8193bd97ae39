//! Percentiles with confidence intervals from order statistics.

/// A percentile of a sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Percentile {
    /// The least value that at least this fraction of the sample does not exceed.
    pub value: f64,
    /// The lower end of the confidence interval of the distribution's percentile; `None` when the sample is too small for one.
    pub low: Option<f64>,
    /// The upper end, likewise.
    pub high: Option<f64>,
}

/// The percentile `part` (in (0, 1)) of values in ascending order, and an interval that contains their distribution's percentile with
/// probability `confidence` or more, half of the rest on each side, for any distribution. `None` for no values.
pub fn percentile(sorted: &[f64], part: f64, confidence: f64) -> Option<Percentile> {
    let n = sorted.len();
    let last = n.checked_sub(1)?;
    let rank = nearest_rank(n, part);
    let (low, high) = rank_bounds(n, part, confidence);
    Some(Percentile {
        value: sorted[rank - 1],
        low: low.checked_sub(1).map(|at| sorted[at]),
        high: (high <= last + 1).then(|| sorted[high - 1]),
    })
}

/// The rank, from 1, of the least of `n` values in ascending order that at least the fraction `part` of them does not exceed. `n` is at
/// least one.
pub fn nearest_rank(n: usize, part: f64) -> usize {
    ((part * n as f64).ceil() as usize).clamp(1, n)
}

/// The ranks, from 1, of the values that enclose the percentile: 0 and n + 1 where no value suffices.
///
/// The number of n values below the percentile has a binomial distribution. The lower rank is the greatest l with
/// P(fewer than l lie below) ≤ (1 - confidence)/2, the upper one the least u with P(u or more lie below) ≤ the same.
pub fn rank_bounds(n: usize, part: f64, confidence: f64) -> (usize, usize) {
    let tail = 0.5 * (1.0 - confidence);
    let count = n as f64;
    let deviation = libm::sqrt(count * part * (1.0 - part));
    // Terms further out do not affect any digit of the sums.
    let first = (count * part - 12.0 * deviation - 12.0).max(0.0) as usize;
    let last = ((count * part + 12.0 * deviation + 12.0) as usize).min(n);
    let log = |k: usize| {
        let k = k as f64;
        libm::lgamma(count + 1.0) - libm::lgamma(k + 1.0) - libm::lgamma(count - k + 1.0)
            + k * libm::log(part)
            + (count - k) * libm::log1p(-part)
    };
    let odds = part / (1.0 - part);
    let mut all = Vec::with_capacity(last - first + 1);
    // From the most likely count outwards, where the terms only decrease.
    let middle = ((count * part) as usize).clamp(first, last);
    let at_middle = libm::exp(log(middle));
    all.resize(last - first + 1, at_middle);
    for k in middle + 1..=last {
        all[k - first] = all[k - first - 1] * (n - k + 1) as f64 / k as f64 * odds;
    }
    for k in (first..middle).rev() {
        all[k - first] = all[k - first + 1] * (k + 1) as f64 / (n - k) as f64 / odds;
    }
    let (mut low, mut below) = (first, 0.0);
    for k in first..=last {
        below += all[k - first];
        if below > tail {
            break;
        }
        low = k + 1;
    }
    let (mut high, mut above) = (last + 1, 0.0);
    for k in (first..=last).rev() {
        above += all[k - first];
        if above > tail {
            break;
        }
        high = k;
    }
    (low.min(n), high.max(1))
}
