//! A ring buffer: memory that one process writes and another reads, and the amount that has been read.
//!
//! The memory is one publish-subscribe sample. It is sent once, while it is empty, and written while the reader holds it. So data passing
//! through it needs no call of iceoryx2, which would allocate a handle on the heap for every sample. The reader's progress is on a
//! blackboard: a reader of iceoryx2 cannot write into a sample.

use std::ptr::NonNull;

use iceoryx2::port::DegradationAction;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::reader::{EntryHandle, Reader};
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::port::writer::{EntryHandleMut, Writer};
use iceoryx2::prelude::*;
use iceoryx2::sample::Sample;
use iceoryx2::service::builder::publish_subscribe::Builder;
use iceoryx2::service::port_factory::{blackboard, publish_subscribe};

use super::domain::{Domain, DomainError};
use super::ipc::{Ipc, transport_error};
use crate::transport::interface::TransportError;
use crate::transport::lock_free::board::{Get, Set};
use crate::transport::lock_free::words::{LINE, Word};

/// Lines of a page of memory.
const PAGE: usize = 64;
/// The key of the reader's progress on the blackboard.
const TAKEN: u64 = 0;

/// A cache line of words: the unit of shared memory.
#[derive(Debug)]
#[repr(transparent)]
pub(super) struct Line([Word; LINE]);

// SAFETY: consecutive 64-bit integers: no pointers, no padding, no drop.
unsafe impl ZeroCopySend for Line {
    unsafe fn type_name() -> &'static str {
        "EscapementLine"
    }
}

// A blackboard publishes with a release and is read with an acquire (`UnrestrictedAtomic` of iceoryx2).
impl<T: ZeroCopySend + Copy + std::fmt::Debug + 'static> Get<T> for EntryHandle<Ipc, u64, T> {
    #[inline]
    fn get(&self) -> T {
        *EntryHandle::get(self)
    }
}

impl<T: ZeroCopySend + Copy + std::fmt::Debug + 'static> Set<T> for EntryHandleMut<Ipc, u64, T> {
    #[inline]
    fn set(&self, value: T) {
        self.update_with_copy(value);
    }
}

/// The memory of a ring, and one end of the reader's progress.
type Shared<'a, Count> = (&'a [Word], &'a Count);
type CountReader = EntryHandle<Ipc, u64, u64>;
type CountWriter = EntryHandleMut<Ipc, u64, u64>;

/// The two services of one ring. They exist as long as this value is held.
pub(super) struct RingService {
    memory: publish_subscribe::PortFactory<Ipc, [Line], ()>,
    taken: blackboard::PortFactory<Ipc, u64>,
    name: String,
}

impl RingService {
    fn memory(domain: &Domain, name: &str) -> Result<Builder<[Line], (), Ipc>, DomainError> {
        let builder = domain.service(name)?.publish_subscribe::<[Line]>();
        Ok(builder.payload_alignment(Alignment::new(8 * LINE).expect("a power of two")))
    }

    /// Creates the services `name` for one reader and up to `writers` writers.
    pub(super) fn create(domain: &Domain, name: &str, writers: usize) -> Result<RingService, DomainError> {
        let failed = |error: &dyn std::fmt::Debug| domain.failed(format!("creating `{name}`"), error);
        let memory = Self::memory(domain, name)?
            .enable_safe_overflow(false)
            .history_size(0)
            .subscriber_max_buffer_size(1)
            .subscriber_max_borrowed_samples(1)
            .max_publishers(writers)
            .max_subscribers(1)
            .max_nodes(writers + 3)
            .create()
            .map_err(|error| failed(&error))?;
        let taken = domain
            .service(name)?
            .blackboard_creator::<u64>()
            .add::<u64>(TAKEN, 0)
            .max_readers(writers)
            .max_nodes(writers + 3)
            .create()
            .map_err(|error| failed(&error))?;
        let name = name.to_owned();
        Ok(RingService { memory, taken, name })
    }

    /// Opens the services `name`.
    pub(super) fn open(domain: &Domain, name: &str) -> Result<RingService, DomainError> {
        let failed = |error: &dyn std::fmt::Debug| domain.failed(format!("opening `{name}`"), error);
        let memory = Self::memory(domain, name)?.open().map_err(|error| failed(&error))?;
        let taken = domain
            .service(name)?
            .blackboard_opener::<u64>()
            .open()
            .map_err(|error| failed(&error))?;
        let name = name.to_owned();
        Ok(RingService { memory, taken, name })
    }

    /// The processes that have opened a writing end, according to themselves.
    pub(super) fn writers(&self) -> Vec<u32> {
        let mut writers = Vec::new();
        self.memory.dynamic_config().list_publishers(|writer| {
            let process = writer.node_id.pid::<Ipc>().ok();
            writers.extend(process.and_then(|process| u32::try_from(process.value()).ok()));
            CallbackProgression::Continue
        });
        writers
    }

    /// The writing end of a ring of `lines`. The first word of every line whose number is a multiple of `cleared` is initialised to zero.
    pub(super) fn writer(&self, domain: &Domain, lines: usize, cleared: usize) -> Result<RingWriter, DomainError> {
        let failed =
            |error: &dyn std::fmt::Debug| domain.failed(format!("opening the writer of `{}`", self.name), error);
        let publisher = self
            .memory
            .publisher_builder()
            .initial_max_slice_len(lines)
            .max_loaned_samples(1)
            .override_sample_preallocation(|_| 1)
            // Memory without a reader is not lost: `memory` detects that, and sends it again.
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .set_degradation_handler(|_, _| DegradationAction::DegradeAndFail)
            .create()
            .map_err(|error| failed(&error))?;
        let reader = self.taken.reader_builder().create().map_err(|error| failed(&error))?;
        Ok(RingWriter {
            words: None,
            lines,
            cleared,
            count: reader.entry::<u64>(&TAKEN).map_err(|error| failed(&error))?,
            _reader: reader,
            publisher,
        })
    }

    /// The reading end.
    pub(super) fn reader(&self, domain: &Domain) -> Result<RingReader, DomainError> {
        let failed =
            |error: &dyn std::fmt::Debug| domain.failed(format!("opening the reader of `{}`", self.name), error);
        let subscriber = self
            .memory
            .subscriber_builder()
            .buffer_size(1)
            .set_degradation_handler(|_, _| DegradationAction::DegradeAndFail)
            .create()
            .map_err(|error| failed(&error))?;
        let writer = self.taken.writer_builder().create().map_err(|error| failed(&error))?;
        Ok(RingReader {
            received: None,
            taken: writer.entry::<u64>(&TAKEN).map_err(|error| failed(&error))?,
            _writer: writer,
            subscriber,
        })
    }
}

/// The writing end.
pub(super) struct RingWriter {
    /// The memory, once the reader holds it.
    words: Option<NonNull<[Word]>>,
    lines: usize,
    cleared: usize,
    count: CountReader,
    _reader: Reader<Ipc, u64>,
    publisher: Publisher<Ipc, [Line], ()>,
}

impl RingWriter {
    /// The memory, and the reader's progress; `None` while there is no reader.
    #[inline]
    pub(super) fn memory(&mut self) -> Result<Option<Shared<'_, CountReader>>, TransportError> {
        if self.words.is_none() {
            self.words = self.send_memory()?;
        }
        // SAFETY: the words lie in the publisher's segment, which is mapped as long as the publisher lives and of fixed size. They are
        // not reused: a sample that was taken is the last one that the publisher sends, and the reader holds it to its end.
        Ok(self.words.map(|words| (unsafe { words.as_ref() }, &self.count)))
    }

    fn send_memory(&self) -> Result<Option<NonNull<[Word]>>, TransportError> {
        let mut sample = self
            .publisher
            .loan_slice_uninit(self.lines)
            .map_err(|error| transport_error("no memory", error))?;
        let lines = NonNull::from(sample.payload_mut());
        let words = NonNull::slice_from_raw_parts(lines.cast::<Word>(), LINE * self.lines);
        // Every page is touched now, so that a lack of memory is detected here and not in a step.
        let pages = (0..words.len()).step_by(LINE * PAGE);
        for first in (0..words.len()).step_by(LINE * self.cleared).chain(pages) {
            // SAFETY: within the loan, which only this process can access until it is sent.
            unsafe { words.cast::<Word>().add(first).write(Word::new(0)) };
        }
        // SAFETY: shared memory contains zeros or earlier data, and every bit pattern is a `Line`.
        let sample = unsafe { sample.assume_init() };
        let taken_by = sample.send().map_err(|error| transport_error("sending", error))?;
        Ok((taken_by > 0).then_some(words))
    }
}

/// The reading end.
pub(super) struct RingReader {
    received: Option<ReceivedMemory>,
    taken: CountWriter,
    _writer: Writer<Ipc, u64>,
    subscriber: Subscriber<Ipc, [Line], ()>,
}

/// Memory that the reader has received.
struct ReceivedMemory {
    /// Its address and size, read once: iceoryx2 looks them up in a header that the writer could change.
    words: NonNull<[Word]>,
    _sample: Sample<Ipc, [Line], ()>,
}

impl RingReader {
    /// The memory, once it has arrived, and the entry where the reader counts its progress.
    #[inline]
    pub(super) fn memory(&mut self) -> Result<Option<Shared<'_, CountWriter>>, TransportError> {
        if self.received.is_none() {
            let sample = self
                .subscriber
                .receive()
                .map_err(|error| transport_error("receiving", error))?;
            self.received = sample.map(|sample| {
                let lines = NonNull::from(sample.payload());
                ReceivedMemory {
                    words: NonNull::slice_from_raw_parts(lines.cast::<Word>(), LINE * lines.len()),
                    _sample: sample,
                }
            });
        }
        // SAFETY: the sample keeps its memory mapped, and this borrow keeps the sample. All access is through atomics.
        Ok((self.received.as_ref()).map(|received| (unsafe { received.words.as_ref() }, &self.taken)))
    }

    /// Whether more memory has been sent, which will not be read.
    pub(super) fn has_further_memory(&self) -> Result<bool, TransportError> {
        self.subscriber
            .has_samples()
            .map_err(|error| transport_error("receiving", error))
    }
}

#[cfg(test)]
mod tests {
    use super::super::test_domain::TestDomain;
    use super::*;
    use crate::transport::lock_free::room::read_progress;

    #[test]
    fn ring_rejects_impossible_progress_count() {
        let test = TestDomain::new();
        let service = RingService::create(&test.domain, "ring", 1).expect("a new domain has room");
        let reader = service.reader(&test.domain).expect("the only reader");
        let writer = service.writer(&test.domain, 4, 2).expect("the only writer");
        assert_eq!(read_progress(&writer.count, 0, 0), Ok(0));
        reader.taken.set(3);
        assert_eq!(read_progress(&writer.count, 0, 5), Ok(3));
        assert!(read_progress(&writer.count, 0, 2).is_err(), "more than there is");
        assert!(read_progress(&writer.count, 4, 5).is_err(), "less than before");
    }

    #[test]
    fn ring_memory_waits_for_reader_and_is_cleared() {
        let test = TestDomain::new();
        let service = RingService::create(&test.domain, "ring", 1).expect("a new domain has room");
        let mut writer = service.writer(&test.domain, 4, 2).expect("the only writer");
        assert_eq!(
            writer.memory().map(|memory| memory.is_some()),
            Ok(false),
            "there is no reader"
        );
        let mut reader = service.reader(&test.domain).expect("the only reader");
        assert_eq!(
            reader.memory().map(|memory| memory.is_some()),
            Ok(false),
            "nothing has been sent"
        );
        let (words, _) = writer.memory().expect("sent").expect("taken");
        assert_eq!((words.len(), words[0].get(), words[16].get()), (32, 0, 0));
        assert_eq!(words.as_ptr() as usize % 64, 0);
        words[9].set(7);
        words[0].store_release(1);
        let (words, _) = reader.memory().expect("received").expect("there");
        assert_eq!((words.len(), words[0].load_acquire(), words[9].get()), (32, 1, 7));
        assert_eq!(reader.has_further_memory(), Ok(false));
    }
}
