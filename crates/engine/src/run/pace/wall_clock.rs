//! The pace of the wall clock: which simulated time has come, and when an instant was due.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use lockstep::span::now_ns;
use lockstep::time::Ticks;

use crate::run::timeout::Awake;

/// How many stretches without a rest are kept: a step is evaluated soon after it is done.
const STRETCHES: usize = 1024;
/// The least duration that counts as a suspension; smaller differences come from rounding.
const SUSPENSION: Duration = Duration::from_millis(1);

/// Keeps simulated time behind a multiple of wall time, counting only wall time in which this process ran and the run was not at
/// rest.
pub(crate) struct Pace {
    ticks_per_s: f64,
    awake: Awake,
    at: Ticks,
    /// The points from which the wall clock ran, the newest last. Never empty.
    stretches: VecDeque<Stretch>,
    /// How many stretches were dropped.
    forgotten: u64,
    /// An instant, and the same instant in ns of `CLOCK_MONOTONIC`.
    origin: (Instant, u64),
}

/// A stretch without a rest: from `at` on, which was reached at `since`, simulated time follows the wall clock.
struct Stretch {
    at: Ticks,
    since: Instant,
}

/// When an instant is due.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Due {
    /// ns of `CLOCK_MONOTONIC`.
    pub(crate) ns: u64,
    /// The number of the stretch without a rest.
    pub(crate) stretch: u64,
    /// How long after the stretch began, s of wall time.
    pub(crate) into_s: f64,
}

impl Pace {
    pub(crate) fn new(ticks_per_s: f64, at: Ticks, now: Instant) -> Pace {
        let before = now_ns();
        let here = Instant::now();
        let gone = here.saturating_duration_since(now).as_nanos() as u64;
        Pace {
            ticks_per_s,
            awake: Awake::since(now),
            at,
            stretches: [Stretch { at, since: now }].into(),
            forgotten: 0,
            origin: (now, before.saturating_sub(gone)),
        }
    }

    /// Lets the wall clock run from `at` on, starting at `now`.
    pub(crate) fn start_over(&mut self, at: Ticks, now: Instant) {
        (self.awake, self.at) = (Awake::since(now), at);
        self.begin(at, now);
    }

    fn begin(&mut self, at: Ticks, since: Instant) {
        // The run still rests there, or has gone back.
        while self.stretches.pop_back_if(|last| last.at >= at).is_some() {}
        self.stretches.push_back(Stretch { at, since });
        if self.stretches.len() > STRETCHES {
            self.stretches.pop_front();
            self.forgotten += 1;
        }
    }

    /// The instant that has come, at most `most`: a run that was held there, or suspended, does not catch up afterwards.
    pub(crate) fn reached(&mut self, most: Ticks, now: Instant) -> Ticks {
        let passed = self.awake.at(now).as_secs_f64() * self.ticks_per_s;
        let reached = self.at.saturating_add(passed as Ticks);
        if reached >= most {
            self.start_over(most, now);
        } else if self.line(now) - (self.at as f64 + passed) > SUSPENSION.as_secs_f64() * self.ticks_per_s {
            self.begin(reached, now);
        }
        reached.min(most)
    }

    /// Where simulated time would be without a suspension since the newest stretch began.
    fn line(&self, now: Instant) -> f64 {
        self.stretches.back().map_or(0.0, |last| {
            let passed = now.saturating_duration_since(last.since).as_secs_f64();
            last.at as f64 + passed * self.ticks_per_s
        })
    }

    /// When the wall clock comes to `at`, or has come to it.
    pub(crate) fn due(&self, at: Ticks) -> Due {
        let number = self.stretches.iter().rposition(|one| one.at <= at).unwrap_or(0);
        let (from, since) = (self.stretches.get(number)).map_or((at, self.origin.0), |one| (one.at, one.since));
        let into_s = (at - from).max(0) as f64 / self.ticks_per_s;
        let begun = since.saturating_duration_since(self.origin.0);
        Due {
            ns: self.origin.1 + begun.as_nanos() as u64 + (into_s * 1e9) as u64,
            stretch: self.forgotten + number as u64,
            into_s,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ms(count: u64) -> Duration {
        Duration::from_millis(count)
    }

    /// When `at` is due, ms after `start`.
    fn due_ms(pace: &Pace, at: Ticks) -> i64 {
        (pace.due(at).ns as i64 - pace.origin.1 as i64 + 500_000).div_euclid(1_000_000)
    }

    #[test]
    fn instant_is_due_when_the_wall_clock_comes_to_it() {
        let start = Instant::now();
        let mut pace = Pace::new(500.0, 10, start);
        assert_eq!(pace.reached(1000, start + ms(100)), 60);
        assert_eq!([10, 60, 110].map(|at| due_ms(&pace, at)), [0, 100, 200]);
    }

    #[test]
    fn time_of_a_rest_does_not_make_earlier_steps_punctual() {
        let start = Instant::now();
        let mut pace = Pace::new(1000.0, 0, start);
        // Held at 500 for ten seconds; earlier instants keep their due times.
        for at in (100..=10_500).step_by(100) {
            pace.reached(500, start + ms(at));
        }
        assert_eq!([0, 499].map(|at| due_ms(&pace, at)), [0, 499]);
        assert_eq!([500, 600].map(|at| due_ms(&pace, at)), [10_500, 10_600]);
        assert_eq!([499, 500].map(|at| pace.due(at).stretch), [0, 1]);
    }

    #[test]
    fn time_of_a_suspension_is_not_lateness() {
        let start = Instant::now();
        let mut pace = Pace::new(1000.0, 0, start);
        pace.reached(100_000, start + ms(100));
        let after = pace.reached(100_000, start + ms(60_100));
        assert!(after <= 350, "{after}");
        assert_eq!(due_ms(&pace, after), 60_100);
        assert_eq!(due_ms(&pace, 50), 50);
    }
}
