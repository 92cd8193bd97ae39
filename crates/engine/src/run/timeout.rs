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
pub(crate) struct Awake {
    last: Instant,
    counted: Duration,
    gap: Duration,
}

impl Awake {
    /// Counts from `now` on.
    pub(crate) fn since(now: Instant) -> Awake {
        Awake {
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
pub(crate) struct Patience {
    awake: Awake,
    limit: Duration,
}

impl Patience {
    /// Starts now, for `limit`.
    pub(crate) fn new(limit: Duration) -> Patience {
        Patience::since(Instant::now(), limit)
    }

    fn since(now: Instant, limit: Duration) -> Patience {
        let mut awake = Awake::since(now);
        // However short the limit is, no suspension uses it up.
        awake.gap = GAP.min(limit / 4);
        Patience { awake, limit }
    }

    /// Starts again now, for the same limit.
    pub(crate) fn renew(&mut self) {
        *self = Patience::new(self.limit);
    }

    /// How much of the limit has been used, s.
    pub(crate) fn used_s(&mut self) -> f64 {
        self.awake.at(Instant::now()).as_secs_f64()
    }

    /// Whether the limit is used up. To be called often.
    pub(crate) fn is_over(&mut self) -> bool {
        self.is_over_at(Instant::now())
    }

    fn is_over_at(&mut self, now: Instant) -> bool {
        self.awake.at(now) >= self.limit
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
    fn a_suspension_uses_up_no_patience() {
        let start = Instant::now();
        for limit in [20, 1000, 60_000] {
            let mut patience = Patience::since(start, ms(limit));
            for suspension in 1..=3 {
                assert!(
                    !patience.is_over_at(start + Duration::from_secs(3600 * suspension)),
                    "{limit}"
                );
            }
        }
    }

    #[test]
    fn time_that_is_looked_at_counts_in_full() {
        let start = Instant::now();
        let mut patience = Patience::since(start, ms(5000));
        let over = (1..).find(|look| patience.is_over_at(start + ms(2 * look)));
        assert_eq!(over, Some(2500));
    }

    #[test]
    fn no_patience_is_over_at_once() {
        let start = Instant::now();
        assert!(Patience::since(start, Duration::ZERO).is_over_at(start));
    }

    #[test]
    fn a_machine_that_answers_slowly_only_takes_longer() {
        let start = Instant::now();
        let mut patience = Patience::since(start, ms(5000));
        let over = (1..).find(|look| patience.is_over_at(start + ms(1000 * look)));
        assert_eq!(over, Some(20));
    }
}
