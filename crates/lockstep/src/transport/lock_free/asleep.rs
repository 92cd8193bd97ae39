//! The *asleep* word: a participant that is about to sleep says so and looks once more; who publishes looks at the word afterwards.
//!
//! Each side writes one thing and then reads the other's. A full fence between the two keeps both from missing each other.

use std::time::Duration;

use super::board::{Get, Set};
use super::sync::{Ordering, fence};
use crate::transport::interface::Broken;

/// For what a participant sleeps, as it stands in its *asleep* word: others wake it for nothing else.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sleeping(u64);

impl Sleeping {
    /// For whatever may come.
    pub const FOR_ANYTHING: Sleeping = Sleeping(1);

    /// For a sample on link number `link`.
    pub fn for_sample(link: u32) -> Sleeping {
        Sleeping(2 * u64::from(link) + 2)
    }

    /// For room on link number `link`.
    pub fn for_room(link: u32) -> Sleeping {
        Sleeping(2 * u64::from(link) + 3)
    }
}

/// For what the participant sleeps, or is about to.
pub(crate) fn asleep(word: &impl Get<u64>) -> Option<Sleeping> {
    Some(word.get()).filter(|&word| word != 0).map(Sleeping)
}

/// Says in the participant's own word that it is about to sleep and for what, or that it is awake again. Before it sleeps it must
/// look once more: whoever publishes after that look sees the word.
pub(crate) fn set_asleep(word: &impl Set<u64>, what: Option<Sleeping>) {
    word.set(what.map_or(0, |what| what.0));
    fence(Ordering::SeqCst);
}

/// Whether the participant must be woken for something that `came` and has been published.
pub(crate) fn must_be_woken(word: &impl Get<u64>, came: impl Fn(Sleeping) -> bool) -> bool {
    fence(Ordering::SeqCst);
    asleep(word).is_some_and(|what| what == Sleeping::FOR_ANYTHING || came(what))
}

/// Where a participant says for what it sleeps.
pub(crate) trait Announce {
    /// As [`set_asleep`] in the participant's own word.
    fn set_asleep(&mut self, what: Option<Sleeping>);
}

/// Where a participant sleeps.
pub(crate) trait Sleep {
    /// Sleeps until woken, or for `limit`. A wake-up that came before counts.
    fn sleep(&mut self, limit: Duration) -> Result<(), Broken>;
}
