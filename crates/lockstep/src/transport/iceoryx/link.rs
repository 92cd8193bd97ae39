//! Links: a ring of slots in shared memory, one sender, one receiver, nothing lost.
//!
//! A slot is a whole number of cache lines: the number of the sample among all of the link (from 1 on; 0 while there is none), its
//! index, its stamp, its payload. The number is written last. What the receiver counts are samples.

use super::domain::{Domain, DomainError};
use super::ring::{RingReader, RingService, RingWriter};
use super::words::{LINE, Word, put, take};
use crate::transport::{Broken, Header, Receiver, Sender};

/// Words in front of a payload: number, index, stamp.
const HEAD: usize = 3;

/// The shape of a ring of slots.
#[derive(Debug, Clone, Copy)]
struct Slots {
    /// Bytes of a payload.
    size: usize,
    capacity: usize,
}

impl Slots {
    /// Words of a slot.
    fn stride(self) -> usize {
        (HEAD + self.size.div_ceil(8)).next_multiple_of(LINE)
    }

    fn words(self) -> usize {
        self.stride() * self.capacity
    }

    /// The slot of the sample that `before` others precede.
    fn slot(self, words: &[Word], before: u64) -> &[Word] {
        let first = (before % self.capacity as u64) as usize * self.stride();
        &words[first..first + self.stride()]
    }

    fn fits(self, payload: usize) -> Result<(), Broken> {
        if payload == self.size {
            return Ok(());
        }
        let size = self.size;
        Err(Broken(format!("a sample of {payload} bytes on a link of {size}")))
    }
}

/// The bytes of the ring of a link for `capacity` samples of `size` bytes.
pub(super) fn ring_bytes(size: usize, capacity: usize) -> u64 {
    8 * Slots { size, capacity }.words() as u64
}

/// The service of one link. Whoever holds it keeps the service alive.
pub struct LinkService {
    ring: RingService,
    slots: Slots,
}

impl LinkService {
    /// Creates the service of link number `link` for samples of `size` bytes, `capacity` of them at a time.
    pub fn create(domain: &Domain, link: u32, size: usize, capacity: usize) -> Result<LinkService, DomainError> {
        Ok(LinkService {
            ring: RingService::create(domain, &format!("link/{link}"), 1)?,
            slots: Slots { size, capacity },
        })
    }

    /// Opens the service of link number `link`.
    pub fn open(domain: &Domain, link: u32, size: usize, capacity: usize) -> Result<LinkService, DomainError> {
        Ok(LinkService {
            ring: RingService::open(domain, &format!("link/{link}"))?,
            slots: Slots { size, capacity },
        })
    }

    /// The sending end.
    pub fn sender(&self, domain: &Domain) -> Result<LinkSender, DomainError> {
        Ok(LinkSender {
            ring: self
                .ring
                .writer(domain, self.slots.words() / LINE, self.slots.stride() / LINE)?,
            slots: self.slots,
            sent: 0,
        })
    }

    /// The receiving end.
    pub fn receiver(&self, domain: &Domain) -> Result<LinkReceiver, DomainError> {
        Ok(LinkReceiver {
            ring: self.ring.reader(domain)?,
            slots: self.slots,
            taken: 0,
        })
    }
}

/// The sending end of a link in shared memory.
pub struct LinkSender {
    ring: RingWriter,
    slots: Slots,
    sent: u64,
}

impl Sender for LinkSender {
    fn prepare(&mut self) -> Result<(), Broken> {
        self.ring.words().map(|_| ())
    }

    fn try_send(&mut self, header: Header, payload: &[u8]) -> Result<bool, Broken> {
        self.slots.fits(payload.len())?;
        if !self.ring.has_room(self.slots.capacity as u64, self.sent, 1)? {
            return Ok(false);
        }
        let Some(words) = self.ring.words()? else {
            return Ok(false);
        };
        let slot = self.slots.slot(words, self.sent);
        slot[1].set(header.index);
        slot[2].set(header.stamp as u64);
        put(&slot[HEAD..], payload);
        self.sent += 1;
        slot[0].announce(self.sent);
        Ok(true)
    }
}

/// The receiving end of a link in shared memory.
pub struct LinkReceiver {
    ring: RingReader,
    slots: Slots,
    taken: u64,
}

impl Receiver for LinkReceiver {
    fn prepare(&mut self) -> Result<(), Broken> {
        self.ring.words().map(|_| ())
    }

    fn try_receive(&mut self, payload: &mut [u8]) -> Result<Option<Header>, Broken> {
        self.slots.fits(payload.len())?;
        let Some(words) = self.ring.words()? else {
            return Ok(None);
        };
        if words.len() != self.slots.words() {
            let (came, due) = (words.len(), self.slots.words());
            return Err(Broken(format!("a ring of {came} words where {due} are expected")));
        }
        let slot = self.slots.slot(words, self.taken);
        let (number, due) = (slot[0].heard(), self.taken + 1);
        if number != due {
            // The slot is empty, or still has what was taken out of it one round ago.
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
        self.ring.took(due);
        Ok(Some(header))
    }
}

#[cfg(test)]
mod tests {
    use super::super::place::Place;
    use super::*;
    use std::sync::atomic::{AtomicBool, Ordering};

    #[test]
    fn received_sample_is_stable_while_its_sender_scribbles() {
        let place = Place::new();
        let service = LinkService::create(&place.domain, 0, 64, 4).expect("a new domain has room");
        let mut receiver = service.receiver(&place.domain).expect("the only receiver");
        let mut sender = service.sender(&place.domain).expect("the only sender");
        let done = AtomicBool::new(false);
        sender.prepare().expect("a receiver is there");
        for index in 0..4 {
            let header = Header { index, stamp: 0 };
            assert_eq!(sender.try_send(header, &[7; 64]), Ok(true));
        }
        let words = sender.ring.words().expect("handed over").expect("taken");
        std::thread::scope(|scope| {
            scope.spawn(|| {
                for value in (0..).take_while(|_| !done.load(Ordering::Relaxed)) {
                    // All payloads: what stands in front of them is what makes them samples.
                    for slot in words.chunks(receiver_stride()) {
                        slot[HEAD..HEAD + 8].iter().for_each(|word| word.set(value));
                    }
                }
            });
            for _ in 0..4 {
                let mut payload = [0; 64];
                let header = receiver
                    .try_receive(&mut payload)
                    .expect("a sample")
                    .expect("it was sent");
                let before = payload;
                std::thread::yield_now();
                assert_eq!((header.stamp, payload), (0, before));
            }
            done.store(true, Ordering::Relaxed);
        });
    }

    fn receiver_stride() -> usize {
        let slots = Slots { size: 64, capacity: 4 };
        slots.stride()
    }
}
