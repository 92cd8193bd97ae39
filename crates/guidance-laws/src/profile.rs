//! The time law of every guided motion: a quintic with zero rate and zero acceleration at both ends.

/// A value between 0 and 1 and its rate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimeScaling {
    /// 0 before the motion, 1 after it.
    pub value: f64,
    /// Rate of `value`, 1/s.
    pub rate: f64,
    /// Second derivative of `value`, 1/s².
    pub acceleration: f64,
}

/// Progress at `time_s` of a motion from `start_s` to `end_s`: `s(x) = 10 x³ − 15 x⁴ + 6 x⁵`.
///
/// Zero rate and acceleration at both ends matter: with a rate step at the start alone the shaping filter demands several times
/// the force of the whole approach.
pub fn quintic(time_s: f64, start_s: f64, end_s: f64) -> TimeScaling {
    let duration_s = end_s - start_s;
    let x = (time_s - start_s) / duration_s;
    if x <= 0.0 {
        return TimeScaling {
            value: 0.0,
            rate: 0.0,
            acceleration: 0.0,
        };
    }
    if x >= 1.0 {
        return TimeScaling {
            value: 1.0,
            rate: 0.0,
            acceleration: 0.0,
        };
    }
    let rest = 1.0 - x;
    TimeScaling {
        value: x * x * x * (10.0 + x * (6.0 * x - 15.0)),
        rate: 30.0 * x * x * rest * rest / duration_s,
        acceleration: 60.0 * x * rest * (1.0 - 2.0 * x) / (duration_s * duration_s),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_are_at_rest_and_held() {
        for time_s in [-3.0, 1.0, 30.0, 99.0] {
            let progress = quintic(time_s, 1.0, 30.0);
            assert_eq!(progress.value, if time_s > 1.0 { 1.0 } else { 0.0 });
            assert_eq!((progress.rate, progress.acceleration), (0.0, 0.0));
        }
        assert_eq!(quintic(15.5, 1.0, 30.0).value, 0.5);
    }

    #[test]
    fn derivatives_agree_with_finite_differences() {
        let step_s = 1e-5;
        for tick in 1..290 {
            let time_s = 1.0 + 0.1 * f64::from(tick);
            let [before, now, after] = [-step_s, 0.0, step_s].map(|offset| quintic(time_s + offset, 1.0, 30.0));
            let rate = (after.value - before.value) / (2.0 * step_s);
            let acceleration = (after.rate - before.rate) / (2.0 * step_s);
            assert!((rate - now.rate).abs() < 1e-9, "{time_s}: {rate} {}", now.rate);
            assert!(
                (acceleration - now.acceleration).abs() < 1e-9,
                "{time_s}: {acceleration} {}",
                now.acceleration
            );
        }
    }
}
