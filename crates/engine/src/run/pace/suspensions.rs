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
const READ_INTERVAL: Duration = Duration::from_millis(10);
/// A process that is not suspended reads the clock at least this often, ns: it gets a core again after some tens of milliseconds even
/// on the busiest machine, and one with a quota of processor time after at most 100 ms. A shorter suspension counts as lateness.
const MAX_GAP_NS: u64 = 150_000_000;
/// How many suspensions are retained: a step is evaluated soon after it is done.
const SUSPENSIONS_MAX: usize = 256;

/// Wall time without the time in which this process was suspended.
pub(super) struct Suspensions {
    readings: Arc<Mutex<ClockReadings>>,
    reader_thread: Option<(JoinHandle<()>, Arc<AtomicBool>)>,
}

/// The readings of the clock, ns of `CLOCK_MONOTONIC`.
struct ClockReadings {
    newest: u64,
    /// The latest suspensions, oldest first: from the last reading before to the first one after.
    latest: VecDeque<(u64, u64)>,
    /// The duration of those that are no longer retained.
    earlier_ns: u64,
}

impl Suspensions {
    /// Looks for suspensions from `now` on where [`Suspensions::read_clock`] is called at least every [`MAX_GAP_NS`].
    pub(super) fn since(now: u64) -> Suspensions {
        let readings = ClockReadings {
            newest: now,
            latest: VecDeque::new(),
            earlier_ns: 0,
        };
        Suspensions {
            readings: Arc::new(Mutex::new(readings)),
            reader_thread: None,
        }
    }

    /// Starts the second thread. It ends when this is dropped.
    pub(super) fn with_watch_thread(mut self) -> Suspensions {
        let over = Arc::new(AtomicBool::new(false));
        let (readings, ends) = (self.readings.clone(), over.clone());
        let read = move || {
            while !ends.load(Ordering::Acquire) {
                locked(&readings).read_clock(now_ns);
                std::thread::park_timeout(READ_INTERVAL);
            }
        };
        match std::thread::Builder::new().name("suspensions".into()).spawn(read) {
            Ok(thread) => self.reader_thread = Some((thread, over)),
            // Without it a long step looks like a suspension: then there are none.
            Err(_) => locked(&self.readings).newest = u64::MAX,
        }
        self
    }

    /// Reads the clock, which is `now`. Everything up to now can be evaluated afterwards.
    pub(super) fn read_clock(&self, now: impl FnOnce() -> u64) -> u64 {
        locked(&self.readings).read_clock(now)
    }

    /// How much of the time up to `at` this process was not suspended, ns.
    pub(super) fn active_ns(&self, at: u64) -> u64 {
        locked(&self.readings).active_ns(at)
    }
}

impl Drop for Suspensions {
    fn drop(&mut self) {
        if let Some((thread, over)) = self.reader_thread.take() {
            over.store(true, Ordering::Release);
            thread.thread().unpark();
            let _ = thread.join();
        }
    }
}

fn locked(readings: &Mutex<ClockReadings>) -> MutexGuard<'_, ClockReadings> {
    readings.lock().unwrap_or_else(PoisonError::into_inner)
}

impl ClockReadings {
    /// The clock is read while no other thread can: a suspension between two readings is seen by the second of them.
    fn read_clock(&mut self, now: impl FnOnce() -> u64) -> u64 {
        let now = now();
        if now.saturating_sub(self.newest) > MAX_GAP_NS {
            self.latest.push_back((self.newest, now));
            if self.latest.len() > SUSPENSIONS_MAX
                && let Some((from, to)) = self.latest.pop_front()
            {
                self.earlier_ns += to - from;
            }
        }
        self.newest = self.newest.max(now);
        now
    }

    fn active_ns(&self, at: u64) -> u64 {
        let latest = self.latest.iter().map(|&(from, to)| at.clamp(from, to) - from);
        at.saturating_sub(self.earlier_ns + latest.sum::<u64>())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    #[test]
    fn time_without_clock_reading_is_a_suspension() {
        let suspensions = Suspensions::since(0);
        for now in [100, 200, 400, 500, 5500] {
            assert_eq!(suspensions.read_clock(|| now * MS), now * MS);
        }
        // From 200 to 400 ms, and from 500 to 5500 ms.
        let awake = [200, 300, 400, 450, 500, 4000, 5500, 5600].map(|at| suspensions.active_ns(at * MS) / MS);
        assert_eq!(awake, [200, 200, 200, 250, 300, 300, 300, 400]);
    }

    #[test]
    fn thread_that_is_held_up_is_no_suspension() {
        let suspensions = Suspensions::since(0);
        // The second thread reads the clock while the first one is in a step of two seconds.
        (1..200).for_each(|beat| {
            suspensions.read_clock(|| beat * 10 * MS);
        });
        suspensions.read_clock(|| 2000 * MS);
        assert_eq!(suspensions.active_ns(2000 * MS), 2000 * MS);
    }

    #[test]
    fn dropped_suspensions_still_count() {
        let suspensions = Suspensions::since(0);
        let count = 2 * SUSPENSIONS_MAX as u64;
        (1..=count).for_each(|beat| {
            suspensions.read_clock(|| beat * 1000 * MS);
        });
        assert_eq!(suspensions.active_ns(count * 1000 * MS + MS), MS);
    }
}
