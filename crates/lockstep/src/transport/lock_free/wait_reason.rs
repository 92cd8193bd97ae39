//! The *wait reason* word: a participant that is about to sleep sets it and polls once more; a process that publishes reads it afterwards.
//!
//! Each side writes one word and then reads the other's. A full fence between the two ensures that at least one of them sees the other's
//! write.

use std::time::Duration;

use super::board::{Get, Set};
use super::sync::{Ordering, fence};
use crate::transport::interface::TransportError;

/// What a participant sleeps for, encoded for its *wait reason* word: other processes wake it for nothing else.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WaitReason(u64);

impl WaitReason {
    /// For anything that may come.
    pub const FOR_ANYTHING: WaitReason = WaitReason(1);

    /// For a sample on link number `link`.
    pub fn for_sample(link: u32) -> WaitReason {
        WaitReason(2 * u64::from(link) + 2)
    }

    /// For room on link number `link`.
    pub fn for_room(link: u32) -> WaitReason {
        WaitReason(2 * u64::from(link) + 3)
    }
}

/// What the participant sleeps for, or is about to sleep for.
pub(crate) fn wait_reason(word: &impl Get<u64>) -> Option<WaitReason> {
    Some(word.get()).filter(|&word| word != 0).map(WaitReason)
}

/// Announces in the participant's own word that it is about to sleep and what for, or that it is awake again. Before it sleeps it must
/// poll once more: a process that publishes after that poll sees the word.
pub(crate) fn set_wait_reason(word: &impl Set<u64>, what: Option<WaitReason>) {
    word.set(what.map_or(0, |what| what.0));
    fence(Ordering::SeqCst);
}

/// Whether the participant must be woken for a condition for which `occurred` is true and which has been published.
pub(crate) fn must_be_woken(word: &impl Get<u64>, occurred: impl Fn(WaitReason) -> bool) -> bool {
    fence(Ordering::SeqCst);
    wait_reason(word).is_some_and(|what| what == WaitReason::FOR_ANYTHING || occurred(what))
}

/// Where a participant announces what it sleeps for.
pub(crate) trait SetWaitReason {
    /// Like [`set_wait_reason`], in the participant's own word.
    fn set_wait_reason(&mut self, what: Option<WaitReason>);
}

/// The sleep of a participant.
pub(crate) trait Sleep {
    /// Sleeps until woken, or for `limit`. A wake-up that came earlier counts.
    fn sleep(&mut self, limit: Duration) -> Result<(), TransportError>;
}
