//! Conversions: how the samples of a link become fields of an input with a different message.

use serde::{Deserialize, Serialize};

use crate::fault::Slot;
use crate::port::Descriptor;

/// How the samples of a link become elements of an input. An input with several such links is assembled from all of them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Conversion {
    /// The message of the link.
    pub message: Descriptor,
    /// The elements that are written.
    pub pairs: Vec<Pair>,
}

/// Consecutive elements of an input and what they are computed from: the sum of the terms, and the offset.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Pair {
    /// The first of them.
    pub to: Slot,
    /// How many there are.
    pub count: u32,
    /// The terms of the sum; none for constants.
    pub terms: Vec<Term>,
    /// The constant that is added, in the unit of the elements.
    pub offset: f64,
    /// Whether this is added to the results of other pairs, all of which have this flag set. Such a sum starts at zero.
    pub adds: bool,
}

/// Consecutive elements of a sample, and the factor that they are multiplied by.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Term {
    /// The first of them.
    pub from: Slot,
    /// The factor, which includes the conversion of units.
    pub scale: f64,
}

impl Conversion {
    /// Why an input that takes `takes` is too large to be assembled from fields, if it is.
    pub fn too_large(takes: &Descriptor) -> Option<String> {
        let (size, most) = (takes.size, Descriptor::PARTS_MAX);
        (size > most).then(|| {
            format!(
                "an input of {size} bytes (`{}`) is not put together from fields, only one of at most {most}: connect it with an output \
                 of the same description",
                takes.name
            )
        })
    }

    /// Checks that this conversion turns samples of its message into elements of `takes`.
    ///
    /// # Errors
    /// What is wrong.
    pub(crate) fn check(&self, takes: &Descriptor) -> Result<(), String> {
        if let Some(reason) = Conversion::too_large(takes) {
            return Err(reason);
        }
        for pair in &self.pairs {
            let count = pair.count as usize;
            if count == 0 || !pair.to.fits_run(count, takes) {
                return Err(format!("`{}` has no such elements", takes.name));
            }
            if !pair.terms.iter().all(|term| term.from.fits_run(count, &self.message)) {
                return Err(format!("`{}` has no such elements", self.message.name));
            }
            let scales = pair.terms.iter().map(|term| term.scale);
            if let Some(number) = scales.chain([pair.offset]).find(|number| !number.is_finite()) {
                return Err(format!("{number} is not finite"));
            }
            let to = pair.to.element;
            if let Some(term) = pair.terms.iter().find(|term| !to.holds(term.from.element)) {
                let from = term.from.element;
                return Err(format!("{to} does not hold every value of {from}"));
            }
            if !pair.terms.is_empty() && !pair.copies() && !to.is_float() {
                return Err(format!("arithmetic needs f64 or f32 where the elements are {to}"));
            }
            if pair.terms.is_empty() && pair.offset != 0.0 && to.room().is_some() {
                return Err(format!("no number is a constant where the elements are {to}"));
            }
        }
        Ok(())
    }

    /// Zeroes the elements of `payload` to which this and other conversions will add.
    pub(crate) fn clear(&self, payload: &mut [u8]) {
        self.pairs.iter().for_each(|pair| pair.clear(payload));
    }

    /// Converts `sample` into the payload of the input.
    pub(crate) fn apply(&self, sample: &[u8], payload: &mut [u8]) {
        self.pairs.iter().for_each(|pair| pair.apply(sample, payload));
    }

    /// Writes the values that replace a missing sample into the payload of the input: the elements of `initial`, which is such a payload,
    /// and constants, which always hold.
    pub(crate) fn apply_initial(&self, initial: &[u8], payload: &mut [u8]) {
        self.pairs.iter().for_each(|pair| pair.apply_initial(initial, payload));
    }
}

impl Pair {
    /// The bytes of its elements.
    pub(crate) fn range(&self) -> std::ops::Range<usize> {
        let start = self.to.offset as usize;
        start..start + self.count as usize * self.to.element.size()
    }

    /// Whether values are copied unchanged.
    pub fn copies(&self) -> bool {
        let [term] = self.terms[..] else { return false };
        term.scale == 1.0 && self.offset == 0.0 && !self.adds
    }

    /// Whether the result is the sample's own bytes.
    pub(super) fn copies_bytes(&self) -> bool {
        self.copies() && self.terms[0].from.element == self.to.element
    }

    fn elements(&self) -> impl Iterator<Item = Slot> {
        let to = self.to;
        (0..self.count).map(move |number| to.offset_by(number))
    }

    /// Zeroes the elements to which this and other pairs will add.
    pub(super) fn clear(&self, payload: &mut [u8]) {
        if self.adds {
            payload[self.range()].fill(0);
        }
    }

    /// Writes the values that replace a missing sample into its elements.
    pub(super) fn apply_initial(&self, initial: &[u8], payload: &mut [u8]) {
        if self.terms.is_empty() {
            self.apply(&[], payload);
        } else if self.adds {
            for to in self.elements() {
                let value = to.value(payload) + to.value(initial);
                to.element.put(value, to.bytes(payload));
            }
        } else {
            payload[self.range()].copy_from_slice(&initial[self.range()]);
        }
    }

    /// Converts `sample` into its elements.
    pub(super) fn apply(&self, sample: &[u8], payload: &mut [u8]) {
        if self.copies() {
            return self.copy(self.terms[0].from, sample, payload);
        }
        for number in 0..self.count {
            let mut parts = self.terms.iter();
            let part = |term: &Term| term.from.offset_by(number).value(sample) * term.scale;
            let mut value = match parts.next() {
                Some(first) => parts.fold(part(first), |sum, term| sum + part(term)),
                None => self.offset,
            };
            if self.offset != 0.0 && !self.terms.is_empty() {
                value += self.offset;
            }
            let to = self.to.offset_by(number);
            if self.adds {
                value += to.value(payload);
            }
            to.element.put(value, to.bytes(payload));
        }
    }

    /// Copies values unchanged, into elements that hold them.
    fn copy(&self, from: Slot, sample: &[u8], payload: &mut [u8]) {
        if from.element == self.to.element {
            let start = from.offset as usize;
            let range = self.range();
            let bytes = &sample[start..start + range.len()];
            return payload[range].copy_from_slice(bytes);
        }
        for number in 0..self.count {
            let (from, to) = (from.offset_by(number), self.to.offset_by(number));
            let bytes = to.bytes(payload);
            if to.element.room().is_some() {
                // The larger element is padded behind the same bytes.
                bytes.fill(0);
                bytes[..from.element.size()].copy_from_slice(&sample[from.range()]);
            } else if to.element.is_float() {
                to.element.put(from.value(sample), bytes);
            } else {
                let whole = from.element.to_integer(&sample[from.range()]).to_le_bytes();
                bytes.copy_from_slice(&whole[..to.element.size()]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::port::Element;

    fn slot(offset: u32, element: Element) -> Slot {
        Slot { offset, element }
    }

    /// The result of converting one value.
    fn converted(from: Element, value: &[u8], to: Element, scale: f64, offset: f64) -> Vec<u8> {
        let pair = Pair {
            to: slot(0, to),
            count: 1,
            terms: vec![Term {
                from: slot(0, from),
                scale,
            }],
            offset,
            adds: false,
        };
        let mut payload = vec![0x55; to.size()];
        pair.apply(value, &mut payload);
        payload
    }

    #[test]
    fn element_holds_type_iff_all_values_round_trip() {
        let all = [
            (
                Element::F64,
                vec![1.5e300_f64.to_le_bytes().to_vec(), 0.1_f64.to_le_bytes().to_vec()],
            ),
            (
                Element::F32,
                vec![f32::MAX.to_le_bytes().to_vec(), 0.1_f32.to_le_bytes().to_vec()],
            ),
            (
                Element::I64,
                vec![i64::MIN.to_le_bytes().to_vec(), (i64::MAX - 1).to_le_bytes().to_vec()],
            ),
            (
                Element::I32,
                vec![i32::MIN.to_le_bytes().to_vec(), (i32::MAX - 1).to_le_bytes().to_vec()],
            ),
            (Element::U64, vec![(u64::MAX - 1).to_le_bytes().to_vec()]),
            (Element::U32, vec![(u32::MAX - 1).to_le_bytes().to_vec()]),
            (Element::U8, vec![vec![255], vec![7]]),
            (
                Element::I16,
                vec![i16::MIN.to_le_bytes().to_vec(), 77_i16.to_le_bytes().to_vec()],
            ),
            (
                Element::U16,
                vec![u16::MAX.to_le_bytes().to_vec(), 300_u16.to_le_bytes().to_vec()],
            ),
            (Element::I8, vec![vec![0x80], vec![0x7f]]),
            // As bytes: that no number fits into one of these is decided by type.
            (Element::Bool, vec![vec![0], vec![1]]),
            (Element::Enum, vec![vec![0], vec![255]]),
        ];
        for (from, values) in &all {
            for (to, _) in &all {
                let kept =
                    values.iter().all(|value| is_same_number(*from, value, *to)) && (to.is_number() || from == to);
                assert_eq!(to.holds(*from), kept, "{from:?} in {to:?}");
            }
        }
    }

    /// Whether the converted value is the same number.
    fn is_same_number(from: Element, value: &[u8], to: Element) -> bool {
        let new = converted(from, value, to, 1.0, 0.0);
        match (from.is_float(), to.is_float()) {
            (true, true) => from.to_f64(value).to_bits() == to.to_f64(&new).to_bits(),
            // Every value of these types is an integer, so a double that is only near it differs.
            (false, true) => from.to_integer(value) == to.to_f64(&new) as i128,
            (false, false) => from.to_integer(value) == to.to_integer(&new),
            // None of them holds a number that is not an integer.
            (true, false) => false,
        }
    }

    #[test]
    fn conversion_scales_then_offsets_or_copies_value() {
        let value = 0.1_f64.to_le_bytes();
        let of = |scale, offset| {
            let bytes = converted(Element::F64, &value, Element::F64, scale, offset);
            Element::F64.to_f64(&bytes)
        };
        assert_eq!(of(1.0, 0.0).to_bits(), 0.1_f64.to_bits());
        assert_eq!(of(-3.0, 0.0).to_bits(), (0.1_f64 * -3.0).to_bits());
        assert_eq!(of(-3.0, 0.7).to_bits(), (0.1_f64 * -3.0 + 0.7).to_bits());
        let nan = f64::NAN.to_le_bytes();
        assert_eq!(converted(Element::F64, &nan, Element::F64, 1.0, 0.0), nan);
    }

    #[test]
    fn sum_conversion_restarts_from_zero() {
        let add = |scale, offset| Conversion {
            message: Descriptor {
                name: "x".into(),
                size: 16,
                fields: Vec::new(),
            },
            pairs: vec![Pair {
                to: slot(8, Element::F64),
                count: 1,
                terms: vec![
                    Term {
                        from: slot(0, Element::F64),
                        scale,
                    },
                    Term {
                        from: slot(8, Element::F64),
                        scale: 1.0,
                    },
                ],
                offset,
                adds: true,
            }],
        };
        let (one, two) = (add(2.0, 0.5), add(-1.0, 0.0));
        let sample: Vec<u8> = [3.0_f64, 10.0].iter().flat_map(|x| x.to_le_bytes()).collect();
        let initial: Vec<u8> = [0.0_f64, 100.0].iter().flat_map(|x| x.to_le_bytes()).collect();
        let mut payload = vec![0; 16];
        for _ in 0..2 {
            one.clear(&mut payload);
            two.clear(&mut payload);
            one.apply(&sample, &mut payload);
            two.apply(&sample, &mut payload);
            assert_eq!(Element::F64.to_f64(&payload[8..]), 16.5 + 7.0);
        }
        one.clear(&mut payload);
        one.apply(&sample, &mut payload);
        two.apply_initial(&initial, &mut payload);
        assert_eq!(Element::F64.to_f64(&payload[8..]), 16.5 + 100.0);
    }
}
