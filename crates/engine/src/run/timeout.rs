//! Timeouts that count the wall time in which this process ran.
//!
//! A process that is stopped (Ctrl-Z, a paused container, a batch system) or whose machine is suspended sees nothing of what other
//! processes do meanwhile, so that time is no evidence against any of them. `CLOCK_MONOTONIC` stands still while the machine is
//! suspended, but advances while the process, its container or its virtual machine is stopped. So the time between two readings
//! counts only up to a limit.

use std::time::{Duration, Instant};

/// The most that counts of the time between two readings. A loop of the orchestrator reads every few milliseconds; even on the
/// busiest machine it gets a core again after some tens of them.
const GAP: Duration = Duration::from_millis(250);

/// Counts wall time in which this process ran.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ActiveTime {
    last: Instant,
    counted: Duration,
    gap: Duration,
}

impl ActiveTime {
    /// Counts from `now` on.
    pub(crate) fn since(now: Instant) -> ActiveTime {
        ActiveTime {
            last: now,
            counted: Duration::ZERO,
            gap: GAP,
        }
    }

    /// The time counted up to `now`. To be called often.
    pub(crate) fn at(&mut self, now: Instant) -> Duration {
        self.counted += now.saturating_duration_since(self.last).min(self.gap);
        self.last = now;
        self.counted
    }
}

/// A timeout that counts the wall time in which this process ran.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Timeout {
    active: ActiveTime,
    limit: Duration,
}

impl Timeout {
    /// Starts now, for `limit`.
    pub(crate) fn new(limit: Duration) -> Timeout {
        Timeout::since(Instant::now(), limit)
    }

    fn since(now: Instant, limit: Duration) -> Timeout {
        let mut active = ActiveTime::since(now);
        // However short the limit is, no suspension uses it up.
        active.gap = GAP.min(limit / 4);
        Timeout { active, limit }
    }

    /// Starts again now, for the same limit.
    pub(crate) fn restart(&mut self) {
        *self = Timeout::new(self.limit);
    }

    /// How much of the limit has been used, s.
    pub(crate) fn used_s(&mut self) -> f64 {
        self.active.at(Instant::now()).as_secs_f64()
    }

    /// Whether the limit is used up. To be called often.
    pub(crate) fn is_over(&mut self) -> bool {
        self.is_over_at(Instant::now())
    }

    fn is_over_at(&mut self, now: Instant) -> bool {
        self.active.at(now) >= self.limit
    }

    /// The limit, s.
    pub(crate) fn limit_s(&self) -> f64 {
        self.limit.as_secs_f64()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ms(count: u64) -> Duration {
        Duration::from_millis(count)
    }

    #[test]
    fn suspension_uses_up_no_timeout() {
        let start = Instant::now();
        for limit in [20, 1000, 60_000] {
            let mut timeout = Timeout::since(start, ms(limit));
            for suspension in 1..=3 {
                assert!(
                    !timeout.is_over_at(start + Duration::from_secs(3600 * suspension)),
                    "{limit}"
                );
            }
        }
    }

    #[test]
    fn timeout_counts_observed_time_in_full() {
        let start = Instant::now();
        let mut timeout = Timeout::since(start, ms(5000));
        let over = (1..).find(|look| timeout.is_over_at(start + ms(2 * look)));
        assert_eq!(over, Some(2500));
    }

    #[test]
    fn zero_timeout_is_over_at_once() {
        let start = Instant::now();
        assert!(Timeout::since(start, Duration::ZERO).is_over_at(start));
    }

    #[test]
    fn timeout_counts_long_gap_up_to_limit() {
        let start = Instant::now();
        let mut timeout = Timeout::since(start, ms(5000));
        let over = (1..).find(|look| timeout.is_over_at(start + ms(1000 * look)));
        assert_eq!(over, Some(20));
    }
}
