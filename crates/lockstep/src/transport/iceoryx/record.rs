//! The record: everything a participant sends to the tape, as a ring of entries in one publish-subscribe sample that the recorder holds.

use std::cell::RefCell;
use std::rc::Rc;

use super::domain::{Domain, DomainError};
use super::ring::{RingReader, RingService, RingWriter};
use crate::control::ParticipantEvent;
use crate::transport::interface::{Header, Recording, TransportError};
use crate::transport::lock_free::entries::{EntryReceiver, EntrySender, Recorded, ring_words};
use crate::transport::lock_free::words::LINE;

fn name(participant: &str) -> String {
    format!("record/{participant}")
}

/// The participant's end.
pub struct RecordSender {
    ring: RingWriter,
    sender: EntrySender,
    _service: RingService,
}

impl RecordSender {
    /// Opens the record of a participant whose activations append payloads of `sizes` bytes, starting with that of stream `first`, with a
    /// ring of `room` bytes, or of the size of four activations if that is more.
    pub fn open(
        domain: &Domain,
        participant: &str,
        first: u32,
        sizes: &[usize],
        room: u32,
    ) -> Result<RecordSender, DomainError> {
        let service = RingService::open(domain, &name(participant))?;
        let size = ring_words(sizes, room);
        let lines = 1 + size / LINE;
        let mut ring = service.writer(domain, lines, lines)?;
        // The recorder is present. The memory is touched now, because that takes time which the run should not lose.
        let what = || format!("handing over the record of `{participant}`");
        match ring.memory() {
            Ok(Some(_)) => {}
            Ok(None) => return Err(domain.failed(what(), "the recorder did not take it")),
            Err(error) => return Err(domain.failed(what(), error)),
        }
        Ok(RecordSender {
            ring,
            sender: EntrySender::new(size, first, sizes),
            _service: service,
        })
    }

    fn try_append_sample(&mut self, stream: u32, header: Header, payload: &[u8]) -> Result<bool, TransportError> {
        match self.ring.memory()? {
            Some((words, count)) => self.sender.try_append_sample(words, count, stream, header, payload),
            None => Ok(false),
        }
    }

    /// Makes everything appended so far available to the recorder.
    fn commit(&mut self) {
        if let Ok(Some((words, _))) = self.ring.memory() {
            self.sender.commit(words);
        }
    }

    /// Appends an event after the samples so far. `false` when there is no room now.
    pub fn try_append_event(&mut self, event: &ParticipantEvent) -> Result<bool, TransportError> {
        match self.ring.memory()? {
            Some((words, count)) => self.sender.try_append_event(words, count, event),
            None => Ok(false),
        }
    }
}

/// A [`RecordSender`] that the stepper and the host share: the stepper appends samples, the host appends events.
#[derive(Clone)]
pub struct SharedRecord(pub Rc<RefCell<RecordSender>>);

impl Recording for SharedRecord {
    fn try_append(&mut self, stream: u32, header: Header, payload: &[u8]) -> Result<bool, TransportError> {
        self.0.borrow_mut().try_append_sample(stream, header, payload)
    }

    fn commit(&mut self) {
        self.0.borrow_mut().commit();
    }
}

/// The recorder's end.
pub struct RecordReceiver {
    ring: RingReader,
    receiver: EntryReceiver,
    service: RingService,
}

impl RecordReceiver {
    /// Creates the record of `participant`.
    pub fn create(domain: &Domain, participant: &str) -> Result<RecordReceiver, DomainError> {
        // One writer is expected; a second one is admitted so that its error can be reported.
        let service = RingService::create(domain, &name(participant), 2)?;
        Ok(RecordReceiver {
            ring: service.reader(domain)?,
            receiver: EntryReceiver::new(),
            service,
        })
    }

    /// The processes that have opened this record for writing, according to themselves: normally only that of the participant.
    pub fn writers(&self) -> Vec<u32> {
        self.service.writers()
    }

    /// Takes the memory of the record; `false` while it has not arrived. To be called when the participant has sent it: it is lost with a
    /// participant that leaves before it was taken.
    pub fn take_memory(&mut self) -> Result<bool, TransportError> {
        Ok(self.ring.memory()?.is_some())
    }

    /// Passes the entries that have arrived to `take`, at most one batch; `false` when there is none. They come from another process:
    /// whatever they contain, this call returns, and reports what is wrong with it.
    pub fn receive<E: From<TransportError>>(
        &mut self,
        take: impl FnMut(Recorded<'_>) -> Result<(), E>,
    ) -> Result<bool, E> {
        let Some((words, count)) = self.ring.memory()? else {
            return Ok(false);
        };
        let received = self.receiver.receive(words, count, take)?;
        if !received {
            self.reject_second_record()?;
        }
        Ok(received)
    }

    /// Reports a second record of the participant: without this check, samples on one of the two would be lost.
    fn reject_second_record(&self) -> Result<(), TransportError> {
        if self.ring.has_further_memory()? {
            return Err(TransportError(
                "opened a second way to the recorder: open one publisher of the record, and send one sample".into(),
            ));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::test_domain::TestDomain;
    use super::*;
    use std::sync::atomic::{AtomicBool, Ordering};

    #[test]
    fn record_entry_is_stable_while_writer_overwrites() {
        let draws = crate::random::Stream::new(2, "scribbles");
        for round in 0..20 {
            let test = TestDomain::new();
            let mut receiver = RecordReceiver::create(&test.domain, "a").expect("a new domain has room");
            let mut sender = RecordSender::open(&test.domain, "a", 0, &[64], 1 << 20).expect("the only writer");
            assert_eq!(receiver.writers(), [std::process::id()]);
            let mut index = 0;
            while index < 2000 && sender.try_append_sample(0, Header { index, stamp: 0 }, &[7; 64]) == Ok(true) {
                index += 1;
            }
            sender.commit();
            let (words, _) = sender.ring.memory().expect("handed over").expect("taken");
            let done = AtomicBool::new(false);
            std::thread::scope(|scope| {
                scope.spawn(|| {
                    for at in (0..).take_while(|_| !done.load(Ordering::Relaxed)) {
                        let draw = |which: u64| draws.bits((1 << 32) | (round << 20) | ((3 * at + which) % (1 << 20)));
                        // Anywhere near, including the count of committed words.
                        words[draw(0) as usize % 512].set(draw(1) >> (draw(2) % 64));
                    }
                });
                for _ in 0..100 {
                    let received = receiver.receive(|entry| {
                        if let Recorded::Sample { header, payload, .. } = entry {
                            let before = (header, payload.to_vec());
                            std::thread::yield_now();
                            assert_eq!(before, (header, payload.to_vec()));
                        }
                        Ok::<(), TransportError>(())
                    });
                    if received.is_err() {
                        break;
                    }
                }
                done.store(true, Ordering::Relaxed);
            });
        }
    }
}
