//! A ring of slots: one sender, one receiver, without loss or repetition.
//!
//! A slot is a whole number of cache lines: the number of the sample among all of the link (from 1 on; 0 while there is none), its index,
//! its stamp, its payload. The number is written last. The receiver counts samples.

use super::board::{Get, Set};
use super::room::Room;
use super::words::{LINE, Word, put, take};
use crate::transport::interface::{Broken, Header};

/// Words before a payload: number, index, stamp.
pub(crate) const HEAD: usize = 3;

/// The shape of a ring of slots.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Slots {
    /// Bytes of a payload.
    pub(crate) size: usize,
    pub(crate) capacity: usize,
    /// Words of a slot.
    stride: usize,
}

impl Slots {
    /// A ring of `capacity` slots for payloads of `size` bytes.
    pub(crate) const fn new(size: usize, capacity: usize) -> Slots {
        Slots {
            size,
            capacity,
            stride: (HEAD + size.div_ceil(8)).next_multiple_of(LINE),
        }
    }

    /// Words of a slot.
    pub(crate) fn stride(self) -> usize {
        self.stride
    }

    pub(crate) fn words(self) -> usize {
        self.stride * self.capacity
    }

    /// The first word of the slot after the one at `first`.
    fn behind(self, first: usize) -> usize {
        let next = first + self.stride;
        if next < self.words() { next } else { 0 }
    }

    /// # Errors
    /// When the size of a payload of `payload` bytes is wrong for this ring.
    pub(crate) fn fits(self, payload: usize) -> Result<(), Broken> {
        if payload == self.size {
            return Ok(());
        }
        let size = self.size;
        Err(Broken(format!("a sample of {payload} bytes on a link of {size}")))
    }
}

/// The sender's state of a ring.
pub(crate) struct SlotSender {
    slots: Slots,
    sent: u64,
    /// The first word of the slot of the next sample.
    at: usize,
    room: Room,
}

impl SlotSender {
    pub(crate) fn new(slots: Slots) -> SlotSender {
        SlotSender {
            slots,
            sent: 0,
            at: 0,
            room: Room::default(),
        }
    }

    /// Sends a sample through `words`, of which the receiver has taken as many as `count` says; `false` when there is no room.
    #[inline]
    pub(crate) fn try_send(
        &mut self,
        words: &[Word],
        count: &impl Get<u64>,
        header: Header,
        payload: &[u8],
    ) -> Result<bool, Broken> {
        self.slots.fits(payload.len())?;
        if !self.room.fits(self.slots.capacity as u64, self.sent, 1, count)? {
            return Ok(false);
        }
        let slot = &words[self.at..self.at + self.slots.stride()];
        slot[1].set(header.index);
        slot[2].set(header.stamp as u64);
        put(&slot[HEAD..], payload);
        self.sent += 1;
        self.at = self.slots.behind(self.at);
        slot[0].announce(self.sent);
        Ok(true)
    }
}

/// The receiver's state of a ring.
pub(crate) struct SlotReceiver {
    slots: Slots,
    taken: u64,
    /// The first word of the slot of the next sample.
    at: usize,
}

impl SlotReceiver {
    pub(crate) fn new(slots: Slots) -> SlotReceiver {
        SlotReceiver { slots, taken: 0, at: 0 }
    }

    /// Copies the next sample out of `words` and counts it; `None` while it has not arrived.
    #[inline]
    pub(crate) fn try_receive(
        &mut self,
        words: &[Word],
        count: &impl Set<u64>,
        payload: &mut [u8],
    ) -> Result<Option<Header>, Broken> {
        if words.len() != self.slots.words() {
            let (came, due) = (words.len(), self.slots.words());
            return Err(Broken(format!("a ring of {came} words where {due} are expected")));
        }
        let slot = &words[self.at..self.at + self.slots.stride()];
        let (number, due) = (slot[0].heard(), self.taken + 1);
        if number != due {
            // The slot is empty, or still holds the sample that was taken from it one round ago.
            return match number == due.saturating_sub(self.slots.capacity as u64) {
                true => Ok(None),
                false => Err(Broken(format!(
                    "sample number {number} of the link where number {due} is due"
                ))),
            };
        }
        let header = Header {
            index: slot[1].get(),
            stamp: slot[2].get() as i64,
        };
        // A copy, so that what is checked is what is used, whatever the sender does to its memory afterwards.
        take(&slot[HEAD..], payload);
        self.taken = due;
        self.at = self.slots.behind(self.at);
        count.set(due);
        Ok(Some(header))
    }
}
