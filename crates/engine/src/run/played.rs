//! What is on a tape already, read back by the numbers of a plan.

use std::path::Path;

use lockstep::plan::{Cut, Plan, Position};
use lockstep::port::Descriptor;
use lockstep::transport::Header;
use tape::{Event, ReadError, Reader, Records, Source, StreamSpec};

use super::outcome::RunFailure;

/// A tape with the streams of a plan.
pub struct Played<S = Reader> {
    reader: S,
    /// The position on the tape of each of the plan's streams.
    streams: Vec<usize>,
    stamp_bytes: usize,
}

impl Played {
    /// The tape in the folder `tape`.
    ///
    /// # Errors
    /// When it cannot be read, or when a stream of the plan is not on it with the same ports and sample times.
    pub fn open(tape: &Path, plan: &Plan) -> Result<Played, RunFailure> {
        Played::of(Reader::open(tape)?, plan, &tape.display().to_string())
    }

    /// What has happened.
    pub fn events(&self) -> Result<Vec<Event>, ReadError> {
        self.reader.events()
    }
}

impl<S: Source> Played<S> {
    /// The tape `reader`, which lies in `place`.
    ///
    /// # Errors
    /// As [`Played::open`].
    pub fn of(reader: S, plan: &Plan, place: &str) -> Result<Played<S>, RunFailure> {
        let mut streams = Vec::new();
        for spec in super::streams::streams(plan) {
            let number = reader.stream(&spec.name())?;
            let played = &reader.streams()[number];
            let difference = if played.descriptor != spec.descriptor {
                Some("another payload")
            } else if (played.offset, played.period) != (spec.offset, spec.period) {
                Some("another sample time")
            } else {
                None
            };
            if let Some(difference) = difference {
                return Err(RunFailure::Other(format!(
                    "the run cannot be taken up: `{}` has {difference} now than on the tape in {place}; change neither ports nor \
                     sample times of a run under way",
                    spec.name(),
                )));
            }
            streams.push(number);
        }
        let first = reader.streams().first();
        let stamp_bytes = first.map_or(8, |spec| spec.stride() - spec.descriptor.size as usize);
        Ok(Played {
            reader,
            streams,
            stamp_bytes,
        })
    }

    /// How many samples of stream number `stream` there are.
    pub fn count(&self, stream: usize) -> u64 {
        self.reader.count(self.streams[stream])
    }

    /// The payload of one sample.
    pub fn payload(&self, stream: u32, index: u64) -> Result<Vec<u8>, ReadError> {
        let number = self.streams[stream as usize];
        let mut record = vec![0; self.reader.streams()[number].stride()];
        self.reader.read(number, index, &mut record)?;
        Ok(record.split_off(self.stamp_bytes))
    }

    /// The description of stream number `stream`.
    pub fn spec(&self, stream: u32) -> &StreamSpec {
        &self.reader.streams()[self.streams[stream as usize]]
    }

    /// The tape itself.
    pub(super) fn into_source(self) -> S {
        self.reader
    }

    /// Where everybody goes on at `cut`, each with the state that it has.
    pub(super) fn positions(&self, plan: &Plan, cut: &Cut) -> Result<Vec<Position>, RunFailure> {
        let numbers = 0..plan.participants.len();
        let positions = numbers.map(|number| plan.position(cut, number, |stream, index| self.payload(stream, index)));
        Ok(positions.collect::<Result<_, _>>()?)
    }

    /// Hands every sample before `cut` to `take`, in the order of simulated time.
    pub fn each_before(
        &self,
        plan: &Plan,
        cut: &Cut,
        mut take: impl FnMut(usize, u32, Header, &[u8]) -> Result<(), RunFailure>,
    ) -> Result<(), RunFailure> {
        struct Lane<'a, S: Source> {
            participant: usize,
            stream: u32,
            records: Records<'a, S>,
            next: Header,
            left: u64,
        }
        let outputs = plan.participants.iter().enumerate().flat_map(|(number, own)| {
            let samples = plan.samples_before(number, cut.next[number]);
            own.interface.outputs.iter().map(move |_| (number, samples))
        });
        let seen = plan
            .seen
            .iter()
            .map(|seen| (seen.participant, cut.next[seen.participant]));
        let mut lanes = Vec::new();
        for (stream, (participant, samples)) in outputs.chain(seen).enumerate() {
            if self.count(stream) < samples {
                return Err(RunFailure::Other(format!(
                    "the tape has {} samples of `{}`; the checkpoint needs {samples}: take an earlier one with --from",
                    self.count(stream),
                    self.spec(stream as u32).name()
                )));
            }
            lanes.push(Lane {
                participant,
                stream: stream as u32,
                records: Records::new(&self.reader, self.streams[stream]),
                next: Header {
                    index: 0,
                    stamp: plan.participants[participant].sample_time.instant(0),
                },
                left: samples,
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
            lane.next.index += 1;
            lane.next.stamp = plan.participants[lane.participant].sample_time.instant(lane.next.index);
        }
    }
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
