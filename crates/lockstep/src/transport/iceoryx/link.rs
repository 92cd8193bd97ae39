//! Links in shared memory: a ring of slots in one sample of publish-subscribe.

use super::domain::{Domain, DomainError};
use super::ring::{RingReader, RingService, RingWriter};
use crate::transport::interface::{Header, Receiver, Sender, TransportError};
use crate::transport::lock_free::slots::{SlotReceiver, SlotSender, Slots};
use crate::transport::lock_free::words::LINE;

/// The size of the ring of a link for `capacity` samples of `size` bytes, bytes.
pub(super) fn ring_bytes(size: usize, capacity: usize) -> u64 {
    8 * Slots::new(size, capacity).words() as u64
}

/// The service of one link. It exists as long as this value is held.
pub struct LinkService {
    ring: RingService,
    slots: Slots,
}

impl LinkService {
    /// Creates the service of link number `link` for samples of `size` bytes, `capacity` of them at a time.
    pub fn create(domain: &Domain, link: u32, size: usize, capacity: usize) -> Result<LinkService, DomainError> {
        Ok(LinkService {
            ring: RingService::create(domain, &format!("link/{link}"), 1)?,
            slots: Slots::new(size, capacity),
        })
    }

    /// Opens the service of link number `link`.
    pub fn open(domain: &Domain, link: u32, size: usize, capacity: usize) -> Result<LinkService, DomainError> {
        Ok(LinkService {
            ring: RingService::open(domain, &format!("link/{link}"))?,
            slots: Slots::new(size, capacity),
        })
    }

    /// The sending end.
    pub fn sender(&self, domain: &Domain) -> Result<LinkSender, DomainError> {
        Ok(LinkSender {
            ring: self
                .ring
                .writer(domain, self.slots.words() / LINE, self.slots.stride() / LINE)?,
            sender: SlotSender::new(self.slots),
        })
    }

    /// The receiving end.
    pub fn receiver(&self, domain: &Domain) -> Result<LinkReceiver, DomainError> {
        Ok(LinkReceiver {
            ring: self.ring.reader(domain)?,
            slots: self.slots,
            receiver: SlotReceiver::new(self.slots),
        })
    }
}

/// The sending end of a link in shared memory.
pub struct LinkSender {
    ring: RingWriter,
    sender: SlotSender,
}

impl Sender for LinkSender {
    fn prepare(&mut self) -> Result<(), TransportError> {
        self.ring.memory().map(|_| ())
    }

    fn try_send(&mut self, header: Header, payload: &[u8]) -> Result<bool, TransportError> {
        match self.ring.memory()? {
            Some((words, count)) => self.sender.try_send(words, count, header, payload),
            None => Ok(false),
        }
    }
}

/// The receiving end of a link in shared memory.
pub struct LinkReceiver {
    ring: RingReader,
    slots: Slots,
    receiver: SlotReceiver,
}

impl Receiver for LinkReceiver {
    fn prepare(&mut self) -> Result<(), TransportError> {
        self.ring.memory().map(|_| ())
    }

    fn try_receive(&mut self, payload: &mut [u8]) -> Result<Option<Header>, TransportError> {
        self.slots.check_size(payload.len())?;
        match self.ring.memory()? {
            Some((words, count)) => self.receiver.try_receive(words, count, payload),
            None => Ok(None),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::test_domain::TestDomain;
    use super::*;
    use crate::transport::lock_free::slots::HEADER_WORDS;
    use std::sync::atomic::{AtomicBool, Ordering};

    #[test]
    fn received_sample_is_stable_while_sender_overwrites() {
        let test = TestDomain::new();
        let service = LinkService::create(&test.domain, 0, 64, 4).expect("a new domain has room");
        let mut receiver = service.receiver(&test.domain).expect("the only receiver");
        let mut sender = service.sender(&test.domain).expect("the only sender");
        let done = AtomicBool::new(false);
        sender.prepare().expect("a receiver is there");
        for index in 0..4 {
            let header = Header { index, stamp: 0 };
            assert_eq!(sender.try_send(header, &[7; 64]), Ok(true));
        }
        let words = sender.ring.memory().expect("handed over").expect("taken").0;
        std::thread::scope(|scope| {
            scope.spawn(|| {
                for value in (0..).take_while(|_| !done.load(Ordering::Relaxed)) {
                    // All payloads: the words in front of them are what identifies samples.
                    for slot in words.chunks(receiver_stride()) {
                        slot[HEADER_WORDS..HEADER_WORDS + 8]
                            .iter()
                            .for_each(|word| word.set(value));
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
        let slots = Slots::new(64, 4);
        slots.stride()
    }
}
