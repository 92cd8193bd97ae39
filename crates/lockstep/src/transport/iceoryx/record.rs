//! Everything a participant has for the tape, in parcels of many samples.
//!
//! A parcel is a row of entries, each of which is a header of three 64-bit words (stream or [`NOTE`], bytes, index) and one
//! of the stamp, then the payload, filled up to a multiple of 8.

use std::cell::RefCell;
use std::rc::Rc;

use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::*;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;

use super::domain::{Domain, DomainError};
use super::{Ipc, broken};
use crate::control::Note;
use crate::transport::{Broken, Header, Recording};
use crate::wire;

/// Stands where the stream's number does, for a note.
const NOTE: u64 = u64::MAX;
/// The size of an entry's header, bytes.
const ENTRY: usize = 32;
/// The least room in a parcel, bytes. A parcel is handed over when the next entry does not fit.
const PARCEL: usize = 8 * 1024;
/// The longest reason that a failing participant may give, bytes: a note fits into a parcel.
const REASON: usize = 6 * 1024;
/// Parcels on their way: enough for participants that exchange samples every two microseconds while the recorder naps. Only
/// what is used of them takes memory.
const PARCELS: usize = 512;

type Factory = PortFactory<Ipc, [u8], ()>;

fn builder(
    domain: &Domain,
    participant: &str,
) -> Result<iceoryx2::service::builder::publish_subscribe::Builder<[u8], (), Ipc>, DomainError> {
    let builder = domain
        .service(&format!("record/{participant}"))?
        .publish_subscribe::<[u8]>();
    Ok(builder.payload_alignment(Alignment::ALIGN_8))
}

/// The bytes of an entry with a payload of `size` bytes.
fn entry(size: usize) -> usize {
    (ENTRY + size).next_multiple_of(8)
}

/// The participant's end.
pub struct RecordSender {
    publisher: Publisher<Ipc, [u8], ()>,
    _service: Factory,
    /// Its capacity is the size of a parcel and never changes: a segment that grows would allocate at every loan.
    parcel: Vec<u8>,
    size: usize,
    /// The participant's first stream, and the bytes of the entries of one activation.
    first: u32,
    activation: usize,
}

impl RecordSender {
    /// Opens the way to the recorder for a participant whose activations append payloads of `sizes` bytes, that of stream
    /// `first` at first.
    pub fn open(domain: &Domain, participant: &str, first: u32, sizes: &[usize]) -> Result<RecordSender, DomainError> {
        let what = || format!("opening the record of `{participant}`");
        let service = builder(domain, participant)?
            .open()
            .map_err(|error| domain.failed(what(), error))?;
        let activation = sizes.iter().map(|&size| entry(size)).sum();
        let size = PARCEL.max(activation);
        let publisher = service
            .publisher_builder()
            .initial_max_slice_len(size)
            .max_loaned_samples(1)
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .create()
            .map_err(|error| domain.failed(what(), error))?;
        Ok(RecordSender {
            publisher,
            _service: service,
            parcel: Vec::with_capacity(size),
            size,
            first,
            activation,
        })
    }

    fn append(&mut self, head: [u64; 4], payload: &[u8]) {
        self.parcel.extend_from_slice(bytemuck::bytes_of(&head));
        self.parcel.extend_from_slice(payload);
        self.parcel.resize(self.parcel.len().next_multiple_of(8), 0);
    }

    /// Puts a note behind the samples so far; it travels with the next flush. `false` when there is no room now.
    pub fn note(&mut self, note: &Note) -> Result<bool, Broken> {
        let mut note = note.clone();
        if let Note::Failed { reason, .. } = &mut note {
            let end = (0..=REASON.min(reason.len()))
                .rev()
                .find(|&end| reason.is_char_boundary(end));
            reason.truncate(end.unwrap_or(0));
        }
        let bytes = wire::encode("a note", &note).map_err(|error| Broken(error.to_string()))?;
        if !self.fits(entry(bytes.len())) && !self.flush()? {
            return Ok(false);
        }
        self.append([NOTE, bytes.len() as u64, 0, 0], &bytes);
        Ok(true)
    }

    /// Whether `bytes` more have room behind what is there.
    fn fits(&self, bytes: usize) -> bool {
        self.parcel.len() + bytes <= self.size
    }

    fn flush(&mut self) -> Result<bool, Broken> {
        if self.parcel.is_empty() {
            return Ok(true);
        }
        let parcel = self
            .publisher
            .loan_slice_uninit(self.parcel.len())
            .map_err(|e| broken("no memory", e))?;
        let taken_by = parcel
            .write_from_slice(&self.parcel)
            .send()
            .map_err(|e| broken("sending", e))?;
        if taken_by > 0 {
            self.parcel.clear();
        }
        Ok(taken_by > 0)
    }
}

/// A [`RecordSender`] that the stepper and the host share: samples from the one, notes from the other.
#[derive(Clone)]
pub struct SharedRecord(pub Rc<RefCell<RecordSender>>);

impl Recording for SharedRecord {
    fn try_append(&mut self, stream: u32, header: Header, payload: &[u8]) -> Result<bool, Broken> {
        let mut sender = self.0.borrow_mut();
        // The samples of one activation travel together, so that whoever dies leaves whole activations.
        if stream == sender.first && !sender.fits(sender.activation) && !sender.flush()? {
            return Ok(false);
        }
        sender.append(
            [
                u64::from(stream),
                payload.len() as u64,
                header.index,
                header.stamp as u64,
            ],
            payload,
        );
        Ok(true)
    }

    fn try_flush(&mut self) -> Result<bool, Broken> {
        self.0.borrow_mut().flush()
    }
}

/// What came out of a parcel.
#[derive(Debug, Clone, PartialEq)]
pub enum Recorded<'a> {
    /// A sample of stream number `stream`.
    Sample {
        /// The stream.
        stream: u32,
        /// Index and stamp.
        header: Header,
        /// The payload.
        payload: &'a [u8],
    },
    /// A note.
    Note(Note),
}

/// The recorder's end.
pub struct RecordReceiver {
    subscriber: Subscriber<Ipc, [u8], ()>,
    _service: Factory,
}

impl RecordReceiver {
    /// Creates the way from `participant` to the recorder.
    pub fn create(domain: &Domain, participant: &str) -> Result<RecordReceiver, DomainError> {
        let what = || format!("creating the record of `{participant}`");
        let service = builder(domain, participant)?
            .enable_safe_overflow(false)
            .history_size(0)
            .subscriber_max_buffer_size(PARCELS)
            .subscriber_max_borrowed_samples(1)
            .max_publishers(2)
            .max_subscribers(1)
            .max_nodes(8)
            .create()
            .map_err(|error| domain.failed(what(), error))?;
        let subscriber = service
            .subscriber_builder()
            .buffer_size(PARCELS)
            .create()
            .map_err(|error| domain.failed(what(), error))?;
        Ok(RecordReceiver {
            subscriber,
            _service: service,
        })
    }

    /// Hands the entries of the next parcel to `take`; `false` when there is none. The parcel comes from another process:
    /// whatever it holds, this ends, and says what is wrong with it.
    pub fn receive<E: From<Broken>>(&self, take: impl FnMut(Recorded<'_>) -> Result<(), E>) -> Result<bool, E> {
        let Some(parcel) = self.subscriber.receive().map_err(|e| broken("receiving", e))? else {
            return Ok(false);
        };
        unpack(parcel.payload(), take).map(|()| true)
    }
}

/// Hands the entries of a parcel to `take`.
///
/// # Errors
/// What is wrong with the parcel, or what `take` says.
pub fn unpack<E: From<Broken>>(parcel: &[u8], mut take: impl FnMut(Recorded<'_>) -> Result<(), E>) -> Result<(), E> {
    let mut rest = parcel;
    while !rest.is_empty() {
        let (entry, after) = split_entry(rest)?;
        take(entry)?;
        rest = after;
    }
    Ok(())
}

fn split_entry(bytes: &[u8]) -> Result<(Recorded<'_>, &[u8]), Broken> {
    let torn = || Broken("a record that ends in the middle of an entry".to_owned());
    let (head, rest) = bytes.split_first_chunk::<ENTRY>().ok_or_else(torn)?;
    let word = |at: usize| u64::from_le_bytes(head[8 * at..8 * at + 8].try_into().expect("eight bytes"));
    let size = usize::try_from(word(1))
        .ok()
        .filter(|&size| size <= rest.len())
        .ok_or_else(torn)?;
    let (payload, rest) = rest.split_at(size);
    let padding = size.next_multiple_of(8) - size;
    let rest = rest.get(padding..).ok_or_else(torn)?;
    let entry = if word(0) == NOTE {
        Recorded::Note(wire::decode("a note", payload).map_err(|error| Broken(error.to_string()))?)
    } else {
        let stream = u32::try_from(word(0)).map_err(|_| Broken(format!("a record of stream {}", word(0))))?;
        Recorded::Sample {
            stream,
            header: Header {
                index: word(2),
                stamp: word(3) as i64,
            },
            payload,
        }
    };
    Ok((entry, rest))
}
