//! Transfer of values between variables and payloads.

use std::ops::Range;

use lockstep::participant::{Inputs, Outputs};
use lockstep::port::{Descriptor, Element};

use crate::abi::{Native, Values};
use crate::items::Items;

/// The position of the values of one variable in a payload.
#[derive(Debug, Clone)]
pub(crate) struct Slot {
    /// The port's number.
    pub(crate) port: usize,
    /// The offset of the first element, bytes.
    pub(crate) offset: usize,
    pub(crate) element: Element,
    /// The index of the first value among those of its function, and the number of values.
    pub(crate) first: usize,
    pub(crate) len: usize,
    pub(crate) conversion: Option<(f64, f64)>,
    pub(crate) items: Items,
    pub(crate) name: String,
}

/// Values that have the same representation and are contiguous in the payload and in the FMU's values. All numbers are
/// bytes.
#[derive(Debug, Clone, PartialEq)]
struct ContiguousRange {
    port: usize,
    /// The offset in the payload.
    offset: usize,
    /// The offset in the values.
    first: usize,
    len: usize,
}

/// The variables of one function of the library.
#[derive(Debug, Clone)]
pub struct Transfer {
    /// The values.
    pub values: Values,
    /// The variables, one by one; after [merging](Transfer::merge_contiguous), only those that are converted.
    pub(crate) slots: Vec<Slot>,
    ranges: Vec<ContiguousRange>,
}

impl Transfer {
    /// Creates a transfer without variables.
    pub(crate) fn new(native: Native) -> Transfer {
        Transfer {
            values: Values::new(native, Vec::new(), 0),
            slots: Vec::new(),
            ranges: Vec::new(),
        }
    }

    /// Merges variables that are copied unchanged: neighbours in the payload are mostly neighbours among the values.
    pub(crate) fn merge_contiguous(&mut self) {
        let native = self.values.native;
        let (copied, converted) = std::mem::take(&mut self.slots)
            .into_iter()
            .partition::<Vec<_>, _>(|slot| slot.is_copied(native));
        self.slots = converted;
        for slot in copied {
            let size = native.size();
            let next = ContiguousRange {
                port: slot.port,
                offset: slot.offset,
                first: slot.first * size,
                len: slot.len * size,
            };
            match self.ranges.last_mut() {
                Some(last) if last.is_before(&next) => last.len += next.len,
                _ => self.ranges.push(next),
            }
        }
    }

    /// Copies the payloads of the inputs into the values.
    pub(crate) fn read(&mut self, inputs: &Inputs) -> Result<(), String> {
        let values = self.values.as_bytes_mut();
        for range in &self.ranges {
            let payload = inputs.bytes(range.port);
            values[range.of_values()].copy_from_slice(&payload[range.of_payload()]);
        }
        let mut slots = self.slots.iter();
        slots.try_for_each(|slot| slot.read(inputs.bytes(slot.port), &mut self.values))
    }

    /// Copies the values into the payloads of the outputs.
    pub(crate) fn write(&self, outputs: &mut Outputs) -> Result<(), String> {
        let values = self.values.as_bytes();
        for range in &self.ranges {
            let payload = outputs.bytes_mut(range.port);
            payload[range.of_payload()].copy_from_slice(&values[range.of_values()]);
        }
        let mut slots = self.slots.iter();
        slots.try_for_each(|slot| slot.write(&self.values, outputs.bytes_mut(slot.port)))
    }
}

impl ContiguousRange {
    fn of_payload(&self) -> Range<usize> {
        self.offset..self.offset + self.len
    }

    fn of_values(&self) -> Range<usize> {
        self.first..self.first + self.len
    }

    /// Whether `next` continues this range, in the payload and in the values.
    fn is_before(&self, next: &ContiguousRange) -> bool {
        (self.port, self.offset + self.len, self.first + self.len) == (next.port, next.offset, next.first)
    }
}

impl Slot {
    /// Whether payload and values have the same bytes.
    fn is_copied(&self, native: Native) -> bool {
        self.conversion.is_none() && self.element.is_number() && native.element() == Some(self.element)
    }

    /// Copies the variable's part of a payload into the values.
    fn read(&self, payload: &[u8], values: &mut Values) -> Result<(), String> {
        let size = self.element.size();
        for index in 0..self.len {
            let at = self.offset + index * size;
            let own = &payload[at..at + size];
            if self.element.room().is_some() {
                let content = self.element.content(own);
                let content = content.map_err(|reason| format!("the input `{}`: {reason}", self.name))?;
                values.put_content(self.first + index, content.as_bytes());
                continue;
            }
            let mut bytes = [0; 8];
            match (values.native, self.conversion) {
                (Native::F64, Some((factor, shift))) => {
                    let value = f64::from_le_bytes(own.try_into().unwrap_or_default());
                    bytes = ((value - shift) / factor).to_ne_bytes();
                }
                (Native::F32, Some((factor, shift))) => {
                    let value = f64::from(f32::from_le_bytes(own.try_into().unwrap_or_default()));
                    bytes[..4].copy_from_slice(&(((value - shift) / factor) as f32).to_ne_bytes());
                }
                // These bytes were validated when they arrived; a truth value of FMI 2.0 has four.
                _ if self.element == Element::Enum => {
                    let value = self.items.own(own[0]).ok_or_else(|| {
                        let name = &self.name;
                        format!("the input `{name}` is {}, which is no item: say `initial`", own[0])
                    })?;
                    bytes = value.to_le_bytes();
                }
                (native, _) => match native.element() {
                    Some(natural) if natural != self.element => bytes = self.whole(self.element, own, natural)?,
                    _ => bytes[..size].copy_from_slice(own),
                },
            }
            values.put(self.first + index, &bytes);
        }
        Ok(())
    }

    /// Copies the values into their part of a payload.
    fn write(&self, values: &Values, payload: &mut [u8]) -> Result<(), String> {
        let size = self.element.size();
        for index in 0..self.len {
            if self.element.room().is_some() {
                let at = self.offset + index * size;
                if let (Some(length), Some(room)) = (values.excess(self.first + index), self.element.room()) {
                    return Err(self.too_long_text(length, room));
                }
                self.write_content(values.content(self.first + index), &mut payload[at..at + size])?;
                continue;
            }
            let bytes = values.bytes(self.first + index);
            let at = self.offset + index * size;
            let own = &mut payload[at..at + size];
            let four = [bytes[0], bytes[1], bytes[2], bytes[3]];
            match (values.native, self.conversion) {
                (Native::F64, Some((factor, shift))) => {
                    own.copy_from_slice(&(f64::from_ne_bytes(bytes) * factor + shift).to_le_bytes());
                }
                (Native::F32, Some((factor, shift))) => {
                    let value = f64::from(f32::from_ne_bytes(four)) * factor + shift;
                    own.copy_from_slice(&(value as f32).to_le_bytes());
                }
                (native, _) if self.element == Element::Enum => {
                    let value = match native {
                        Native::I32 => i64::from(i32::from_ne_bytes(four)),
                        _ => i64::from_ne_bytes(bytes),
                    };
                    own[0] = self.items.byte(value).ok_or_else(|| {
                        let name = &self.name;
                        format!("its output `{name}` is {value}, which is no item of its enumeration")
                    })?;
                }
                // Any value but false is true.
                (Native::Bool32, _) => own[0] = u8::from(i32::from_ne_bytes(four) != 0),
                (Native::Bool8, _) => own[0] = u8::from(bytes[0] != 0),
                (native, _) => {
                    let natural = native.element().unwrap_or(self.element);
                    let bytes = self.whole(natural, &bytes, self.element)?;
                    own.copy_from_slice(&bytes[..size]);
                }
            }
        }
        Ok(())
    }

    /// Converts an integer of the type `from` to the type `to`.
    fn whole(&self, from: Element, bytes: &[u8], to: Element) -> Result<[u8; 8], String> {
        let value = from.to_integer(bytes);
        if to.range().is_some_and(|(least, most)| (least..=most).contains(&value)) {
            return Ok((value as i64).to_le_bytes());
        }
        Err(format!("`{}` is {value}, which is no {}", self.name, to.name()))
    }

    /// A text or bytes from the FMU: never truncated, but rejected if too long.
    fn write_content(&self, content: &[u8], own: &mut [u8]) -> Result<(), String> {
        let name = &self.name;
        if let (Element::Text(_), Err(error)) = (self.element, std::str::from_utf8(content)) {
            return Err(format!(
                "its output `{name}` is not UTF-8 from byte {} on",
                error.valid_up_to()
            ));
        }
        let put = self.element.put_content(content, own);
        put.map_err(|error| self.too_long_text(error.length, error.room))
    }

    /// Why a text or bytes of this length cannot be an output.
    fn too_long_text(&self, length: usize, room: usize) -> String {
        let name = &self.name;
        let most = Descriptor::MAX_SIZE as usize;
        let remedy = match length <= most {
            true => format!("give it more, as {{ variable = \"{name}\", size = {length} }} in `ports` or `record`"),
            false => format!("a port has {most} at most, so the FMU has to give fewer"),
        };
        format!("its output `{name}` has {length} bytes, and its field room for {room}: {remedy}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stated_size_beyond_the_room_is_refused_and_not_read() {
        let slot = Slot {
            port: 0,
            offset: 0,
            element: Element::Bytes(8),
            first: 0,
            len: 1,
            conversion: None,
            items: Items::default(),
            name: "image".into(),
        };
        let mut values = Values::new(Native::Binary, vec![7], 1);
        values.make_room(8);
        let bytes = *b"12345678";
        let mut write = |size: usize| {
            let mut given = values.no_pointers();
            (given.pointers[0], given.sizes[0]) = (bytes.as_ptr(), size);
            // SAFETY: there are 8 bytes at the pointer, and the limit is 8.
            unsafe { values.take(&given) };
            slot.write(&values, &mut [0; 12])
        };
        assert_eq!(write(8), Ok(()));
        let error = write(9).unwrap_err();
        assert!(
            error.contains("`image` has 9 bytes") && error.contains("size = 9"),
            "{error}"
        );
        let error = write(1 << 50).unwrap_err();
        assert!(
            error.contains("`image` has 1125899906842624 bytes, and its field room for 8"),
            "{error}"
        );
        assert!(error.contains("the FMU has to give fewer"), "{error}");
        assert_eq!(write(3), Ok(()));
    }
}
