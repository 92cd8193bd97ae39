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

/// The percentile `fraction` (in (0, 1)) of values in ascending order, and an interval that contains their distribution's percentile with
/// probability `confidence` or more, half of the rest on each side, for any distribution. `None` for no values.
pub fn percentile(sorted: &[f64], fraction: f64, confidence: f64) -> Option<Percentile> {
    let n = sorted.len();
    let last = n.checked_sub(1)?;
    let rank = nearest_rank(n, fraction);
    let (low, high) = rank_bounds(n, fraction, confidence);
    Some(Percentile {
        value: sorted[rank - 1],
        low: low.checked_sub(1).map(|at| sorted[at]),
        high: (high <= last + 1).then(|| sorted[high - 1]),
    })
}

/// The rank, from 1, of the least of `n` values in ascending order that at least `fraction` of them do not exceed. `n` is at
/// least one.
pub fn nearest_rank(n: usize, fraction: f64) -> usize {
    ((fraction * n as f64).ceil() as usize).clamp(1, n)
}

/// The ranks, from 1, of the values that enclose the percentile: 0 and n + 1 where no value suffices.
///
/// The number of n values below the percentile has a binomial distribution. The lower rank is the greatest l with
/// P(fewer than l lie below) ≤ (1 - confidence)/2, the upper one the least u with P(u or more lie below) ≤ the same.
pub fn rank_bounds(n: usize, fraction: f64, confidence: f64) -> (usize, usize) {
    let tail = 0.5 * (1.0 - confidence);
    let count = n as f64;
    let deviation = libm::sqrt(count * fraction * (1.0 - fraction));
    // Terms further out do not affect any digit of the sums.
    let first = (count * fraction - 12.0 * deviation - 12.0).max(0.0) as usize;
    let last = ((count * fraction + 12.0 * deviation + 12.0) as usize).min(n);
    let log = |k: usize| {
        let k = k as f64;
        libm::lgamma(count + 1.0) - libm::lgamma(k + 1.0) - libm::lgamma(count - k + 1.0)
            + k * libm::log(fraction)
            + (count - k) * libm::log1p(-fraction)
    };
    let odds = fraction / (1.0 - fraction);
    let mut all = Vec::with_capacity(last - first + 1);
    // From the most likely count outwards, where the terms only decrease.
    let middle = ((count * fraction) as usize).clamp(first, last);
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
