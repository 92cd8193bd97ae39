//! Confidence interval of a proportion.

/// Number of standard deviations about the mean that contain 95 % of a normal distribution.
pub const NORMAL_95: f64 = 1.959_963_984_540_054;

/// Wilson's 95 % confidence interval of a proportion when `good` of `all` samples were good.
pub fn wilson(good: usize, all: usize) -> (f64, f64) {
    if all == 0 {
        return (0.0, 1.0);
    }
    let (z, n) = (NORMAL_95, all as f64);
    let share = good as f64 / n;
    let middle = share + z * z / (2.0 * n);
    let half = z * (share * (1.0 - share) / n + z * z / (4.0 * n * n)).sqrt();
    let scale = 1.0 + z * z / n;
    // Without or with nothing but good samples an end is exact, and rounding must not show.
    let low = if good == 0 { 0.0 } else { (middle - half) / scale };
    let high = if good == all { 1.0 } else { (middle + half) / scale };
    (low.max(0.0), high.min(1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wilson_interval_matches_closed_form() {
        let (low, high) = wilson(97, 100);
        // 0.9155 to 0.9897
        assert!(
            (low - 0.9155).abs() < 1e-4 && (high - 0.9897).abs() < 1e-4,
            "{low} {high}"
        );
        assert_eq!(wilson(0, 0), (0.0, 1.0));
        assert_eq!((wilson(0, 4000).0, wilson(4000, 4000).1), (0.0, 1.0));
    }
}
