//! Waiting: spin a little, then yield, then sleep.

use std::time::Duration;

use crate::control::Waiting;
use crate::transport::interface::Broken;
use crate::transport::lock_free::wait_reason::{Announce, Sleep, WaitReason};

/// The longest sleep without a poll, so that a waker that died between publishing and waking costs no more than this.
const SLEEP_MAX: Duration = Duration::from_millis(20);

/// The waiting strategy of one participant.
pub(crate) struct Patience {
    strategy: Waiting,
    looks: u32,
    turns: Turns,
    wait_reason: Option<WaitReason>,
    /// The total number of sleeps.
    pub(crate) sleeps: u64,
}

impl Patience {
    pub(crate) fn new(strategy: Waiting) -> Patience {
        Patience {
            strategy,
            looks: 0,
            turns: Turns::default(),
            wait_reason: None,
            sleeps: 0,
        }
    }

    /// Ends the wait: what was waited for has arrived.
    pub(crate) fn rest(&mut self, status: &mut impl Announce) {
        let yields = self.looks.saturating_sub(self.strategy.spins);
        if (1..=self.strategy.yields).contains(&yields) {
            self.turns.came_after(yields);
        }
        self.looks = 0;
        if self.wait_reason.take().is_some() {
            status.set_wait_reason(None);
        }
    }

    /// True when it is time to read the stop flag and to publish what is waited for: at every sleep, and at every 64th poll after the spins.
    pub(crate) fn is_long(&self) -> bool {
        self.wait_reason.is_some() || (self.looks > self.strategy.spins && self.looks.is_multiple_of(64))
    }

    /// Whether the last pause took longer than reading the clock, or there were enough pauses since the last time.
    pub(crate) fn took_time(&self) -> bool {
        self.looks > self.strategy.spins || self.looks.is_multiple_of(16)
    }

    /// Pauses before the next poll for `what`.
    pub(crate) fn pause(
        &mut self,
        what: WaitReason,
        status: &mut impl Announce,
        sleeper: &mut impl Sleep,
    ) -> Result<(), Broken> {
        self.looks = self.looks.saturating_add(1);
        if self.looks <= self.strategy.spins {
            std::hint::spin_loop();
        } else if self.looks - self.strategy.spins <= self.strategy.yields {
            if self.looks - self.strategy.spins > 1 && self.turns.change() {
                std::thread::sleep(Duration::from_nanos(1));
            }
            rustix::thread::sched_yield();
        } else if self.wait_reason != Some(what) {
            // Announce the sleep, then poll once more: a process that publishes after that poll sees the announcement.
            self.wait_reason = Some(what);
            status.set_wait_reason(self.wait_reason);
        } else {
            self.sleeps += 1;
            sleeper.sleep(SLEEP_MAX)?;
        }
        Ok(())
    }

    /// Sleeps at once, for waits that are known to be long.
    pub(crate) fn sleep(&mut self, sleeper: &mut impl Sleep) -> Result<(), Broken> {
        sleeper.sleep(SLEEP_MAX)
    }
}

/// Detects an unsuitable wake-up order of the participants that share this core.
///
/// A participant that yields goes to the end of the kernel's run queue, so the initial order of the participants on a core persists. If
/// it is the order of the work, every participant finds what it waits for at its first poll. If not, half of all scheduler turns are
/// wasted for the rest of the run; a short sleep then changes the order.
#[derive(Debug)]
struct Turns {
    waits: u32,
    in_vain: u32,
    /// The number of waits before the next decision.
    window: u32,
    change: bool,
}

impl Turns {
    const WINDOW: u32 = 16;
    /// With several different rates, no order suits all participants: attempts then become rarer.
    const WINDOW_MAX: u32 = 4096;

    /// Records that a wait ended after this many yields.
    fn came_after(&mut self, yields: u32) {
        self.waits += 1;
        self.in_vain += u32::from(yields > 1);
        if self.waits >= self.window {
            self.change = 2 * self.in_vain > self.waits;
            self.window = if self.change {
                Turns::WINDOW_MAX.min(2 * self.window)
            } else {
                Turns::WINDOW
            };
            (self.waits, self.in_vain) = (0, 0);
        }
    }

    /// Whether to change the order now; returns true once per decision.
    fn change(&mut self) -> bool {
        std::mem::take(&mut self.change)
    }
}

impl Default for Turns {
    fn default() -> Turns {
        Turns {
            waits: 0,
            in_vain: 0,
            window: Turns::WINDOW,
            change: false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Turns;

    /// How many of `waits` waits, each of which ends after `yields` yields, request another order.
    fn changes(turns: &mut Turns, waits: u32, yields: u32) -> usize {
        let change = |_: &u32| {
            turns.came_after(yields);
            turns.change()
        };
        (0..waits).filter(change).count()
    }

    #[test]
    fn suitable_wake_up_order_is_kept() {
        assert_eq!(changes(&mut Turns::default(), 100_000, 1), 0);
    }

    #[test]
    fn unsuitable_wake_up_order_is_changed_ever_more_rarely() {
        let mut turns = Turns::default();
        assert_eq!(changes(&mut turns, Turns::WINDOW, 2), 1);
        let later = changes(&mut turns, 100_000, 2);
        assert!((20..=40).contains(&later), "{later}");
        // Once the order suits, the next unsuitable one is soon detected again.
        changes(&mut turns, Turns::WINDOW_MAX, 1);
        assert_eq!(changes(&mut turns, 2 * Turns::WINDOW, 2), 1);
    }
}
