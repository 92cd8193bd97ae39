//! Everything a participant has for the tape, in parcels of many samples.
//!
//! A parcel is sent while it is still empty, and filled while the recorder holds it: appending a sample is a copy into shared
//! memory, and one store commits those of an activation. From then on the recorder finds them, whatever becomes of the
//! participant. The first
//! word of a parcel says how many bytes of entries are committed, and whether any more will come ([`CLOSED`]).
//!
//! An entry is a header of four 64-bit words (stream or [`NOTE`], bytes, index, stamp), then the payload, filled up to a
//! multiple of 8.

use std::cell::RefCell;
use std::mem::MaybeUninit;
use std::ptr::NonNull;
use std::rc::Rc;

use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::*;
use iceoryx2::sample::Sample;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;

use super::domain::{Domain, DomainError};
use super::words::{Word, put};
use super::{Ipc, broken};
use crate::control::Note;
use crate::transport::{Broken, Header, Recording};
use crate::wire;

/// Stands where the stream's number does, for a note.
const NOTE: u64 = u64::MAX;
/// The size of an entry's header, bytes.
const ENTRY: usize = 32;
/// Added to the count of committed bytes when no more will come.
const CLOSED: u64 = 1 << 63;
/// The least room in a parcel, bytes. Sending one costs as much as sending a sample, so it should hold many samples; it
/// should also stay in a core's own cache.
const PARCEL: usize = 32 * 1024;
/// The longest reason that a failing participant may give, bytes: a note fits into a parcel.
const REASON: usize = 6 * 1024;
/// Parcels on their way: 4 MiB, enough for participants that exchange samples every two microseconds while the recorder
/// naps. Only what is used of them takes memory.
const PARCELS: usize = 128;

type Factory = PortFactory<Ipc, [Word], ()>;
type Builder = iceoryx2::service::builder::publish_subscribe::Builder<[Word], (), Ipc>;

fn builder(domain: &Domain, participant: &str) -> Result<Builder, DomainError> {
    Ok(domain
        .service(&format!("record/{participant}"))?
        .publish_subscribe::<[Word]>())
}

/// The words of an entry with a payload of `size` bytes.
fn words_of(size: usize) -> usize {
    (ENTRY + size).div_ceil(8)
}

/// A parcel that the recorder holds and that is still being filled.
struct Open {
    words: NonNull<[Word]>,
    /// Words that are written, the first one of the parcel included.
    used: usize,
}

impl Open {
    fn words(&self) -> &[Word] {
        // SAFETY: the words lie in the publisher's segment, which is mapped as long as the publisher lives and of fixed size,
        // and `RecordSender` drops the publisher last. Nobody reuses them: the recorder gives a parcel back only when it is
        // closed, after which there is no `Open` of it. All access is through atomics.
        unsafe { self.words.as_ref() }
    }

    fn room(&self) -> usize {
        self.words.len() - self.used
    }

    fn append(&mut self, head: [u64; 4], payload: &[u8]) {
        let words = &self.words()[self.used..];
        words.iter().zip(head).for_each(|(word, value)| word.set(value));
        put(&words[head.len()..], payload);
        self.used += words_of(payload.len());
    }

    /// Everything so far is there for the recorder.
    fn commit(&self, closed: u64) {
        let bytes = 8 * (self.used as u64 - 1);
        self.words()[0].announce(bytes | closed);
    }
}

/// The participant's end.
pub struct RecordSender {
    open: Option<Open>,
    /// Words of a parcel. It never changes: a segment that grows would move.
    size: usize,
    /// The stream that an activation begins with, and the words of the entries of one activation.
    first: u32,
    activation: usize,
    publisher: Publisher<Ipc, [Word], ()>,
    _service: Factory,
}

impl RecordSender {
    /// Opens the way to the recorder for a participant whose activations append payloads of `sizes` bytes, that of stream
    /// `first` at first.
    pub fn open(domain: &Domain, participant: &str, first: u32, sizes: &[usize]) -> Result<RecordSender, DomainError> {
        let what = || format!("opening the record of `{participant}`");
        let service = builder(domain, participant)?
            .open()
            .map_err(|error| domain.failed(what(), error))?;
        let activation = sizes.iter().map(|&size| words_of(size)).sum();
        let size = (PARCEL / 8).max(1 + activation);
        let publisher = service
            .publisher_builder()
            .initial_max_slice_len(size)
            .max_loaned_samples(1)
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .create()
            .map_err(|error| domain.failed(what(), error))?;
        Ok(RecordSender {
            open: None,
            size,
            first,
            activation,
            publisher,
            _service: service,
        })
    }

    /// A parcel with room for `words` more; `None` when there is none now.
    fn with_room(&mut self, words: usize) -> Result<Option<&mut Open>, Broken> {
        if self.open.as_ref().is_none_or(|open| open.room() < words) {
            if let Some(full) = self.open.take() {
                full.commit(CLOSED);
            }
            self.open = self.send()?;
        }
        Ok(self.open.as_mut().filter(|open| open.room() >= words))
    }

    fn sample(&mut self, stream: u32, header: Header, payload: &[u8]) -> Result<bool, Broken> {
        // The samples of one activation are committed together, so that whoever dies leaves whole activations.
        let words = if stream == self.first {
            self.activation
        } else {
            words_of(payload.len())
        };
        let Some(open) = self.with_room(words)? else {
            return Ok(false);
        };
        let size = payload.len() as u64;
        open.append([u64::from(stream), size, header.index, header.stamp as u64], payload);
        Ok(true)
    }

    /// Sends an empty parcel; `None` when there is no room for it now.
    fn send(&self) -> Result<Option<Open>, Broken> {
        let mut parcel = self
            .publisher
            .loan_slice_uninit(self.size)
            .map_err(|error| broken("no memory", error))?;
        let payload: &mut [MaybeUninit<Word>] = parcel.payload_mut();
        payload[0].write(Word::new(0));
        let words = NonNull::from(payload);
        let words = NonNull::slice_from_raw_parts(words.cast::<Word>(), self.size);
        // SAFETY: shared memory is zero or what an earlier parcel left there, and every bit pattern is a `Word`.
        let parcel = unsafe { parcel.assume_init() };
        let taken_by = parcel.send().map_err(|error| broken("sending", error))?;
        Ok((taken_by > 0).then_some(Open { words, used: 1 }))
    }

    /// Puts a note behind the samples so far. `false` when there is no room now.
    pub fn note(&mut self, note: &Note) -> Result<bool, Broken> {
        let mut note = note.clone();
        if let Note::Failed { reason, .. } = &mut note {
            let end = (0..=REASON.min(reason.len()))
                .rev()
                .find(|&end| reason.is_char_boundary(end));
            reason.truncate(end.unwrap_or(0));
        }
        let bytes = wire::encode("a note", &note).map_err(|error| Broken(error.to_string()))?;
        let Some(open) = self.with_room(words_of(bytes.len()))? else {
            return Ok(false);
        };
        open.append([NOTE, bytes.len() as u64, 0, 0], &bytes);
        open.commit(0);
        Ok(true)
    }
}

/// A [`RecordSender`] that the stepper and the host share: samples from the one, notes from the other.
#[derive(Clone)]
pub struct SharedRecord(pub Rc<RefCell<RecordSender>>);

impl Recording for SharedRecord {
    fn try_append(&mut self, stream: u32, header: Header, payload: &[u8]) -> Result<bool, Broken> {
        self.0.borrow_mut().sample(stream, header, payload)
    }

    fn commit(&mut self) {
        if let Some(open) = &self.0.borrow().open {
            open.commit(0);
        }
    }

    fn try_flush(&mut self) -> Result<bool, Broken> {
        // Every activation was handed over when it was complete.
        Ok(true)
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
    /// The parcel that is being filled, and how many of its bytes have been taken.
    open: Option<Sample<Ipc, [Word], ()>>,
    taken: usize,
    /// What is looked at: a copy, so that what is checked is what is used, whatever the sender does to its memory.
    copy: Vec<u64>,
    subscriber: Subscriber<Ipc, [Word], ()>,
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
            open: None,
            taken: 0,
            copy: Vec::with_capacity(PARCEL / 8),
            subscriber,
            _service: service,
        })
    }

    /// Hands the entries that have come to `take`, of one parcel at most; `false` when there is none. The parcel comes from
    /// another process: whatever it holds, this ends, and says what is wrong with it.
    pub fn receive<E: From<Broken>>(&mut self, take: impl FnMut(Recorded<'_>) -> Result<(), E>) -> Result<bool, E> {
        if !self.copy_new()? {
            return Ok(false);
        }
        unpack(&self.copy, take).map(|()| true)
    }

    /// A parcel is closed before the next one is sent. Who sends one beside it would be heard no more, so that is told.
    fn look_for_another(&self) -> Result<(), Broken> {
        let more = self.subscriber.has_samples();
        let more = more.map_err(|e| broken("its record cannot be received", e))?;
        let fill =
            |parcel: &Sample<Ipc, [Word], ()>| parcel.payload().first().map(Word::heard);
        // Looked at again: it may have been closed just before the next one was sent.
        match self.open.as_ref().and_then(fill) {
            Some(fill) if more && fill & CLOSED == 0 => Err(Broken(
                "recorded a parcel beside one that is still open: close it first, and open one publisher of the record"
                    .into(),
            )),
            _ => Ok(()),
        }
    }

    /// Copies what has been committed since the last time; `false` when nothing has.
    fn copy_new(&mut self) -> Result<bool, Broken> {
        loop {
            if self.open.is_none() {
                let sample = self.subscriber.receive();
                self.open = sample.map_err(|e| broken("its record cannot be received", e))?;
                self.taken = 0;
            }
            let Some(parcel) = &self.open else { return Ok(false) };
            let words = parcel.payload();
            let fill = words.first().map(Word::heard);
            let (from, to) = (self.taken, committed(fill, words.len(), self.taken)?);
            let new = words[1 + from..1 + to].iter().map(Word::get);
            self.copy.clear();
            self.copy.extend(new);
            self.taken = to;
            let closed = fill.is_some_and(|fill| fill & CLOSED != 0);
            if closed {
                self.open = None;
            }
            if from < to {
                return Ok(true);
            }
            if !closed {
                return self.look_for_another().map(|()| false);
            }
        }
    }
}

/// Hands the entries of a parcel, given in words, to `take`.
///
/// # Errors
/// What is wrong with the parcel, or what `take` says.
pub fn unpack<E: From<Broken>>(parcel: &[u64], mut take: impl FnMut(Recorded<'_>) -> Result<(), E>) -> Result<(), E> {
    let mut rest = parcel;
    while !rest.is_empty() {
        let (entry, after) = split_entry(rest)?;
        take(entry)?;
        rest = after;
    }
    Ok(())
}

/// The words of entries that a parcel of `len` words has, which begins with `fill`; `taken` were there before.
fn committed(fill: Option<u64>, len: usize, taken: usize) -> Result<usize, Broken> {
    let odd = |what: String| Err(Broken(format!("recorded a parcel {what}")));
    let Some(fill) = fill else {
        return odd("without a word".into());
    };
    let bytes = fill & !CLOSED;
    match usize::try_from(bytes / 8) {
        Ok(words) if bytes.is_multiple_of(8) && words < len && words >= taken => Ok(words),
        Ok(words) if words < taken => odd(format!("that shrank from {} bytes to {bytes}", 8 * taken)),
        _ => odd(format!("of {} bytes with {bytes} committed", 8 * len)),
    }
}

fn split_entry(words: &[u64]) -> Result<(Recorded<'_>, &[u64]), Broken> {
    let torn = || Broken("recorded an entry that ends outside of its parcel".to_owned());
    let (&[stream, size, index, stamp], rest) = words.split_first_chunk().ok_or_else(torn)?;
    let bytes: &[u8] = bytemuck::cast_slice(rest);
    let payload = usize::try_from(size)
        .ok()
        .and_then(|size| bytes.get(..size))
        .ok_or_else(torn)?;
    let rest = &rest[payload.len().div_ceil(8)..];
    let entry = if stream == NOTE {
        Recorded::Note(
            wire::decode("a note", payload)
                .map_err(|error| Broken(format!("recorded a note that is none: {error}")))?,
        )
    } else {
        let stream = u32::try_from(stream).map_err(|_| Broken(format!("recorded a sample of stream {stream}")))?;
        let header = Header {
            index,
            stamp: stamp as i64,
        };
        Recorded::Sample {
            stream,
            header,
            payload,
        }
    };
    Ok((entry, rest))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// All entries, or what is wrong.
    fn read(words: &[u64]) -> Result<usize, Broken> {
        let (mut rest, mut count) = (words, 0);
        while !rest.is_empty() {
            rest = split_entry(rest)?.1;
            count += 1;
        }
        Ok(count)
    }

    #[test]
    fn whatever_a_parcel_holds_it_ends_with_a_reason() {
        let sample = [3, 9, 5, 50, 1, 2];
        assert_eq!(read(&[sample, sample].concat()), Ok(2));
        for bad in [
            &[3, 17, 5, 50, 1, 2][..], // ends outside
            &[3, u64::MAX, 5, 50, 1, 2],
            &[3, 1 << 63, 5, 50],
            &[3, 9, 5],                     // no whole header
            &[1 << 40, 0, 5, 50],           // a stream that nobody can have
            &[NOTE, 8, 0, 0, 77],           // no such note
            &[NOTE, 16, 0, 0, 0, u64::MAX], // a count without end
        ] {
            assert!(read(bad).is_err(), "{bad:?}");
        }
        for (fill, len, taken) in [
            (None, 0, 0),
            (Some(8), 1, 0),
            (Some(9), 8, 0),
            (Some(8), 8, 2),
            (Some(!CLOSED), 8, 0),
        ] {
            assert!(committed(fill, len, taken).is_err(), "{fill:?} {len} {taken}");
        }
        assert_eq!(committed(Some(16 | CLOSED), 3, 1), Ok(2));
    }

    #[test]
    fn random_words_never_panic() {
        let draws = crate::random::Stream::new(1, "parcels");
        for round in 0..20_000 {
            let word = |at: u64| draws.bits(64 * round + at);
            let words: Vec<u64> = (0..word(0) % 40)
                .map(|at| word(1 + at) >> (word(1 + at) % 64))
                .collect();
            let _ = read(&words);
            let _ = committed(words.first().copied(), words.len(), 1);
        }
    }
}
