//! The pace of the wall clock: which simulated time has come, and when an instant was due.

use std::collections::VecDeque;

use lockstep::time::Ticks;

use super::suspensions::Suspensions;

/// How many stretches without a pause are retained: a step is evaluated soon after it is done.
const STRETCHES: usize = 1024;

/// Keeps simulated time behind a multiple of wall time, counting only wall time in which this process was not suspended and the run
/// was not paused.
pub(crate) struct Pace {
    ticks_per_s: f64,
    suspensions: Suspensions,
    /// The points from which the wall clock ran, the newest last. Never empty.
    stretches: VecDeque<Stretch>,
    /// How many stretches were dropped.
    dropped: u64,
}

/// A stretch without a pause: from `at` on, which was reached at `since`, simulated time follows the wall clock.
struct Stretch {
    at: Ticks,
    /// ns without suspensions.
    since: u64,
}

/// When an instant is due.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Due {
    /// ns without suspensions, as of [`Pace::active_ns`].
    pub(crate) ns: u64,
    /// The number of the stretch without a pause.
    pub(crate) stretch: u64,
    /// How long after the stretch began, s of wall time.
    pub(crate) into_s: f64,
}

impl Pace {
    /// The wall clock runs from `at` on, starting at `now`, ns of `CLOCK_MONOTONIC`. This thread is the only one that looks for
    /// suspensions, see [`Pace::with_watch_thread`].
    pub(crate) fn new(ticks_per_s: f64, at: Ticks, now: u64) -> Pace {
        Pace {
            ticks_per_s,
            suspensions: Suspensions::since(now),
            stretches: [Stretch { at, since: now }].into(),
            dropped: 0,
        }
    }

    /// Lets a second thread look for suspensions too, so that a long step is none.
    pub(crate) fn with_watch_thread(mut self) -> Pace {
        self.suspensions = self.suspensions.with_watch_thread();
        self
    }

    /// Lets the wall clock run from `at` on, starting at `now`.
    pub(crate) fn restart_at(&mut self, at: Ticks, now: u64) {
        let since = self.check_suspension(|| now);
        self.begin(at, since);
    }

    fn begin(&mut self, at: Ticks, since: u64) {
        // The run is still paused there, or was restored to an earlier instant.
        while self.stretches.pop_back_if(|last| last.at >= at).is_some() {}
        self.stretches.push_back(Stretch { at, since });
        if self.stretches.len() > STRETCHES {
            self.stretches.pop_front();
            self.dropped += 1;
        }
    }

    /// The instant that has come, at most `limit`: a run that was limited or suspended does not catch up afterwards.
    pub(crate) fn reached(&mut self, limit: Ticks, now: u64) -> Ticks {
        let now = self.check_suspension(|| now);
        let reached = self.stretches.back().map_or(limit, |last| {
            let passed = now.saturating_sub(last.since) as f64 / 1e9;
            last.at.saturating_add((passed * self.ticks_per_s) as Ticks)
        });
        if reached >= limit {
            self.begin(limit, now);
        }
        reached.min(limit)
    }

    /// Looks for a suspension up to `now`, and returns now without suspensions. To be called before the evaluation of what was done
    /// up to now.
    pub(crate) fn check_suspension(&self, now: impl FnOnce() -> u64) -> u64 {
        self.active_ns(self.suspensions.read_clock(now))
    }

    /// The instant `ns` of `CLOCK_MONOTONIC` without the suspensions before it.
    pub(crate) fn active_ns(&self, ns: u64) -> u64 {
        self.suspensions.active_ns(ns)
    }

    /// When the wall clock comes to `at`, or has come to it.
    pub(crate) fn due(&self, at: Ticks) -> Due {
        let number = self.stretches.iter().rposition(|one| one.at <= at).unwrap_or(0);
        let (from, since) = (self.stretches.get(number)).map_or((at, 0), |one| (one.at, one.since));
        let into_s = (at - from).max(0) as f64 / self.ticks_per_s;
        Due {
            ns: since + (into_s * 1e9) as u64,
            stretch: self.dropped + number as u64,
            into_s,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    /// When `at` is due, ms after 0.
    fn due_ms(pace: &Pace, at: Ticks) -> u64 {
        (pace.due(at).ns + MS / 2) / MS
    }

    #[test]
    fn instant_is_due_when_wall_clock_reaches_it() {
        let mut pace = Pace::new(500.0, 10, 0);
        assert_eq!(pace.reached(1000, 100 * MS), 60);
        assert_eq!([10, 60, 110].map(|at| due_ms(&pace, at)), [0, 100, 200]);
    }

    #[test]
    fn pause_does_not_shift_due_times_of_earlier_steps() {
        let mut pace = Pace::new(1000.0, 0, 0);
        // Held at 500 for ten seconds; earlier instants keep their due times.
        for at in (100..=10_500).step_by(100) {
            pace.reached(500, at * MS);
        }
        assert_eq!([0, 499].map(|at| due_ms(&pace, at)), [0, 499]);
        assert_eq!([500, 600].map(|at| due_ms(&pace, at)), [10_500, 10_600]);
        assert_eq!([499, 500].map(|at| pace.due(at).stretch), [0, 1]);
    }

    #[test]
    fn suspension_does_not_shift_due_times() {
        for suspension in [200, 1000, 3_600_000] {
            let mut pace = Pace::new(1000.0, 0, 0);
            pace.reached(100_000, 100 * MS);
            // Nothing is let through at once, and every step is due as long before or after the suspension as without it.
            assert_eq!(pace.reached(100_000, (100 + suspension) * MS), 100);
            assert_eq!(pace.reached(100_000, (140 + suspension) * MS), 140);
            for at in [50, 100, 101, 300] {
                assert_eq!((due_ms(&pace, at), pace.due(at).stretch), (at as u64, 0));
            }
            let awake = |ms: u64| pace.active_ns(ms * MS) / MS;
            assert_eq!([50, 150, 110 + suspension].map(awake), [50, 100, 110]);
        }
    }
}
