//! Where the samples of a run go: a tape on disk, one in memory, its digest alone, or nowhere.

use lockstep::plan::Plan;
use lockstep::transport::Header;
use tape::{AppendError, Digest, DigestSink, Event, EventKind, MemoryTape, Sink, Source, StreamSpec, Writer};

use crate::run::outcome::RunFailure;
use crate::run::saved::history::History;

/// What a run keeps of its samples.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Record {
    /// A run folder with the tape.
    #[default]
    Folder,
    /// The tape in memory, which grows during the run; no folder.
    Memory,
    /// The digest that the tape would have; no folder. Such a run cannot go back to a checkpoint.
    Digest,
    /// Nothing: figures alone; no folder. Such a run cannot go back to a checkpoint.
    Nothing,
}

impl Record {
    /// Whether samples are needed for what is recorded.
    pub(crate) fn needs_samples(self) -> bool {
        self != Record::Nothing
    }
}

/// The store of the samples.
pub(crate) enum Store {
    Disk(Writer),
    Memory { tape: MemoryTape, events: Vec<Event> },
    Digest(DigestSink),
    Nothing,
}

impl Store {
    /// The store that `record` asks for without a folder.
    pub(crate) fn without_folder(record: Record, streams: Vec<StreamSpec>) -> Result<Store, RunFailure> {
        let refused = |error: tape::SpecError| RunFailure::Other(error.to_string());
        Ok(match record {
            Record::Folder | Record::Nothing => Store::Nothing,
            Record::Memory => Store::Memory {
                tape: MemoryTape::new(streams).map_err(refused)?,
                events: Vec::new(),
            },
            Record::Digest => Store::Digest(DigestSink::new(streams).map_err(refused)?),
        })
    }

    /// Stores the next sample of a stream.
    #[inline]
    pub(crate) fn append(
        &mut self,
        stream: usize,
        index: u64,
        stamp_s: f64,
        payload: &[u8],
    ) -> Result<(), AppendError> {
        match self {
            Store::Disk(writer) => writer.append(stream, index, stamp_s, payload),
            Store::Memory { tape, .. } => tape.sample(stream, index, stamp_s, payload),
            Store::Digest(sink) => sink.sample(stream, index, stamp_s, payload),
            Store::Nothing => Ok(()),
        }
    }

    pub(crate) fn event(&mut self, event: &Event) -> Result<(), AppendError> {
        match self {
            Store::Disk(writer) => writer.event(event),
            Store::Memory { events, .. } => {
                events.push(event.clone());
                Ok(())
            }
            Store::Digest(_) | Store::Nothing => Ok(()),
        }
    }

    /// The events so far, without those of declared faults, which follow from the samples.
    pub(crate) fn events(&mut self, plan: &Plan) -> Result<Vec<Event>, RunFailure> {
        let mut events = match self {
            Store::Disk(writer) => History::open(writer.dir(), plan, true)?.events()?,
            Store::Memory { events, .. } => events.clone(),
            Store::Digest(_) | Store::Nothing => Vec::new(),
        };
        events.retain(|event| event.kind != EventKind::Fault);
        Ok(events)
    }

    /// The tape on disk, if there is one; a `partial` one does not have all samples.
    pub(crate) fn tape(&mut self, plan: &Plan, partial: bool) -> Result<Option<History>, RunFailure> {
        self.flush()?;
        match self {
            Store::Disk(writer) => History::open(writer.dir(), plan, partial).map(Some),
            _ => Ok(None),
        }
    }

    /// Flushes buffered data to the disk.
    pub(crate) fn flush(&mut self) -> Result<(), AppendError> {
        match self {
            Store::Disk(writer) => writer.flush(),
            _ => Ok(()),
        }
    }

    /// Whether samples can be read back.
    pub(crate) fn has_samples(&self) -> bool {
        matches!(self, Store::Disk(_) | Store::Memory { .. })
    }

    /// Keeps the first `counts` samples of each stream and no event.
    pub(crate) fn cut_back(&mut self, counts: &[u64]) -> Result<(), AppendError> {
        match self {
            Store::Disk(writer) => writer.truncate(counts),
            Store::Memory { tape, events } => {
                tape.truncate(counts);
                events.clear();
                Ok(())
            }
            Store::Digest(_) | Store::Nothing => Ok(()),
        }
    }

    /// Takes out the stored samples, which [`Store::return_samples`] returns.
    pub(crate) fn take_samples(&mut self, plan: &Plan, partial: bool) -> Result<StoredSamples, RunFailure> {
        match self {
            Store::Disk(_) => Ok(self
                .tape(plan, partial)?
                .map_or(StoredSamples::Nothing, StoredSamples::Disk)),
            Store::Memory { tape, .. } => {
                let tape = std::mem::take(tape);
                Ok(StoredSamples::Memory(History::of(tape, plan, "memory", partial)?))
            }
            Store::Digest(_) | Store::Nothing => Err(no_samples()),
        }
    }

    /// Returns the samples that were taken out.
    pub(crate) fn return_samples(&mut self, stored: StoredSamples) {
        if let (Store::Memory { tape, .. }, StoredSamples::Memory(history)) = (self, stored) {
            *tape = history.into_source();
        }
    }

    /// Closes the store; returns the digest of the tape.
    pub(crate) fn finish(self) -> Result<Option<Digest>, AppendError> {
        match self {
            Store::Disk(writer) => writer.finish().map(Some),
            Store::Memory { tape, .. } => Ok(tape.digest().ok()),
            Store::Digest(sink) => Ok(Some(sink.digest())),
            Store::Nothing => Ok(None),
        }
    }
}

/// Samples that are read back.
pub(crate) enum StoredSamples {
    Disk(History),
    Memory(History<MemoryTape>),
    Nothing,
}

impl StoredSamples {
    /// Passes the first `counts` samples of each stream to `take`, in the order of simulated time.
    pub(crate) fn for_each_sample(
        &self,
        plan: &Plan,
        counts: &[u64],
        take: impl FnMut(usize, u32, Header, &[u8]) -> Result<(), RunFailure>,
    ) -> Result<(), RunFailure> {
        match self {
            StoredSamples::Disk(history) => history.for_each_sample(plan, counts, take),
            StoredSamples::Memory(history) => history.for_each_sample(plan, counts, take),
            StoredSamples::Nothing => Err(no_samples()),
        }
    }

    /// The payload of one sample, if it was stored.
    pub(crate) fn payload(&self, stream: u32, index: u64) -> Result<Option<Vec<u8>>, RunFailure> {
        match self {
            StoredSamples::Disk(history) => Ok(history.payload(stream, index)?),
            StoredSamples::Memory(history) => Ok(history.payload(stream, index)?),
            StoredSamples::Nothing => Err(no_samples()),
        }
    }
}

/// The failure that the run keeps no samples that could be read back.
pub(crate) fn no_samples() -> RunFailure {
    RunFailure::Other(
        "the run cannot go back: it keeps no samples; start it with a folder or with the tape in memory (`Record::Memory`)".into(),
    )
}
