//! A ring of slots: one sender, one receiver, without loss or repetition.
//!
//! A slot is a whole number of cache lines: the number of the sample among all of the link (from 1 on; 0 while there is none), its index,
//! its stamp, its payload. The number is written last. The receiver counts samples.

use super::board::{Get, Set};
use super::room::Room;
use super::words::{LINE, Word, copy_in, copy_out};
use crate::transport::interface::{Header, TransportError};

/// Words before a payload: number, index, stamp.
pub(crate) const HEADER_WORDS: usize = 3;

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
            stride: (HEADER_WORDS + size.div_ceil(8)).next_multiple_of(LINE),
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
    fn next_slot(self, first: usize) -> usize {
        let next = first + self.stride;
        if next < self.words() { next } else { 0 }
    }

    /// # Errors
    /// When the size of a payload of `payload` bytes is wrong for this ring.
    pub(crate) fn check_size(self, payload: usize) -> Result<(), TransportError> {
        if payload == self.size {
            return Ok(());
        }
        let size = self.size;
        Err(TransportError(format!(
            "a sample of {payload} bytes on a link of {size}"
        )))
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
    ) -> Result<bool, TransportError> {
        self.slots.check_size(payload.len())?;
        if !self.room.fits(self.slots.capacity as u64, self.sent, 1, count)? {
            return Ok(false);
        }
        let slot = &words[self.at..self.at + self.slots.stride()];
        slot[1].set(header.index);
        slot[2].set(header.stamp as u64);
        copy_in(&slot[HEADER_WORDS..], payload);
        self.sent += 1;
        self.at = self.slots.next_slot(self.at);
        slot[0].store_release(self.sent);
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
    ) -> Result<Option<Header>, TransportError> {
        if words.len() != self.slots.words() {
            let (size, expected) = (words.len(), self.slots.words());
            return Err(TransportError(format!(
                "a ring of {size} words where {expected} are expected"
            )));
        }
        let slot = &words[self.at..self.at + self.slots.stride()];
        let (number, expected) = (slot[0].load_acquire(), self.taken + 1);
        if number != expected {
            // The slot is empty, or still holds the sample that was taken from it one round ago.
            return match number == expected.saturating_sub(self.slots.capacity as u64) {
                true => Ok(None),
                false => Err(TransportError(format!(
                    "sample number {number} of the link where number {expected} is due"
                ))),
            };
        }
        let header = Header {
            index: slot[1].get(),
            stamp: slot[2].get() as i64,
        };
        // A copy, so that what is checked is what is used, whatever the sender does to its memory afterwards.
        copy_out(&slot[HEADER_WORDS..], payload);
        self.taken = expected;
        self.at = self.slots.next_slot(self.at);
        count.set(expected);
        Ok(Some(header))
    }
}
