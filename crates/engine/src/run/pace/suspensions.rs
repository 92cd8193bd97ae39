//! The time in which this process was suspended: stopped by a signal (Ctrl-Z, a batch system), or with its container or its virtual
//! machine.
//!
//! A suspension stops all threads of a process at once, whereas a long step or a slow disk holds up one of them. So a second thread
//! reads the clock every few milliseconds, and the run's own thread does so before it evaluates anything: when no thread of the
//! process has read it for long enough, the process was suspended since the last reading. A suspended machine needs nothing of this:
//! `CLOCK_MONOTONIC` stands still meanwhile.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use lockstep::span::now_ns;

/// How often the second thread reads the clock.
const BEAT: Duration = Duration::from_millis(10);
/// A process that is not suspended reads the clock at least this often, ns: it gets a core again after some tens of milliseconds even
/// on the busiest machine, and one with a quota of processor time after at most 100 ms. A shorter suspension counts as lateness.
const LONGEST_NS: u64 = 150_000_000;
/// How many suspensions are kept: a step is evaluated soon after it is done.
const KEPT: usize = 256;

/// Wall time without the time in which this process was suspended.
pub(super) struct Suspensions {
    beats: Arc<Mutex<Beats>>,
    second: Option<(JoinHandle<()>, Arc<AtomicBool>)>,
}

/// The readings of the clock, ns of `CLOCK_MONOTONIC`.
struct Beats {
    newest: u64,
    /// The latest suspensions, oldest first: from the last reading before to the first one after.
    kept: VecDeque<(u64, u64)>,
    /// The duration of those that are no longer kept.
    earlier: u64,
}

impl Suspensions {
    /// Looks for suspensions from `now` on where [`Suspensions::beat`] is called at least every [`LONGEST_NS`].
    pub(super) fn since(now: u64) -> Suspensions {
        let beats = Beats {
            newest: now,
            kept: VecDeque::new(),
            earlier: 0,
        };
        Suspensions {
            beats: Arc::new(Mutex::new(beats)),
            second: None,
        }
    }

    /// Starts the second thread. It ends when this is dropped.
    pub(super) fn watched(mut self) -> Suspensions {
        let over = Arc::new(AtomicBool::new(false));
        let (beats, ends) = (self.beats.clone(), over.clone());
        let read = move || {
            while !ends.load(Ordering::Acquire) {
                locked(&beats).beat(now_ns);
                std::thread::park_timeout(BEAT);
            }
        };
        match std::thread::Builder::new().name("suspensions".into()).spawn(read) {
            Ok(thread) => self.second = Some((thread, over)),
            // Without it a long step looks like a suspension: then there are none.
            Err(_) => locked(&self.beats).newest = u64::MAX,
        }
        self
    }

    /// Reads the clock, which is `now`. Everything up to now can be evaluated afterwards.
    pub(super) fn beat(&self, now: impl FnOnce() -> u64) -> u64 {
        locked(&self.beats).beat(now)
    }

    /// How much of the time up to `at` this process was not suspended, ns.
    pub(super) fn awake(&self, at: u64) -> u64 {
        locked(&self.beats).awake(at)
    }
}

impl Drop for Suspensions {
    fn drop(&mut self) {
        if let Some((thread, over)) = self.second.take() {
            over.store(true, Ordering::Release);
            thread.thread().unpark();
            let _ = thread.join();
        }
    }
}

fn locked(beats: &Mutex<Beats>) -> MutexGuard<'_, Beats> {
    beats.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Beats {
    /// The clock is read while no other thread can: a suspension between two readings is seen by the second of them.
    fn beat(&mut self, now: impl FnOnce() -> u64) -> u64 {
        let now = now();
        if now.saturating_sub(self.newest) > LONGEST_NS {
            self.kept.push_back((self.newest, now));
            if self.kept.len() > KEPT
                && let Some((from, to)) = self.kept.pop_front()
            {
                self.earlier += to - from;
            }
        }
        self.newest = self.newest.max(now);
        now
    }

    fn awake(&self, at: u64) -> u64 {
        let kept = self.kept.iter().map(|&(from, to)| at.clamp(from, to) - from);
        at.saturating_sub(self.earlier + kept.sum::<u64>())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    #[test]
    fn time_without_any_reading_is_a_suspension() {
        let suspensions = Suspensions::since(0);
        for now in [100, 200, 400, 500, 5500] {
            assert_eq!(suspensions.beat(|| now * MS), now * MS);
        }
        // From 200 to 400 ms, and from 500 to 5500 ms.
        let awake = [200, 300, 400, 450, 500, 4000, 5500, 5600].map(|at| suspensions.awake(at * MS) / MS);
        assert_eq!(awake, [200, 200, 200, 250, 300, 300, 300, 400]);
    }

    #[test]
    fn a_thread_that_is_held_up_is_no_suspension() {
        let suspensions = Suspensions::since(0);
        // The second thread reads the clock while the first one is in a step of two seconds.
        (1..200).for_each(|beat| {
            suspensions.beat(|| beat * 10 * MS);
        });
        suspensions.beat(|| 2000 * MS);
        assert_eq!(suspensions.awake(2000 * MS), 2000 * MS);
    }

    #[test]
    fn suspensions_that_are_no_longer_kept_still_count() {
        let suspensions = Suspensions::since(0);
        let count = 2 * KEPT as u64;
        (1..=count).for_each(|beat| {
            suspensions.beat(|| beat * 1000 * MS);
        });
        assert_eq!(suspensions.awake(count * 1000 * MS + MS), MS);
    }
}
