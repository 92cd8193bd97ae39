//! Conversions prepared for execution with each sample: bytes that are only copied are merged into as few pieces as possible.

use super::{Conversion, Pair};
use crate::port::Descriptor;

/// A [`Conversion`] that is prepared for repeated execution. No element is fed by two of its pairs, unless both add.
#[derive(Debug, Clone)]
pub(crate) struct PreparedConversion {
    /// What is copied unchanged.
    copies: Vec<CopyRange>,
    /// What is computed.
    computed: Vec<Pair>,
}

/// Bytes that are contiguous in the sample and in the payload of the input.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct CopyRange {
    from: usize,
    to: usize,
    len: usize,
}

impl PreparedConversion {
    /// Prepares `conversion`.
    pub(crate) fn new(conversion: &Conversion) -> PreparedConversion {
        let (copied, computed): (Vec<&Pair>, Vec<&Pair>) =
            conversion.pairs.iter().partition(|pair| pair.copies_bytes());
        let ranges = copied.into_iter().map(CopyRange::of);
        let mut ranges: Vec<CopyRange> = ranges.collect();
        // No element is fed twice, so the order is free; the scenario orders by name, which is unrelated to memory layout.
        ranges.sort_by_key(|range| range.to);
        let mut copies: Vec<CopyRange> = Vec::new();
        for next in ranges {
            match copies.last_mut() {
                Some(last) if last.is_adjacent_to(next) => last.len += next.len,
                _ => copies.push(next),
            }
        }
        PreparedConversion {
            copies,
            computed: computed.into_iter().cloned().collect(),
        }
    }

    /// Whether samples of `message` are payloads of an input that takes `takes` and are not changed.
    pub(crate) fn is_identity(&self, message: &Descriptor, takes: &Descriptor) -> bool {
        let whole = CopyRange {
            from: 0,
            to: 0,
            len: takes.size as usize,
        };
        self.computed.is_empty() && message.size == takes.size && self.copies == [whole]
    }

    /// Whether all values are copied unchanged: nothing is computed, and no type is converted.
    pub(crate) fn only_copies(&self) -> bool {
        self.computed.is_empty()
    }

    /// Zeroes the elements of `payload` to which this and other conversions will add.
    pub(crate) fn clear(&self, payload: &mut [u8]) {
        self.computed.iter().for_each(|pair| pair.clear(payload));
    }

    /// Converts `sample` into the payload of the input.
    pub(crate) fn apply(&self, sample: &[u8], payload: &mut [u8]) {
        for &CopyRange { from, to, len } in &self.copies {
            payload[to..to + len].copy_from_slice(&sample[from..from + len]);
        }
        self.computed.iter().for_each(|pair| pair.apply(sample, payload));
    }

    /// Writes the values that replace a missing sample into the payload of the input: see [`Conversion::apply_initial`].
    pub(crate) fn apply_initial(&self, initial: &[u8], payload: &mut [u8]) {
        for &CopyRange { to, len, .. } in &self.copies {
            payload[to..to + len].copy_from_slice(&initial[to..to + len]);
        }
        self.computed
            .iter()
            .for_each(|pair| pair.apply_initial(initial, payload));
    }
}

impl CopyRange {
    /// The bytes that `pair` copies.
    fn of(pair: &Pair) -> CopyRange {
        let range = pair.range();
        CopyRange {
            from: pair.terms[0].from.offset as usize,
            to: range.start,
            len: range.len(),
        }
    }

    /// Whether `next` begins where this piece ends, at both ends.
    fn is_adjacent_to(self, next: CopyRange) -> bool {
        (self.from + self.len, self.to + self.len) == (next.from, next.to)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fault::Slot;
    use crate::link::Term;
    use crate::port::Element;
    use proptest::prelude::*;

    const ELEMENTS: u32 = 24;

    fn message() -> Descriptor {
        Descriptor {
            name: "x".into(),
            size: 8 * ELEMENTS,
            fields: Vec::new(),
        }
    }

    fn slot(number: u32, element: Element) -> Slot {
        Slot {
            offset: 8 * number,
            element,
        }
    }

    fn double(number: u32) -> Slot {
        slot(number, Element::F64)
    }

    fn pair(to: Slot, from: Slot, count: u32) -> Pair {
        Pair {
            to,
            count,
            terms: vec![Term { from, scale: 1.0 }],
            offset: 0.0,
            adds: false,
        }
    }

    fn prepared(pairs: Vec<Pair>) -> PreparedConversion {
        PreparedConversion::new(&Conversion {
            message: message(),
            pairs,
        })
    }

    #[test]
    fn prepared_conversion_merges_adjacent_copies() {
        let range = |from: usize, to: usize, len: usize| CopyRange {
            from: 8 * from,
            to: 8 * to,
            len: 8 * len,
        };
        let each = |numbers: &[u32]| numbers.iter().map(|&n| pair(double(n), double(n), 1)).collect();
        let all: Vec<u32> = (0..ELEMENTS).rev().collect();
        let whole = prepared(each(&all));
        assert_eq!(whole.copies, [range(0, 0, 24)]);
        assert!(whole.is_identity(&message(), &message()));
        assert!(!prepared(each(&all[1..])).is_identity(&message(), &message()));
        let larger = Descriptor {
            size: 8 * ELEMENTS + 8,
            ..message()
        };
        assert!(!whole.is_identity(&larger, &message()));
        assert!(!whole.is_identity(&message(), &larger));
        // Contiguous at one end only, and one that is scaled.
        let mut pairs = vec![
            pair(double(3), double(0), 2),
            pair(double(5), double(2), 1),
            pair(double(6), double(4), 1),
            pair(double(8), double(5), 1),
            pair(double(9), double(6), 1),
        ];
        pairs[4].terms[0].scale = 2.0;
        let some = prepared(pairs);
        assert_eq!(some.copies, [range(0, 3, 3), range(4, 6, 1), range(5, 8, 1)]);
        assert!(!some.only_copies());
    }

    /// Pairs for every element of an input, in any order: copies, mostly from the same position, and others.
    fn pairs() -> impl Strategy<Value = Vec<Pair>> {
        let one = (0..10_u8, 0..ELEMENTS, any::<bool>());
        let each = prop::collection::vec(one, ELEMENTS as usize);
        let pairs = each.prop_map(|each| {
            let one = |(to, (kind, from, own)): (u32, (u8, u32, bool))| {
                let mut pair = pair(double(to), double(if own || kind > 5 { to } else { from }), 1);
                match kind {
                    0 => pair.terms[0].scale = -2.5,
                    1 => pair.offset = 0.75,
                    2 => pair.adds = true,
                    3 => pair.terms[0].from.element = Element::F32,
                    4 => {
                        pair.terms.clear();
                        pair.offset = 3.0;
                    }
                    // Copied, if possible at all, by two elements of half the size.
                    5 => {
                        pair.to.element = Element::I32;
                        pair.terms[0].from.element = Element::I32;
                        pair.count = 2;
                    }
                    6 => return None,
                    _ => {}
                }
                Some(pair)
            };
            let each = (0..).zip(each).filter_map(one);
            each.collect::<Vec<Pair>>()
        });
        pairs.prop_shuffle()
    }

    proptest! {
        #[test]
        fn prepared_conversion_equals_its_pairs(
            pairs in pairs(),
            sample in prop::collection::vec(-1e6..1e6, ELEMENTS as usize),
            initial in prop::collection::vec(-1e6..1e6, ELEMENTS as usize),
        ) {
            let bytes = |values: &[f64]| values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>();
            let (sample, initial) = (bytes(&sample), bytes(&initial));
            let conversion = Conversion { message: message(), pairs };
            let prepared = PreparedConversion::new(&conversion);
            let mut payloads = [bytes(&[7.0; ELEMENTS as usize]), bytes(&[7.0; ELEMENTS as usize])];
            for use_initial in [true, false, false] {
                let [one, other] = &mut payloads;
                conversion.clear(one);
                prepared.clear(other);
                if use_initial {
                    conversion.apply_initial(&initial, one);
                    prepared.apply_initial(&initial, other);
                } else {
                    conversion.apply(&sample, one);
                    prepared.apply(&sample, other);
                }
                prop_assert_eq!(&*one, &*other);
            }
        }
    }
}
