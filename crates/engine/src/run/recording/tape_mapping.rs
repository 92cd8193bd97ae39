//! The mapping from a run's samples to its tape.

use tape::{AppendError, StreamSpec};

use super::recorded_part::RecordedPart;
use super::store::Store;

/// Which samples of each stream are recorded, and where they go.
pub(crate) struct TapeMapping {
    /// For each stream of the run: which samples are recorded, and its number on the tape.
    all: Vec<(RecordedPart, usize)>,
    /// Whether all samples are recorded.
    whole: bool,
    /// The name of each stream and the size of its payloads, where samples are left out.
    left_out: Vec<(String, usize)>,
}

impl TapeMapping {
    /// The mapping for `streams`, of which `kept` is recorded, and the streams of the tape.
    pub(crate) fn new(kept: &[RecordedPart], streams: &[StreamSpec]) -> (TapeMapping, Vec<StreamSpec>) {
        let (mut all, mut specs) = (Vec::new(), Vec::new());
        for (kept, spec) in kept.iter().zip(streams) {
            match kept.spec(spec) {
                Some(spec) => {
                    all.push((*kept, specs.len()));
                    specs.push(spec);
                }
                None => all.push((RecordedPart::NOTHING, 0)),
            }
        }
        let whole = all.iter().all(|(kept, _)| kept.is_whole());
        let left_out = match whole {
            true => Vec::new(),
            false => streams
                .iter()
                .map(|spec| (spec.name(), spec.descriptor.size as usize))
                .collect(),
        };
        (TapeMapping { all, whole, left_out }, specs)
    }

    /// Whether all samples are recorded.
    pub(crate) fn is_whole(&self) -> bool {
        self.whole
    }

    /// Puts a sample into `store` if it is to be recorded.
    #[inline]
    pub(crate) fn put(
        &self,
        store: &mut Store,
        stream: usize,
        index: u64,
        stamp_s: f64,
        payload: &[u8],
    ) -> Result<(), AppendError> {
        match self.place(stream, index) {
            Some((stream_on_tape, index)) => store.append(stream_on_tape, index, stamp_s, payload),
            // The tape does not check samples that it does not get, so their size is checked here.
            None => match &self.left_out[stream] {
                (_, expected) if *expected == payload.len() => Ok(()),
                (name, expected) => Err(AppendError::Size {
                    stream: name.clone(),
                    index,
                    size: payload.len(),
                    expected: *expected,
                }),
            },
        }
    }

    /// Which samples of stream number `stream` the tape gets.
    pub(crate) fn kept(&self, stream: usize) -> RecordedPart {
        self.all[stream].0
    }

    /// Whether the tape gets sample `index` of stream number `stream`.
    pub(crate) fn has(&self, stream: usize, index: u64) -> bool {
        self.place(stream, index).is_some()
    }

    /// How many of the first `samples` samples of each stream of the run the tape gets.
    pub(crate) fn of_first(&self, samples: &[u64]) -> Vec<u64> {
        let all = self.all.iter().zip(samples);
        all.map(|((kept, _), samples)| kept.of_first(*samples)).collect()
    }

    /// As [`TapeMapping::of_first`], but by stream of the tape.
    pub(crate) fn on_tape(&self, samples: &[u64]) -> Vec<u64> {
        let all = self.all.iter().zip(self.of_first(samples));
        all.filter_map(|((kept, _), count)| (!kept.is_nothing()).then_some(count))
            .collect()
    }

    /// The stream on the tape, and the index there, of sample `index` of stream number `stream` of the run; `None` when it is left
    /// out.
    #[inline]
    fn place(&self, stream: usize, index: u64) -> Option<(usize, u64)> {
        if self.whole {
            return Some((stream, index));
        }
        let (kept, stream_on_tape) = self.all.get(stream)?;
        Some((*stream_on_tape, kept.number(index)?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lockstep::port::{Descriptor, Element, Field};
    use lockstep::time::Rational;

    fn stream(port: &str) -> StreamSpec {
        let field = Field {
            name: "x".into(),
            element: Element::F64,
            shape: Vec::new(),
            unit: "m".into(),
            frame: String::new(),
            offset: 0,
            values: Vec::new(),
        };
        let descriptor = Descriptor {
            name: "M".into(),
            size: 8,
            fields: vec![field],
        };
        StreamSpec::new(
            "a",
            port,
            descriptor,
            Rational::from_millis(5),
            Rational::from_millis(10),
        )
    }

    #[test]
    fn tape_mapping_preserves_instants_of_kept_samples() {
        let streams = [stream("x"), stream("y"), stream("z")];
        let kept = [RecordedPart::NOTHING, RecordedPart::part(4, 2, 5), RecordedPart::WHOLE];
        let (mapping, specs) = TapeMapping::new(&kept, &streams);
        assert!(!mapping.is_whole());
        let names: Vec<String> = specs.iter().map(StreamSpec::name).collect();
        assert_eq!(names, ["a.y", "a.z"]);
        assert_eq!((specs[0].period, specs[0].first_index), (Rational::from_millis(40), 2));
        assert_eq!(mapping.place(0, 8), None);
        let places: Vec<_> = (0..40)
            .filter_map(|index| Some((index, mapping.place(1, index)?)))
            .collect();
        assert_eq!(places, [(8, (0, 2)), (12, (0, 3)), (16, (0, 4))]);
        assert_eq!(mapping.place(2, 7), Some((1, 7)));
        let words: Vec<Option<String>> = kept
            .iter()
            .zip(&streams)
            .map(|(kept, spec)| kept.describe(spec))
            .collect();
        assert_eq!(words[0].as_deref(), Some("nothing of `a.x`"));
        assert_eq!(words[1].as_deref(), Some("`a.y` every 40 ms from 85 ms to 165 ms"));
        assert_eq!(words[2], None);
    }
}
