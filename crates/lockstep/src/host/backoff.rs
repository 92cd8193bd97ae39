//! Waiting: spin a little, then yield, then sleep.

use std::time::Duration;

use crate::control::WaitStrategy;
use crate::transport::interface::TransportError;
use crate::transport::lock_free::wait_reason::{SetWaitReason, Sleep, WaitReason};

/// The longest sleep without a poll, so that a waker that died between publishing and waking costs no more than this.
const SLEEP_MAX: Duration = Duration::from_millis(20);

/// The wait of one participant: first it spins, then it yields, then it sleeps.
pub(crate) struct Backoff {
    strategy: WaitStrategy,
    polls: u32,
    wake_up_order: WakeUpOrder,
    wait_reason: Option<WaitReason>,
    /// The total number of sleeps.
    pub(crate) sleeps: u64,
}

impl Backoff {
    pub(crate) fn new(strategy: WaitStrategy) -> Backoff {
        Backoff {
            strategy,
            polls: 0,
            wake_up_order: WakeUpOrder::default(),
            wait_reason: None,
            sleeps: 0,
        }
    }

    /// Ends the wait: its condition has occurred.
    pub(crate) fn reset(&mut self, status: &mut impl SetWaitReason) {
        let yields = self.polls.saturating_sub(self.strategy.spins);
        if (1..=self.strategy.yields).contains(&yields) {
            self.wake_up_order.record_wait(yields);
        }
        self.polls = 0;
        if self.wait_reason.take().is_some() {
            status.set_wait_reason(None);
        }
    }

    /// Whether to read the clock's command and to publish the wait reason now: at every sleep, and at every 64th poll after the spins.
    pub(crate) fn is_long_wait(&self) -> bool {
        self.wait_reason.is_some() || (self.polls > self.strategy.spins && self.polls.is_multiple_of(64))
    }

    /// Whether the last pause took longer than reading the clock, or there were enough pauses since the last time.
    pub(crate) fn should_read_clock(&self) -> bool {
        self.polls > self.strategy.spins || self.polls.is_multiple_of(16)
    }

    /// Pauses before the next poll for `what`.
    pub(crate) fn pause(
        &mut self,
        what: WaitReason,
        status: &mut impl SetWaitReason,
        sleeper: &mut impl Sleep,
    ) -> Result<(), TransportError> {
        self.polls = self.polls.saturating_add(1);
        if self.polls <= self.strategy.spins {
            std::hint::spin_loop();
        } else if self.polls - self.strategy.spins <= self.strategy.yields {
            if self.polls - self.strategy.spins > 1 && self.wake_up_order.take_change() {
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
    pub(crate) fn sleep(&mut self, sleeper: &mut impl Sleep) -> Result<(), TransportError> {
        sleeper.sleep(SLEEP_MAX)
    }
}

/// Detects an unsuitable wake-up order of the participants that share this core.
///
/// A participant that yields goes to the end of the kernel's run queue, so the initial order of the participants on a core persists. If
/// it is the order of the work, every participant can continue at its first poll. If not, half of all scheduler time slices are wasted
/// for the rest of the run; a short sleep then changes the order.
#[derive(Debug)]
struct WakeUpOrder {
    waits: u32,
    wasted: u32,
    /// The number of waits before the next decision.
    window: u32,
    change: bool,
}

impl WakeUpOrder {
    const WINDOW: u32 = 16;
    /// With several different rates, no order suits all participants: attempts then become rarer.
    const WINDOW_MAX: u32 = 4096;

    /// Records that a wait ended after this many yields.
    fn record_wait(&mut self, yields: u32) {
        self.waits += 1;
        self.wasted += u32::from(yields > 1);
        if self.waits >= self.window {
            self.change = 2 * self.wasted > self.waits;
            self.window = if self.change {
                WakeUpOrder::WINDOW_MAX.min(2 * self.window)
            } else {
                WakeUpOrder::WINDOW
            };
            (self.waits, self.wasted) = (0, 0);
        }
    }

    /// Whether to change the order now; returns true once per decision.
    fn take_change(&mut self) -> bool {
        std::mem::take(&mut self.change)
    }
}

impl Default for WakeUpOrder {
    fn default() -> WakeUpOrder {
        WakeUpOrder {
            waits: 0,
            wasted: 0,
            window: WakeUpOrder::WINDOW,
            change: false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::WakeUpOrder;

    /// How many of `waits` waits, each of which ends after `yields` yields, request another order.
    fn changes(wake_up_order: &mut WakeUpOrder, waits: u32, yields: u32) -> usize {
        let change = |_: &u32| {
            wake_up_order.record_wait(yields);
            wake_up_order.take_change()
        };
        (0..waits).filter(change).count()
    }

    #[test]
    fn suitable_wake_up_order_is_kept() {
        assert_eq!(changes(&mut WakeUpOrder::default(), 100_000, 1), 0);
    }

    #[test]
    fn unsuitable_wake_up_order_is_changed_ever_more_rarely() {
        let mut wake_up_order = WakeUpOrder::default();
        assert_eq!(changes(&mut wake_up_order, WakeUpOrder::WINDOW, 2), 1);
        let later = changes(&mut wake_up_order, 100_000, 2);
        assert!((20..=40).contains(&later), "{later}");
        // Once the order suits, the next unsuitable one is soon detected again.
        changes(&mut wake_up_order, WakeUpOrder::WINDOW_MAX, 1);
        assert_eq!(changes(&mut wake_up_order, 2 * WakeUpOrder::WINDOW, 2), 1);
    }
}
