//! Excerpts: selected streams, fields and times of a tape, as a tape.

use lockstep::port::Descriptor;
use lockstep::time::Rational;

use super::spec::STAMP_BYTES;
use super::{ReadError, Source, StreamSpec, split_record};

/// A selection from a source: `participant.port` for a whole stream, `participant.port.field` for a field of it.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ExcerptSpec {
    /// Streams and fields; an empty list selects everything.
    pub names: Vec<String>,
    /// The earliest stamp.
    pub from: Option<Rational>,
    /// The latest stamp.
    pub to: Option<Rational>,
}

/// The selected part of another source, in the same order. Fields keep their names, units and bytes.
pub struct Excerpt<'a, S: Source + ?Sized> {
    source: &'a S,
    streams: Vec<StreamSpec>,
    selected: Vec<SelectedStream>,
}

/// A selected stream.
struct SelectedStream {
    stream: usize,
    /// The first record, and the number of records.
    first: u64,
    count: u64,
    /// The byte ranges of the selected fields in a record of the source, in order; `None` when the whole record is selected.
    parts: Option<Vec<std::ops::Range<usize>>>,
}

impl<'a, S: Source + ?Sized> Excerpt<'a, S> {
    /// Resolves `excerpt_spec` in `source`.
    ///
    /// # Errors
    /// A stream or field that does not exist, with those that do; an end before the beginning; a window without a sample of a
    /// selected stream, if there are samples; a tape that cannot be read.
    pub fn new(source: &'a S, excerpt_spec: &ExcerptSpec) -> Result<Excerpt<'a, S>, ReadError> {
        if let (Some(from), Some(to)) = (excerpt_spec.from, excerpt_spec.to)
            && to < from
        {
            return Err(ReadError::Window { from, to });
        }
        let all = source.streams();
        let mut fields: Vec<Option<Vec<usize>>> = vec![None; all.len()];
        for name in &excerpt_spec.names {
            let whole = name.split('.').count() <= 2;
            let (stream, field) = if whole {
                (source.stream(name)?, None)
            } else {
                let found = source.field(name)?;
                let own = all[found.stream].descriptor.fields.iter();
                (found.stream, own.clone().position(|field| *field == found.field))
            };
            let count = all[stream].descriptor.fields.len();
            let own = fields[stream].get_or_insert_default();
            match field {
                Some(field) => own.push(field),
                None => own.extend(0..count),
            }
        }
        let (mut streams, mut selected) = (Vec::new(), Vec::new());
        for (stream, fields) in fields.into_iter().enumerate() {
            if fields.is_none() && !excerpt_spec.names.is_empty() {
                continue;
            }
            let first = match excerpt_spec.from {
                Some(from) => records_before(source, stream, |stamp_s| stamp_s < from.seconds())?,
                None => 0,
            };
            let end = match excerpt_spec.to {
                Some(to) => records_before(source, stream, |stamp_s| stamp_s <= to.seconds())?,
                None => source.count(stream),
            };
            let mut spec = all[stream].clone();
            spec.first_index += first;
            let parts = fields.and_then(|fields| retain_fields(&mut spec.descriptor, &fields));
            streams.push(spec);
            selected.push(SelectedStream {
                stream,
                first,
                count: end.saturating_sub(first),
                parts,
            });
        }
        let excerpt = Excerpt {
            source,
            streams,
            selected,
        };
        excerpt.check_window(excerpt_spec)?;
        Ok(excerpt)
    }

    /// A window that leaves nothing of streams that have samples is a mistake, such as one after the end of the run.
    fn check_window(&self, excerpt_spec: &ExcerptSpec) -> Result<(), ReadError> {
        if self.selected.iter().any(|selected| selected.count > 0) {
            return Ok(());
        }
        let (mut first_s, mut last_s) = (f64::INFINITY, f64::NEG_INFINITY);
        for selected in &self.selected {
            let mut record = vec![0; self.source.streams()[selected.stream].stride()];
            if let Some(last) = self.source.count(selected.stream).checked_sub(1) {
                self.source.read(selected.stream, 0, &mut record)?;
                first_s = first_s.min(split_record(&record, 0).stamp_s);
                self.source.read(selected.stream, last, &mut record)?;
                last_s = last_s.max(split_record(&record, last).stamp_s);
            }
        }
        if first_s > last_s {
            // No stream has a sample, whatever the window is.
            return Ok(());
        }
        Err(ReadError::Outside {
            requested: Box::new([excerpt_spec.from, excerpt_spec.to]),
            first_s,
            last_s,
        })
    }
}

/// Keeps only `fields` in `descriptor`; returns their byte ranges in a record, if any field is removed.
fn retain_fields(descriptor: &mut Descriptor, fields: &[usize]) -> Option<Vec<std::ops::Range<usize>>> {
    if (0..descriptor.fields.len()).all(|field| fields.contains(&field)) {
        return None;
    }
    let all = std::mem::take(&mut descriptor.fields);
    let (mut parts, mut size) = (Vec::new(), 0);
    for (_, mut field) in all.into_iter().enumerate().filter(|(at, _)| fields.contains(at)) {
        let range = field.range();
        parts.push(STAMP_BYTES + range.start..STAMP_BYTES + range.end);
        field.offset = size;
        size += range.len() as u32;
        descriptor.fields.push(field);
    }
    descriptor.size = size;
    Some(parts)
}

/// The number of records of a stream before the first one whose stamp is not `before`.
fn records_before<S: Source + ?Sized>(
    source: &S,
    stream: usize,
    before: impl Fn(f64) -> bool,
) -> Result<u64, ReadError> {
    let mut record = vec![0; source.streams()[stream].stride()];
    let (mut low, mut high) = (0, source.count(stream));
    while low < high {
        let middle = low + (high - low) / 2;
        source.read(stream, middle, &mut record)?;
        if before(split_record(&record, middle).stamp_s) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    Ok(low)
}

impl<S: Source + ?Sized> Source for Excerpt<'_, S> {
    fn streams(&self) -> &[StreamSpec] {
        &self.streams
    }

    fn count(&self, stream: usize) -> u64 {
        self.selected[stream].count
    }

    fn read(&self, stream: usize, first: u64, records: &mut [u8]) -> Result<(), ReadError> {
        let stride = self.check_range(stream, first, records.len())?;
        let own = &self.selected[stream];
        let Some(parts) = &own.parts else {
            return self.source.read(own.stream, own.first + first, records);
        };
        let source_stride = self.source.streams()[own.stream].stride();
        let mut all = vec![0; records.len() / stride * source_stride];
        self.source.read(own.stream, own.first + first, &mut all)?;
        for (narrow, record) in records.chunks_exact_mut(stride).zip(all.chunks_exact(source_stride)) {
            let (stamp, mut rest) = narrow.split_at_mut(STAMP_BYTES);
            stamp.copy_from_slice(&record[..STAMP_BYTES]);
            for part in parts {
                let (field, behind) = rest.split_at_mut(part.len());
                field.copy_from_slice(&record[part.clone()]);
                rest = behind;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{MemoryTape, Records, Sink};
    use lockstep::port::{Element, Field};

    #[test]
    fn excerpt_rejects_reversed_window() {
        let tape = tape();
        let chosen = |from: i64, to: i64| {
            let excerpt_spec = ExcerptSpec {
                from: Some(Rational::from_millis(from)),
                to: Some(Rational::from_millis(to)),
                ..ExcerptSpec::default()
            };
            Excerpt::new(&tape, &excerpt_spec).map(|chosen| chosen.count(0))
        };
        assert_eq!(chosen(300, 300).unwrap(), 1);
        let error = chosen(500, 300).unwrap_err().to_string();
        assert!(error.contains("300 ms, is before the first one, 500 ms"), "{error}");
    }

    /// Streams `a.x` and `a.y` with the fields `u` (two bytes), `v` (a double) and `w` (a byte), whose bytes count up.
    fn tape() -> MemoryTape {
        let field = |name: &str, element, shape: &[u32], offset| Field {
            name: name.into(),
            element,
            shape: shape.to_vec(),
            unit: "m".into(),
            frame: String::new(),
            offset,
            values: Vec::new(),
        };
        let descriptor = Descriptor {
            name: "M".into(),
            size: 16,
            fields: vec![
                field("v", Element::F64, &[], 0),
                field("u", Element::U8, &[2], 8),
                field("w", Element::U8, &[6], 10),
            ],
        };
        let spec = |port| {
            StreamSpec::new(
                "a",
                port,
                descriptor.clone(),
                Rational::ZERO,
                Rational::from_millis(100),
            )
        };
        let mut tape = MemoryTape::new(vec![spec("x"), spec("y")]).unwrap();
        for index in 0..50 {
            let payload: Vec<u8> = (0..16).map(|at| at + 16 * index as u8).collect();
            (0..2).for_each(|stream| tape.sample(stream, index, index as f64 / 10.0, &payload).unwrap());
        }
        tape
    }

    fn excerpt_spec(names: &[&str], from: Option<i64>, to: Option<i64>) -> ExcerptSpec {
        ExcerptSpec {
            names: names.iter().map(|name| (*name).to_owned()).collect(),
            from: from.map(Rational::from_millis),
            to: to.map(Rational::from_millis),
        }
    }

    #[test]
    fn empty_excerpt_spec_selects_whole_tape() {
        let tape = tape();
        let all = Excerpt::new(&tape, &ExcerptSpec::default()).unwrap();
        assert_eq!(all.digest().unwrap(), tape.digest().unwrap());
    }

    #[test]
    fn excerpt_keeps_fields_and_times_of_tape() {
        let tape = tape();
        let some = Excerpt::new(&tape, &excerpt_spec(&["a.y.w", "a.y.v"], Some(950), Some(2000))).unwrap();
        assert_eq!(some.streams().len(), 1);
        let spec = &some.streams()[0];
        let names: Vec<&str> = spec.descriptor.fields.iter().map(|field| field.name.as_str()).collect();
        assert_eq!(
            (spec.name().as_str(), spec.first_index, names),
            ("a.y", 10, vec!["v", "w"])
        );
        let mut records = Records::new(&some, 0);
        for index in 10..=20 {
            let record = records.next().unwrap().unwrap();
            let first = 16 * index as u8;
            let expected: Vec<u8> = (0..8).chain(10..16).map(|at| at + first).collect();
            assert_eq!((record.index, record.stamp_s), (index, index as f64 / 10.0));
            assert_eq!(record.payload, expected);
        }
        assert_eq!(records.next().unwrap(), None);
    }

    #[test]
    fn excerpt_rejects_empty_window_and_unknown_name() {
        let tape = tape();
        for (from, to, message_part) in [
            (Some(5000), None, "lies at or after 5 s"),
            (Some(310), Some(390), "lies from 310 ms to 390 ms"),
            (None, Some(-1), "lies at or before"),
        ] {
            let error = Excerpt::new(&tape, &excerpt_spec(&[], from, to))
                .err()
                .unwrap()
                .to_string();
            assert!(
                error.contains(message_part) && error.contains("from 0.0 s to 4.9 s"),
                "{error}"
            );
        }
        // A tape without samples has none in any window.
        let empty = MemoryTape::new(tape.streams().to_vec()).unwrap();
        assert_eq!(
            Excerpt::new(&empty, &excerpt_spec(&[], Some(5000), None))
                .unwrap()
                .count(0),
            0
        );
        for (name, known) in [("a.z", "`a.x`"), ("a", "`a.x`"), ("a.x.q", "`w`")] {
            let error = Excerpt::new(&tape, &excerpt_spec(&[name], None, None))
                .err()
                .unwrap()
                .to_string();
            assert!(error.contains(known), "{error}");
        }
    }
}
