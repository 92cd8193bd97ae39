//! Links: a ring of slots in shared memory, one writer, one reader, nothing lost.
//!
//! The ring is one sample of publish-subscribe. It is sent once, while it is empty, and written while the receiver holds it; so a
//! sample of the link costs two copies and one store, and no call of iceoryx2, which would make a handle for it on the heap. How many
//! samples the receiver has taken stands on a blackboard of its own: only what it has taken makes room.
//!
//! A slot is a whole number of cache lines: the number of the sample among all of the link (from 1 on; 0 while there is none), its
//! index, its stamp, its payload. The number is written last.

use std::ptr::NonNull;

use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::reader::{EntryHandle, Reader};
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::port::writer::{EntryHandleMut, Writer};
use iceoryx2::prelude::*;
use iceoryx2::sample::Sample;
use iceoryx2::service::builder::publish_subscribe::Builder;
use iceoryx2::service::port_factory::{blackboard, publish_subscribe};

use super::domain::{Domain, DomainError};
use super::words::{Word, put, take};
use super::{Ipc, broken};
use crate::transport::{Broken, Header, Receiver, Sender};

/// Words in front of a payload: number, index, stamp.
const HEAD: usize = 3;
/// Words of a cache line: slots begin on one of their own.
const LINE: usize = 8;
/// The key of the count of samples taken.
const TAKEN: u64 = 0;

/// The shape of a ring.
#[derive(Debug, Clone, Copy)]
struct Ring {
    /// Bytes of a payload.
    size: usize,
    capacity: usize,
}

impl Ring {
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
        Err(Broken(format!(
            "a sample of {payload} bytes on a link of {}",
            self.size
        )))
    }
}

/// The service of one link. Whoever holds it keeps the service alive.
pub struct LinkService {
    samples: publish_subscribe::PortFactory<Ipc, [Word], ()>,
    room: blackboard::PortFactory<Ipc, u64>,
    ring: Ring,
}

impl LinkService {
    fn samples(domain: &Domain, link: u32) -> Result<Builder<[Word], (), Ipc>, DomainError> {
        let builder = domain.service(&format!("link/{link}"))?.publish_subscribe::<[Word]>();
        Ok(builder.payload_alignment(Alignment::new(8 * LINE).expect("a power of two")))
    }

    /// Creates the service of link number `link` for samples of `size` bytes, `capacity` of them at a time.
    pub fn create(domain: &Domain, link: u32, size: usize, capacity: usize) -> Result<LinkService, DomainError> {
        let failed = |error: &dyn std::fmt::Debug| domain.failed(format!("creating link {link}"), error);
        let samples = Self::samples(domain, link)?
            .enable_safe_overflow(false)
            .history_size(0)
            .subscriber_max_buffer_size(1)
            .subscriber_max_borrowed_samples(1)
            .max_publishers(1)
            .max_subscribers(1)
            .max_nodes(4)
            .create()
            .map_err(|error| failed(&error))?;
        let room = domain
            .service(&format!("room/{link}"))?
            .blackboard_creator::<u64>()
            .add::<u64>(TAKEN, 0)
            .max_readers(1)
            .max_nodes(4)
            .create()
            .map_err(|error| failed(&error))?;
        let ring = Ring { size, capacity };
        Ok(LinkService { samples, room, ring })
    }

    /// Opens the service of link number `link`.
    pub fn open(domain: &Domain, link: u32, size: usize, capacity: usize) -> Result<LinkService, DomainError> {
        let failed = |error: &dyn std::fmt::Debug| domain.failed(format!("opening link {link}"), error);
        let samples = Self::samples(domain, link)?.open().map_err(|error| failed(&error))?;
        let room = domain
            .service(&format!("room/{link}"))?
            .blackboard_opener::<u64>()
            .open()
            .map_err(|error| failed(&error))?;
        let ring = Ring { size, capacity };
        Ok(LinkService { samples, room, ring })
    }

    /// The sending end.
    pub fn sender(&self, domain: &Domain) -> Result<LinkSender, DomainError> {
        let publisher = self
            .samples
            .publisher_builder()
            .initial_max_slice_len(self.ring.words())
            .max_loaned_samples(1)
            // A ring that nobody takes is not lost: `try_send` sees that, and sends it again.
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .create()
            .map_err(|error| domain.failed("opening a publisher", error))?;
        let failed = |error: &dyn std::fmt::Debug| domain.failed("opening a reader", error);
        let reader = self.room.reader_builder().create().map_err(|error| failed(&error))?;
        Ok(LinkSender {
            words: None,
            ring: self.ring,
            sent: 0,
            taken: 0,
            room: reader.entry::<u64>(&TAKEN).map_err(|error| failed(&error))?,
            _reader: reader,
            publisher,
        })
    }

    /// The receiving end.
    pub fn receiver(&self, domain: &Domain) -> Result<LinkReceiver, DomainError> {
        let subscriber = self
            .samples
            .subscriber_builder()
            .buffer_size(1)
            .create()
            .map_err(|error| domain.failed("opening a subscriber", error))?;
        let failed = |error: &dyn std::fmt::Debug| domain.failed("opening a writer", error);
        let writer = self.room.writer_builder().create().map_err(|error| failed(&error))?;
        Ok(LinkReceiver {
            held: None,
            ring: self.ring,
            taken: 0,
            room: writer.entry::<u64>(&TAKEN).map_err(|error| failed(&error))?,
            _writer: writer,
            subscriber,
        })
    }
}

/// The sending end of a link in shared memory.
pub struct LinkSender {
    /// The ring, once the receiver holds it.
    words: Option<NonNull<[Word]>>,
    ring: Ring,
    sent: u64,
    /// How many the receiver had taken when that was last looked at.
    taken: u64,
    room: EntryHandle<Ipc, u64, u64>,
    _reader: Reader<Ipc, u64>,
    publisher: Publisher<Ipc, [Word], ()>,
}

impl LinkSender {
    /// Hands the empty ring over; `None` while nobody is there to take it.
    fn hand_over(&self) -> Result<Option<NonNull<[Word]>>, Broken> {
        let words = self.ring.words();
        let sample = self
            .publisher
            .loan_slice_uninit(words)
            .map_err(|error| broken("no memory", error))?;
        let mut sample = sample.write_from_fn(|_| Word::new(0));
        let words = NonNull::from(sample.payload_mut());
        let taken_by = sample.send().map_err(|error| broken("sending", error))?;
        Ok((taken_by > 0).then_some(words))
    }

    /// Whether there is room for one more.
    fn has_room(&mut self) -> Result<bool, Broken> {
        let full = |taken| self.sent - taken >= self.ring.capacity as u64;
        if !full(self.taken) {
            return Ok(true);
        }
        let taken = *self.room.get();
        if taken < self.taken || taken > self.sent {
            return Err(Broken(format!(
                "the receiver says that it took {taken} samples, after {}, of {}",
                self.taken, self.sent
            )));
        }
        self.taken = taken;
        Ok(!full(taken))
    }
}

impl Sender for LinkSender {
    fn try_send(&mut self, header: Header, payload: &[u8]) -> Result<bool, Broken> {
        self.ring.fits(payload.len())?;
        if self.words.is_none() {
            self.words = self.hand_over()?;
        }
        let Some(words) = self.words else { return Ok(false) };
        if !self.has_room()? {
            return Ok(false);
        }
        // SAFETY: the words lie in the publisher's segment, which is mapped as long as the publisher lives and of fixed size, and the
        // publisher is dropped last. Nobody reuses them: this is the only sample that the publisher ever sends, and the receiver holds
        // it to its end. All access is through atomics.
        let slot = self.ring.slot(unsafe { words.as_ref() }, self.sent);
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
    held: Option<Sample<Ipc, [Word], ()>>,
    ring: Ring,
    taken: u64,
    room: EntryHandleMut<Ipc, u64, u64>,
    _writer: Writer<Ipc, u64>,
    subscriber: Subscriber<Ipc, [Word], ()>,
}

impl LinkReceiver {
    /// Takes the ring, when it is there.
    fn take_over(&self) -> Result<Option<Sample<Ipc, [Word], ()>>, Broken> {
        let held = self.subscriber.receive().map_err(|error| broken("receiving", error))?;
        match held.as_ref().map(|sample| sample.payload().len()) {
            Some(words) if words != self.ring.words() => Err(Broken(format!(
                "a ring of {words} words where {} are expected: {} slots of {}",
                self.ring.words(),
                self.ring.capacity,
                self.ring.stride()
            ))),
            _ => Ok(held),
        }
    }
}

impl Receiver for LinkReceiver {
    fn try_receive(&mut self, payload: &mut [u8]) -> Result<Option<Header>, Broken> {
        self.ring.fits(payload.len())?;
        if self.held.is_none() {
            self.held = self.take_over()?;
        }
        let Some(held) = &self.held else { return Ok(None) };
        let slot = self.ring.slot(held.payload(), self.taken);
        let (number, due) = (slot[0].heard(), self.taken + 1);
        if number != due {
            // The slot is empty, or still has what was taken out of it one round ago.
            return match number == due.saturating_sub(self.ring.capacity as u64) {
                true => Ok(None),
                false => Err(Broken(format!("sample number {number} of the link where number {due} is due"))),
            };
        }
        let header = Header {
            index: slot[1].get(),
            stamp: slot[2].get() as i64,
        };
        // A copy, so that what is checked is what is used, whatever the sender does to its memory afterwards.
        take(&slot[HEAD..], payload);
        self.taken = due;
        self.room.update_with_copy(due);
        Ok(Some(header))
    }
}
