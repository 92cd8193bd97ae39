//! Recorded history: samples that are on a tape already, read back by the stream numbers of a plan.

use std::path::Path;

use lockstep::plan::Plan;
use lockstep::port::Descriptor;
use lockstep::time::Timebase;
use lockstep::transport::Header;
use tape::{Event, ReadError, Reader, Records, Source, StreamSpec};

use crate::run::outcome::RunFailure;

/// A tape, with its streams mapped to those of a plan.
pub struct Played<S = Reader> {
    reader: S,
    /// Where each of the plan's streams is on the tape; `None` for one that is not there.
    streams: Vec<Option<Place>>,
    stamp_bytes: usize,
}

/// The position of a stream's samples.
#[derive(Clone, Copy)]
struct Place {
    /// The position of the stream on the tape.
    stream: usize,
    /// The distance of two samples on the tape, in samples of the plan's stream.
    every: u64,
    /// The number of the first sample on the tape, in steps of `every`.
    first: u64,
}

impl Played {
    /// Opens the tape in the folder `tape`; a `partial` one need not have all streams and samples.
    ///
    /// # Errors
    /// When it cannot be read, or when a stream of the plan is not on it with the same ports and sample times.
    pub fn open(tape: &Path, plan: &Plan, partial: bool) -> Result<Played, RunFailure> {
        Played::of(Reader::open(tape)?, plan, &tape.display().to_string(), partial)
    }

    /// The events on the tape.
    pub fn events(&self) -> Result<Vec<Event>, ReadError> {
        self.reader.events()
    }
}

impl<S: Source> Played<S> {
    /// Maps the tape `reader`, which is called `place` in messages.
    ///
    /// # Errors
    /// As [`Played::open`].
    pub fn of(reader: S, plan: &Plan, place: &str, partial: bool) -> Result<Played<S>, RunFailure> {
        let mut streams = Vec::new();
        for spec in crate::run::recording::streams::streams(plan) {
            let number = match reader.stream(&spec.name()) {
                Err(_) if partial => {
                    streams.push(None);
                    continue;
                }
                number => number?,
            };
            let played = &reader.streams()[number];
            let every = every(played, &spec).filter(|every| partial || *every == 1);
            let difference = if played.descriptor != spec.descriptor {
                Some("another payload")
            } else if every.is_none() {
                Some("another sample time")
            } else {
                None
            };
            if let Some(difference) = difference {
                return Err(RunFailure::Other(format!(
                    "the run cannot be resumed: `{}` has {difference} now than on the tape in {place}; change neither ports nor \
                     sample times of a run under way",
                    spec.name(),
                )));
            }
            streams.push(Some(Place {
                stream: number,
                every: every.unwrap_or(1),
                first: played.first_index,
            }));
        }
        let first = reader.streams().first();
        let stamp_bytes = first.map_or(8, |spec| spec.stride() - spec.descriptor.size as usize);
        Ok(Played {
            reader,
            streams,
            stamp_bytes,
        })
    }

    /// How many samples of stream number `stream` the tape has.
    fn count(&self, stream: usize) -> u64 {
        self.streams[stream].map_or(0, |place| self.reader.count(place.stream))
    }

    /// The payload of one sample; `None` where the tape does not have it.
    pub fn payload(&self, stream: u32, index: u64) -> Result<Option<Vec<u8>>, ReadError> {
        let Some(place) = self.streams[stream as usize].filter(|place| index.is_multiple_of(place.every)) else {
            return Ok(None);
        };
        let record = (index / place.every).checked_sub(place.first);
        let Some(record) = record.filter(|record| *record < self.reader.count(place.stream)) else {
            return Ok(None);
        };
        let mut bytes = vec![0; self.reader.streams()[place.stream].stride()];
        self.reader.read(place.stream, record, &mut bytes)?;
        Ok(Some(bytes.split_off(self.stamp_bytes)))
    }

    /// The tape itself.
    pub(crate) fn into_source(self) -> S {
        self.reader
    }

    /// Passes the first `counts` samples of each stream, as far as the tape has them, to `take`, in the order of simulated time.
    pub fn each_of(
        &self,
        plan: &Plan,
        counts: &[u64],
        mut take: impl FnMut(usize, u32, Header, &[u8]) -> Result<(), RunFailure>,
    ) -> Result<(), RunFailure> {
        let outputs = plan.participants.iter().enumerate();
        let outputs = outputs.flat_map(|(number, own)| own.interface.outputs.iter().map(move |_| number));
        let owners = outputs.chain(plan.seen.iter().map(|seen| seen.participant));
        let mut lanes = Vec::new();
        for ((stream, participant), needed) in owners.enumerate().zip(counts) {
            let there = self.count(stream);
            if there < *needed {
                return Err(RunFailure::Other(format!(
                    "the tape has {there} samples of `{}`; the checkpoint needs {needed}: take an earlier one with --from",
                    crate::run::recording::streams::streams(plan)[stream].name()
                )));
            }
            let Some(place) = self.streams[stream] else { continue };
            let first = Header {
                index: place.first * place.every,
                stamp: 0,
            };
            lanes.push(Lane {
                participant,
                stream: stream as u32,
                records: Records::new(&self.reader, place.stream),
                every: place.every,
                next: stamped(plan, participant, first),
                left: *needed,
            });
        }
        loop {
            let due = lanes.iter_mut().filter(|lane| lane.left > 0);
            let Some(lane) = due.min_by_key(|lane| (lane.next.stamp, lane.stream)) else {
                return Ok(());
            };
            let Some(record) = lane.records.next()? else {
                return Ok(());
            };
            take(lane.participant, lane.stream, lane.next, record.payload)?;
            lane.left -= 1;
            lane.next.index += lane.every;
            lane.next = stamped(plan, lane.participant, lane.next);
        }
    }
}

/// A stream that is merged with others in the order of time.
struct Lane<'a, S: Source> {
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

/// The distance of two samples of `played`, in samples of `spec`; `None` if the samples of `played` are not a subset of those of
/// `spec`.
fn every(played: &StreamSpec, spec: &StreamSpec) -> Option<u64> {
    let base = Timebase::from_times([played.period, spec.period]).ok()?;
    let (longer, shorter) = (base.ceil(played.period).ok()?, base.ceil(spec.period).ok()?);
    (played.offset == spec.offset && longer % shorter == 0).then_some((longer / shorter) as u64)
}

/// The first element in which two payloads differ: its name and both values.
pub fn difference(descriptor: &Descriptor, before: &[u8], now: &[u8]) -> String {
    let mut elements = descriptor
        .fields
        .iter()
        .flat_map(|field| (0..field.len()).map(move |at| (field, at)));
    let differs = elements.find(|(field, at)| {
        let size = field.element.size();
        let own = field.range().start + at * size..field.range().start + (at + 1) * size;
        before[own.clone()] != now[own]
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
