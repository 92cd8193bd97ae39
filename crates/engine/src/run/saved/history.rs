//! Recorded history: samples that are on a tape already, read back by the stream numbers of a plan.

use std::path::Path;

use lockstep::plan::Plan;
use lockstep::port::Descriptor;
use lockstep::time::Timebase;
use lockstep::transport::Header;
use tape::{Event, ReadError, Reader, Records, Source, StreamSpec};

use crate::run::outcome::RunFailure;

/// A tape, with its streams mapped to those of a plan.
pub struct History<S = Reader> {
    reader: S,
    /// Where each of the plan's streams is on the tape; `None` for one that is not there.
    streams: Vec<Option<TapePosition>>,
    stamp_bytes: usize,
}

/// The position of a stream's samples.
#[derive(Clone, Copy)]
struct TapePosition {
    /// The position of the stream on the tape.
    stream: usize,
    /// The distance of two samples on the tape, in samples of the plan's stream.
    every: u64,
    /// The number of the first sample on the tape, in steps of `every`.
    first: u64,
}

impl History {
    /// Opens the tape in the folder `tape`; a `partial` one need not have all streams and samples.
    ///
    /// # Errors
    /// When it cannot be read, or when a stream of the plan is not on it with the same ports and sample times.
    pub fn open(tape: &Path, plan: &Plan, partial: bool) -> Result<History, RunFailure> {
        History::of(Reader::open(tape)?, plan, &tape.display().to_string(), partial)
    }

    /// The events on the tape.
    pub fn events(&self) -> Result<Vec<Event>, ReadError> {
        self.reader.events()
    }
}

impl<S: Source> History<S> {
    /// Maps the tape `reader`, which messages call `source`.
    ///
    /// # Errors
    /// As [`History::open`].
    pub fn of(reader: S, plan: &Plan, source: &str, partial: bool) -> Result<History<S>, RunFailure> {
        let mut streams = Vec::new();
        for spec in crate::run::recording::streams::streams(plan) {
            let number = match reader.stream(&spec.name()) {
                Err(_) if partial => {
                    streams.push(None);
                    continue;
                }
                number => number?,
            };
            let recorded = &reader.streams()[number];
            let every = every(recorded, &spec).filter(|every| partial || *every == 1);
            let difference = if recorded.descriptor != spec.descriptor {
                Some("another payload")
            } else if every.is_none() {
                Some("another sample time")
            } else {
                None
            };
            if let Some(difference) = difference {
                return Err(RunFailure::Other(format!(
                    "the run cannot be resumed: `{}` has {difference} now than on the tape in {source}; change neither ports nor \
                     sample times of a run under way",
                    spec.name(),
                )));
            }
            streams.push(Some(TapePosition {
                stream: number,
                every: every.unwrap_or(1),
                first: recorded.first_index,
            }));
        }
        let first = reader.streams().first();
        let stamp_bytes = first.map_or(8, |spec| spec.stride() - spec.descriptor.size as usize);
        Ok(History {
            reader,
            streams,
            stamp_bytes,
        })
    }

    /// How many samples of stream number `stream` the tape has.
    fn count(&self, stream: usize) -> u64 {
        self.streams[stream].map_or(0, |position| self.reader.count(position.stream))
    }

    /// The payload of one sample; `None` where the tape does not have it.
    pub fn payload(&self, stream: u32, index: u64) -> Result<Option<Vec<u8>>, ReadError> {
        let Some(position) = self.streams[stream as usize].filter(|position| index.is_multiple_of(position.every))
        else {
            return Ok(None);
        };
        let record = (index / position.every).checked_sub(position.first);
        let Some(record) = record.filter(|record| *record < self.reader.count(position.stream)) else {
            return Ok(None);
        };
        let mut bytes = vec![0; self.reader.streams()[position.stream].stride()];
        self.reader.read(position.stream, record, &mut bytes)?;
        Ok(Some(bytes.split_off(self.stamp_bytes)))
    }

    /// The tape itself.
    pub(crate) fn into_source(self) -> S {
        self.reader
    }

    /// Passes the first `counts` samples of each stream, as far as the tape has them, to `take`, in the order of simulated time.
    pub fn for_each_sample(
        &self,
        plan: &Plan,
        counts: &[u64],
        mut take: impl FnMut(usize, u32, Header, &[u8]) -> Result<(), RunFailure>,
    ) -> Result<(), RunFailure> {
        let outputs = plan.participants.iter().enumerate();
        let outputs = outputs.flat_map(|(number, planned)| planned.interface.outputs.iter().map(move |_| number));
        let owners = outputs.chain(plan.seen.iter().map(|seen| seen.participant));
        let mut merged_streams = Vec::new();
        for ((stream, participant), needed) in owners.enumerate().zip(counts) {
            let recorded_count = self.count(stream);
            if recorded_count < *needed {
                return Err(RunFailure::Other(format!(
                    "the tape has {recorded_count} samples of `{}`; the checkpoint needs {needed}: take an earlier one with --from",
                    crate::run::recording::streams::streams(plan)[stream].name()
                )));
            }
            let Some(position) = self.streams[stream] else { continue };
            let first = Header {
                index: position.first * position.every,
                stamp: 0,
            };
            merged_streams.push(MergedStream {
                participant,
                stream: stream as u32,
                records: Records::new(&self.reader, position.stream),
                every: position.every,
                next: stamped(plan, participant, first),
                left: *needed,
            });
        }
        loop {
            let due = merged_streams.iter_mut().filter(|merged| merged.left > 0);
            let Some(merged) = due.min_by_key(|merged| (merged.next.stamp, merged.stream)) else {
                return Ok(());
            };
            let Some(record) = merged.records.next()? else {
                return Ok(());
            };
            take(merged.participant, merged.stream, merged.next, record.payload)?;
            merged.left -= 1;
            merged.next.index += merged.every;
            merged.next = stamped(plan, merged.participant, merged.next);
        }
    }
}

/// A stream that is merged with others in the order of time.
struct MergedStream<'a, S: Source> {
    participant: usize,
    stream: u32,
    records: Records<'a, S>,
    every: u64,
    next: Header,
    left: u64,
}

/// `header` with the stamp that follows from its index.
fn stamped(plan: &Plan, participant: usize, header: Header) -> Header {
    Header {
        stamp: plan.participants[participant].sample_time.instant(header.index),
        ..header
    }
}

/// The distance of two samples of `recorded`, in samples of `spec`; `None` if the samples of `recorded` are not a subset of those of
/// `spec`.
fn every(recorded: &StreamSpec, spec: &StreamSpec) -> Option<u64> {
    let base = Timebase::from_times([recorded.period, spec.period]).ok()?;
    let (longer, shorter) = (base.ceil(recorded.period).ok()?, base.ceil(spec.period).ok()?);
    (recorded.offset == spec.offset && longer % shorter == 0).then_some((longer / shorter) as u64)
}

/// The first element in which two payloads differ: its name and both values.
pub fn difference(descriptor: &Descriptor, before: &[u8], now: &[u8]) -> String {
    let mut elements = descriptor
        .fields
        .iter()
        .flat_map(|field| (0..field.len()).map(move |at| (field, at)));
    let differs = elements.find(|(field, at)| {
        let size = field.element.size();
        let bytes = field.range().start + at * size..field.range().start + (at + 1) * size;
        before[bytes.clone()] != now[bytes]
    });
    match differs {
        Some((field, at)) => format!(
            "{} = {} {unit} where it was {} {unit}",
            field.element_name(at),
            field.shown(now, at),
            field.shown(before, at),
            unit = field.unit
        ),
        None => "other bytes".into(),
    }
}
