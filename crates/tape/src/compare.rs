//! Comparison of two tapes: whether they are bit-identical, and if not, where they first differ and by how much.

use std::cmp::Ordering;
use std::fmt;

use serde::Serialize;

use crate::{ReadError, Source, StreamSpec, split_record};

/// The result of a comparison of two tapes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// True when names, descriptions, sample times, lengths and all bytes are equal.
    pub identical: bool,
    /// Streams that could not be compared, or not to their end.
    pub streams: Vec<StreamDifference>,
    /// The difference with the earliest stamp; among those, of the first stream by name; of that, the first element.
    pub first: Option<FirstDifference>,
    /// Every field whose bytes differ somewhere, by stream and then in the order of the payload.
    pub fields: Vec<FieldDifference>,
    /// How many samples were compared.
    pub samples: u64,
}

/// A difference between the streams of two tapes.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(tag = "difference", rename_all = "kebab-case")]
pub enum StreamDifference {
    /// Only one tape has the stream.
    Missing {
        /// The stream.
        stream: String,
        /// Which tape lacks it: `A` or `B`.
        missing_in: char,
    },
    /// The descriptors differ, so the samples were not compared.
    Description {
        /// The stream.
        stream: String,
        /// The first difference.
        detail: String,
    },
    /// The sample time or the first index differs, so the samples were not compared.
    SampleTime {
        /// The stream.
        stream: String,
        /// The values of both tapes.
        detail: String,
    },
    /// One tape is longer; the samples that both have were compared.
    Length {
        /// The stream.
        stream: String,
        /// Samples in A.
        a: u64,
        /// Samples in B.
        b: u64,
    },
}

impl fmt::Display for StreamDifference {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            StreamDifference::Missing { stream, missing_in } => {
                write!(out, "stream {stream} is missing in {missing_in}")
            }
            StreamDifference::Description { stream, detail } => {
                write!(out, "stream {stream} is described differently: {detail}")
            }
            StreamDifference::SampleTime { stream, detail } => {
                write!(out, "stream {stream} has another sample time: {detail}")
            }
            StreamDifference::Length { stream, a, b } => {
                write!(out, "stream {stream} has {a} samples in A and {b} in B")
            }
        }
    }
}

/// The first element of the first sample that differs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FirstDifference {
    /// The stream.
    pub stream: String,
    /// The index of the sample.
    pub index: u64,
    /// Its stamp in A, s.
    pub stamp_s: f64,
    /// The element, such as `p_NB_N[2]`; `stamp` when the stamps themselves differ.
    pub element: String,
    /// The unit of both values.
    pub unit: String,
    /// The value in A.
    pub a: Value,
    /// The value in B.
    pub b: Value,
}

/// A number with its bits, because two different numbers may have the same text.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Value {
    /// The number as the shortest text that reads back to it (text, because JSON has no NaN).
    pub value: String,
    /// Its bytes in the payload, most significant first, hexadecimal.
    pub bits: String,
}

/// How far a field differs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FieldDifference {
    /// The field, `participant.port.field`.
    pub field: String,
    /// The largest absolute difference of an element; NaN (null in JSON) when one side is NaN and the other is not.
    pub largest: f64,
    /// The unit of the difference.
    pub unit: String,
    /// The element of the largest difference.
    pub element: String,
    /// The stamp of the largest difference, s.
    pub stamp_s: f64,
    /// How many samples differ in this field.
    pub samples: u64,
}

/// Compares two tapes.
pub fn compare(a: &(impl Source + ?Sized), b: &(impl Source + ?Sized)) -> Result<Comparison, ReadError> {
    let mut result = Comparison {
        identical: false,
        streams: Vec::new(),
        first: None,
        fields: Vec::new(),
        samples: 0,
    };
    let (in_a, in_b) = (sorted(a.streams()), sorted(b.streams()));
    for &(name_b, _) in &in_b {
        if in_a.iter().all(|(name_a, _)| *name_a != name_b) {
            result.streams.push(missing_stream(name_b, 'A'));
        }
    }
    for &(key, at_a) in &in_a {
        let Some(&(_, at_b)) = in_b.iter().find(|(name, _)| *name == key) else {
            result.streams.push(missing_stream(key, 'B'));
            continue;
        };
        let (spec_a, spec_b) = (&a.streams()[at_a], &b.streams()[at_b]);
        if let Some(difference) = compare_specs(spec_a, spec_b) {
            result.streams.push(difference);
            continue;
        }
        let (count_a, count_b) = (a.count(at_a), b.count(at_b));
        if count_a != count_b {
            result.streams.push(StreamDifference::Length {
                stream: spec_a.name(),
                a: count_a,
                b: count_b,
            });
        }
        compare_stream((a, at_a), (b, at_b), count_a.min(count_b), &mut result)?;
    }
    result.identical = result.streams.is_empty() && result.first.is_none();
    Ok(result)
}

fn sorted(streams: &[StreamSpec]) -> Vec<((&str, &str), usize)> {
    let mut keys: Vec<_> = streams
        .iter()
        .enumerate()
        .map(|(at, spec)| ((&*spec.participant, &*spec.port), at))
        .collect();
    keys.sort_unstable();
    keys
}

fn missing_stream((participant, port): (&str, &str), missing_in: char) -> StreamDifference {
    StreamDifference::Missing {
        stream: format!("{participant}.{port}"),
        missing_in,
    }
}

fn compare_specs(a: &StreamSpec, b: &StreamSpec) -> Option<StreamDifference> {
    if let Some(detail) = a.descriptor.difference(&b.descriptor) {
        return Some(StreamDifference::Description {
            stream: a.name(),
            detail,
        });
    }
    let timing = |s: &StreamSpec| {
        format!(
            "offset {}, period {}, from sample {}",
            s.offset, s.period, s.first_index
        )
    };
    (timing(a) != timing(b)).then(|| StreamDifference::SampleTime {
        stream: a.name(),
        detail: format!("{} against {}", timing(a), timing(b)),
    })
}

/// The number of bytes of a stream that are compared at once.
const CHUNK_BYTES: usize = 1 << 18;

fn compare_stream(
    (a, at_a): (&(impl Source + ?Sized), usize),
    (b, at_b): (&(impl Source + ?Sized), usize),
    count: u64,
    result: &mut Comparison,
) -> Result<(), ReadError> {
    let spec = &a.streams()[at_a];
    let stride = spec.stride();
    let chunk_records = (CHUNK_BYTES / stride).max(1);
    let (mut chunk_a, mut chunk_b) = (vec![0; chunk_records * stride], vec![0; chunk_records * stride]);
    let mut fields: Vec<Option<FieldDifference>> = vec![None; spec.descriptor.fields.len()];
    let mut first: Option<FirstDifference> = None;
    let mut next = 0;
    while next < count {
        let bytes = (count - next).min(chunk_records as u64) as usize * stride;
        let (records_a, records_b) = (&mut chunk_a[..bytes], &mut chunk_b[..bytes]);
        a.read(at_a, next, records_a)?;
        b.read(at_b, next, records_b)?;
        // Equal tapes are the usual case: single records are compared only when a chunk differs.
        if records_a != records_b {
            for (k, (x, y)) in records_a
                .chunks_exact(stride)
                .zip(records_b.chunks_exact(stride))
                .enumerate()
            {
                if x != y {
                    let index = spec.first_index + next + k as u64;
                    let found = compare_record(spec, index, x, y, &mut fields);
                    first = first.or(found);
                }
            }
        }
        next += (bytes / stride) as u64;
    }
    result.samples += count;
    result.fields.extend(fields.into_iter().flatten());
    if let Some(found) = first {
        let earlier = result
            .first
            .as_ref()
            .is_none_or(|best| found.stamp_s.total_cmp(&best.stamp_s) == Ordering::Less);
        if earlier {
            result.first = Some(found);
        }
    }
    Ok(())
}

/// Adds one pair of different records to `fields`; returns the first element that differs.
fn compare_record(
    spec: &StreamSpec,
    index: u64,
    a: &[u8],
    b: &[u8],
    fields: &mut [Option<FieldDifference>],
) -> Option<FirstDifference> {
    let (a, b) = (split_record(a, index), split_record(b, index));
    let found =
        |element: String, unit: &str, (x, x_bytes): (String, &[u8]), (y, y_bytes): (String, &[u8])| FirstDifference {
            stream: spec.name(),
            index,
            stamp_s: a.stamp_s,
            element,
            unit: unit.to_owned(),
            a: Value::of(x, x_bytes),
            b: Value::of(y, y_bytes),
        };
    let mut first = (a.stamp_s.to_bits() != b.stamp_s.to_bits()).then(|| {
        let (x, y) = (a.stamp_s.to_le_bytes(), b.stamp_s.to_le_bytes());
        let shown = |stamp: f64| format!("{stamp:?}");
        found("stamp".to_owned(), "s", (shown(a.stamp_s), &x), (shown(b.stamp_s), &y))
    });
    for (field, slot) in spec.descriptor.fields.iter().zip(fields) {
        let range = field.range();
        if a.payload[range.clone()] == b.payload[range] {
            continue;
        }
        let slot = slot.get_or_insert_with(|| FieldDifference {
            field: format!("{}.{}", spec.name(), field.name),
            largest: -1.0,
            unit: field.unit.clone(),
            element: String::new(),
            stamp_s: a.stamp_s,
            samples: 0,
        });
        slot.samples += 1;
        let size = field.element.size();
        for element in 0..field.len() {
            let start = field.offset as usize + element * size;
            let (x_bytes, y_bytes) = (&a.payload[start..start + size], &b.payload[start..start + size]);
            if x_bytes == y_bytes {
                continue;
            }
            let (x, y) = (field.value(a.payload, element), field.value(b.payload, element));
            if first.is_none() {
                let shown = |payload, value: f64| match field.element.room() {
                    Some(_) => field.shown(payload, element),
                    None => format!("{value:?}"),
                };
                let (x, y) = (shown(a.payload, x), shown(b.payload, y));
                first = Some(found(
                    field.element_name(element),
                    &field.unit,
                    (x, x_bytes),
                    (y, y_bytes),
                ));
            }
            // Texts have no distance: they are equal or not.
            let distance = field.element.room().map_or_else(|| distance(x, y), |_| 1.0);
            if exceeds(distance, slot.largest) {
                slot.largest = distance;
                slot.element = field.element_name(element);
                slot.stamp_s = a.stamp_s;
            }
        }
    }
    first
}

/// |x - y|; zero for two NaNs and for equal infinities, NaN for a NaN against a number.
fn distance(x: f64, y: f64) -> f64 {
    if x == y || (x.is_nan() && y.is_nan()) {
        0.0
    } else {
        (x - y).abs()
    }
}

/// NaN counts as the largest difference.
fn exceeds(distance: f64, largest: f64) -> bool {
    !largest.is_nan() && (distance.is_nan() || distance > largest)
}

impl Value {
    fn of(value: String, bytes: &[u8]) -> Value {
        Value {
            value,
            bits: bytes.iter().rev().map(|byte| format!("{byte:02x}")).collect(),
        }
    }
}
