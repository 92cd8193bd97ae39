//! Tick positions of axes.

/// Values at round intervals inside `lo..=hi`, about `count` of them, with their labels.
pub(crate) fn ticks(lo: f64, hi: f64, count: usize) -> Vec<(f64, String)> {
    // Written so that the loop also ends for NaN.
    if !(hi > lo && (hi - lo).is_finite()) {
        return Vec::new();
    }
    let raw = (hi - lo) / count.max(1) as f64;
    let power = 10_f64.powf(raw.log10().floor());
    let factor = [1.0, 2.0, 2.5, 5.0, 10.0]
        .into_iter()
        .find(|f| f * power >= raw * 0.999)
        .unwrap_or(10.0);
    let step = factor * power;
    let size = lo.abs().max(hi.abs());
    let decimals = (-(step.log10() + 1e-9).floor()).max(0.0) as usize + usize::from(factor == 2.5);
    let first = (lo / step - 1e-9).ceil();
    let mut out = Vec::new();
    let mut k = first;
    while k * step <= hi + step * 1e-9 && out.len() < 1000 {
        let value = k * step;
        let text = if value.abs() < step * 1e-6 {
            "0".to_owned()
        } else if !(1e-3..1e5).contains(&size) {
            format!("{value:.1e}")
        } else {
            format!("{value:.decimals$}")
        };
        out.push((value, text.replace('-', "−")));
        k += 1.0;
    }
    out
}

/// The powers of ten from 10^`lo` to 10^`hi`, at most about ten of them, with their labels.
pub(crate) fn decades(lo: f64, hi: f64) -> Vec<(f64, String)> {
    let every = (((hi - lo) / 10.0).ceil() as i32).max(1);
    let powers = (lo.ceil() as i32..=hi.floor() as i32).filter(|power| power % every == 0);
    powers
        .map(|power| {
            let value = 10_f64.powi(power);
            let label = if (-4..=5).contains(&power) {
                format!("{value}")
            } else {
                format!("1e{power}").replace('-', "−")
            };
            (value, label)
        })
        .collect()
}

/// Least and greatest finite value; (0, 1) when there is none.
pub(crate) fn extent(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (lo, hi) = values
        .filter(|value| value.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), value| {
            (lo.min(value), hi.max(value))
        });
    if lo <= hi { (lo, hi) } else { (0.0, 1.0) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(lo: f64, hi: f64, count: usize, expected: &str) {
        let labels: Vec<String> = ticks(lo, hi, count).into_iter().map(|(_, label)| label).collect();
        assert_eq!(labels.join(" "), expected);
    }

    #[test]
    fn ticks_are_round_numbers() {
        check(0.0, 35.0, 4, "0 10 20 30");
        check(-0.21, 0.21, 4, "−0.2 0 0.2");
        check(0.0, 0.9, 4, "0 0.25 0.50 0.75");
        check(0.0, 3e-5, 3, "0 1.0e−5 2.0e−5 3.0e−5");
        check(1.0, 1.0, 4, "");
        check(f64::NAN, 1.0, 4, "");
    }
}
