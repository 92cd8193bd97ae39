//! The description of a stream, and the index file.

use std::collections::HashSet;

use lockstep::name::is_name;
use lockstep::port::Descriptor;
use lockstep::time::Rational;
use serde::{Deserialize, Serialize};

use super::SpecError;
use super::format::{FORMAT_NAME, FORMAT_VERSION};

/// The size of the stamp before every payload, bytes.
pub(crate) const STAMP_BYTES: usize = 8;

/// The prefix of an input's name in the name of the stream that records what the participant saw there.
const SEEN: &str = "seen.";

/// The longest name of a participant or port on a tape, bytes.
const NAME_MAX: usize = 96;

/// The most streams of a tape: no run has more output ports, and an index with more is damaged.
const MAX_STREAMS: usize = 1 << 16;

/// The largest first index: no run takes more steps, and a larger one could overflow when a count of records is added.
const MAX_INDEX: u64 = 1 << 62;

/// One stream of a tape: an output port of a participant and the instants at which it publishes.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StreamSpec {
    /// The participant that owns the port: letters, digits, `_` and `-`.
    pub participant: String,
    /// The port: letters, digits, `_` and `-`; with the prefix `seen.`, an input whose values are recorded as the participant saw them.
    pub port: String,
    /// The stamp of sample 0.
    pub offset: Rational,
    /// The distance between two samples, positive.
    pub period: Rational,
    /// The index of the first sample on the tape; above zero when a run starts from a checkpoint.
    pub first_index: u64,
    /// The payload.
    pub descriptor: Descriptor,
}

impl StreamSpec {
    /// A stream that starts with sample 0.
    pub fn new(
        participant: impl Into<String>,
        port: impl Into<String>,
        descriptor: Descriptor,
        offset: Rational,
        period: Rational,
    ) -> StreamSpec {
        StreamSpec {
            participant: participant.into(),
            port: port.into(),
            offset,
            period,
            first_index: 0,
            descriptor,
        }
    }

    /// The stream of the values that `participant` sees at its input `port`, a sample for each activation, stamped with its instant.
    pub fn seen(
        participant: impl Into<String>,
        port: &str,
        descriptor: Descriptor,
        offset: Rational,
        period: Rational,
    ) -> StreamSpec {
        StreamSpec::new(participant, format!("{SEEN}{port}"), descriptor, offset, period)
    }

    /// True when this stream records what a participant saw at an input, not what one sent from an output.
    pub fn is_seen(&self) -> bool {
        self.port.starts_with(SEEN)
    }

    /// `participant.port`, the name of the stream everywhere.
    pub fn name(&self) -> String {
        format!("{}.{}", self.participant, self.port)
    }

    /// The name of the stream's file inside the tape.
    pub fn file_name(&self) -> String {
        format!("{}.{}.bin", self.participant, self.port)
    }

    /// The size of a record, stamp and payload, bytes.
    pub fn stride(&self) -> usize {
        STAMP_BYTES + self.descriptor.size as usize
    }

    /// The sort key for streams wherever an order is needed.
    pub(crate) fn key(&self) -> (&str, &str) {
        (&self.participant, &self.port)
    }

    /// Checks the properties that later code relies on: names that are safe as file names, a valid descriptor, a positive period.
    pub fn validate(&self) -> Result<(), SpecError> {
        let port = self.port.strip_prefix(SEEN).unwrap_or(&self.port);
        for (what, text) in [("participant", self.participant.as_str()), ("port", port)] {
            if !is_name(text, NAME_MAX) {
                return Err(SpecError::Name {
                    what,
                    name: text.to_owned(),
                });
            }
        }
        let stream = || self.name();
        if !self.period.is_positive() {
            return Err(SpecError::Period {
                stream: stream(),
                period: self.period,
            });
        }
        if self.first_index > MAX_INDEX {
            return Err(SpecError::FirstIndex {
                stream: stream(),
                index: self.first_index,
            });
        }
        self.descriptor.validate().map_err(|source| SpecError::Descriptor {
            stream: stream(),
            source,
        })?;
        let fields = &self.descriptor.fields;
        let texts = fields.iter().flat_map(|f| [&f.name, &f.unit, &f.frame]);
        for text in texts.chain([&self.descriptor.name]) {
            // These are separators in the canonical text of a descriptor, and two descriptors must never have the same text.
            if text.contains(|c: char| c == '|' || c.is_control()) {
                return Err(SpecError::Text {
                    stream: stream(),
                    text: text.clone(),
                });
            }
        }
        Ok(())
    }
}

/// Checks all streams of a tape, and that no two have the same name.
pub(crate) fn validate_all(streams: &[StreamSpec]) -> Result<(), SpecError> {
    if streams.len() > MAX_STREAMS {
        return Err(SpecError::TooMany {
            count: streams.len(),
            max: MAX_STREAMS,
        });
    }
    let mut seen = HashSet::new();
    for stream in streams {
        stream.validate()?;
        if !seen.insert(stream.key()) {
            return Err(SpecError::Repeated { stream: stream.name() });
        }
    }
    Ok(())
}

/// `index.json`.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Index {
    pub(crate) format: String,
    pub(crate) version: u32,
    pub(crate) streams: Vec<IndexEntry>,
}

/// A stream in `index.json`: the specification, and values derived from it for other readers.
#[derive(Debug, Serialize, Deserialize)]
pub(crate) struct IndexEntry {
    pub(crate) file: String,
    pub(crate) record_bytes: u64,
    #[serde(flatten)]
    pub(crate) spec: StreamSpec,
}

impl Index {
    /// The index of `streams`, in canonical order so that equal tapes have equal index files.
    pub(crate) fn of(streams: &[StreamSpec]) -> Index {
        let mut sorted: Vec<&StreamSpec> = streams.iter().collect();
        sorted.sort_by(|a, b| a.key().cmp(&b.key()));
        Index {
            format: FORMAT_NAME.to_owned(),
            version: FORMAT_VERSION,
            streams: sorted
                .into_iter()
                .map(|spec| IndexEntry {
                    file: spec.file_name(),
                    record_bytes: spec.stride() as u64,
                    spec: spec.clone(),
                })
                .collect(),
        }
    }
}

/// `seal.json`: the writer's final counts and hashes.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Seal {
    pub(crate) digest: super::Digest,
    pub(crate) streams: Vec<SealEntry>,
}

/// A stream in `seal.json`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SealEntry {
    pub(crate) stream: String,
    pub(crate) count: u64,
    pub(crate) blake3: super::Digest,
}
