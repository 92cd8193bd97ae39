//! Spin a little, then yield, then sleep.

use std::time::Duration;

use crate::control::Waiting;
use crate::transport::Broken;
use crate::transport::iceoryx::{Sleeper, Sleeping, StatusWriter};

/// The longest sleep without a look around, so that a waker that died between publishing and waking costs no more.
const SLEEP_MAX: Duration = Duration::from_millis(20);

/// The patience of one participant.
pub(super) struct Patience {
    strategy: Waiting,
    looks: u32,
    asleep: Option<Sleeping>,
    /// How often it slept.
    pub(super) sleeps: u64,
}

impl Patience {
    pub(super) fn new(strategy: Waiting) -> Patience {
        Patience {
            strategy,
            looks: 0,
            asleep: None,
            sleeps: 0,
        }
    }

    /// What was waited for has come.
    pub(super) fn rest(&mut self, status: &mut StatusWriter) {
        self.looks = 0;
        if self.asleep.take().is_some() {
            status.set_asleep(None);
        }
    }

    /// True when it is time to look at the stop flag and to say what is waited for: at every sleep, not at every spin.
    pub(super) fn is_long(&self) -> bool {
        self.asleep.is_some() || (self.looks > self.strategy.spins && self.looks.is_multiple_of(64))
    }

    /// Lets some time pass before the next look for `what`.
    pub(super) fn pause(
        &mut self,
        what: Sleeping,
        status: &mut StatusWriter,
        sleeper: &mut Sleeper,
    ) -> Result<(), Broken> {
        self.looks = self.looks.saturating_add(1);
        if self.looks <= self.strategy.spins {
            std::hint::spin_loop();
        } else if self.looks - self.strategy.spins <= self.strategy.yields {
            rustix::thread::sched_yield();
        } else if self.asleep != Some(what) {
            // Announce it, then look once more: whoever publishes after that look sees the announcement.
            self.asleep = Some(what);
            status.set_asleep(self.asleep);
        } else {
            self.sleeps += 1;
            sleeper.sleep(SLEEP_MAX)?;
        }
        Ok(())
    }

    /// Sleeps at once, for waits that are known to be long.
    pub(super) fn doze(&mut self, sleeper: &mut Sleeper) -> Result<(), Broken> {
        sleeper.sleep(SLEEP_MAX)
    }
}
