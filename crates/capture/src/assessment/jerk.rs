//! The jerk of the end effector.

use serde::{Deserialize, Serialize};

/// Maximum difference of two intervals that are the same: stamps are the doubles nearest to exact times.
const SAME_INTERVAL_S: f64 = 1e-9;

/// The integral of the squared jerk, from second differences of the velocity at the controller's samples. The command is
/// held between them, so the jerk at the plant's own rate would be that of the command steps.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct Jerk {
    samples: u64,
    stamps: [f64; 2],
    velocities: [[f64; 3]; 2],
    /// In m²/s⁵.
    pub(super) integral: f64,
}

impl Jerk {
    /// Adds the velocity at `stamp`, the sample of the truth nearest to one of the controller's, which come every `period`. Where the
    /// truth has no sample at the same instant the intervals are unequal: they are those of the stamps.
    pub(super) fn sample(&mut self, stamp: f64, velocity: [f64; 3], period: f64) {
        let [before, last] = self.velocities;
        if self.samples >= 2 {
            let interval = |from: f64, to: f64| match to - from {
                about if (about - period).abs() < SAME_INTERVAL_S => period,
                other => other,
            };
            let (first, second) = (
                interval(self.stamps[0], self.stamps[1]),
                interval(self.stamps[1], stamp),
            );
            // of the parabola through three points; with equal intervals the second difference
            let jerk = |axis: usize| {
                if first == second {
                    (velocity[axis] - 2.0 * last[axis] + before[axis]) / (first * first)
                } else {
                    let slope = |from: f64, to: f64, interval: f64| (to - from) / interval;
                    let change = slope(last[axis], velocity[axis], second) - slope(before[axis], last[axis], first);
                    2.0 * change / (first + second)
                }
            };
            self.integral += (0..3).map(|axis| jerk(axis) * jerk(axis)).sum::<f64>() * second;
        }
        self.stamps = [self.stamps[1], stamp];
        self.velocities = [last, velocity];
        self.samples += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A jerk of 6 m/s³ along x: the velocity is 3 t².
    fn integral(stamps: impl Iterator<Item = f64>, period: f64) -> f64 {
        let mut jerk = Jerk::default();
        stamps.for_each(|t| jerk.sample(t, [3.0 * t * t, 1.0, 0.0], period));
        jerk.integral
    }

    #[test]
    fn constant_jerk_is_found_at_equal_and_unequal_intervals() {
        // 36 m²/s⁶ for 1 s, less the first interval
        let equal = integral((0..=100).map(|k| f64::from(k) * 0.01), 0.01);
        assert!((equal - 36.0 * 0.99).abs() < 1e-8, "{equal}");
        // a controller of 1/150 s: the nearest milliseconds
        let nearest = (0..=150).map(|k| (f64::from(k) / 150.0 * 1000.0).round() / 1000.0);
        let unequal = integral(nearest, 1.0 / 150.0);
        assert!((unequal - 36.0 * 0.993).abs() < 1e-8, "{unequal}");
        // a truth that is slower than the controller
        let slow = integral((0..=50).map(|k| f64::from(k) * 0.02), 0.01);
        assert!((slow - 36.0 * 0.98).abs() < 1e-8, "{slow}");
    }
}
