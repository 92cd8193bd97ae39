//! The elements of a payload that a fault concerns.

use serde::{Deserialize, Serialize};

use crate::port::{Descriptor, Element, Field};

/// One element of a payload.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Slot {
    /// Where it starts, bytes.
    pub offset: u32,
    /// What it is.
    pub element: Element,
}

impl Slot {
    /// Every element of a payload.
    pub fn all(descriptor: &Descriptor) -> Vec<Slot> {
        descriptor.fields.iter().flat_map(Slot::of).collect()
    }

    /// The elements of a field.
    fn of(field: &Field) -> Vec<Slot> {
        let slot = |index: usize| Slot {
            offset: field.offset + (index * field.element.size()) as u32,
            element: field.element,
        };
        (0..field.len()).map(slot).collect()
    }

    /// The elements that `name` names: a field (`q_m`) or one of its elements (`q_m[3]`, `R[0][2]`), with the field they
    /// are of. `None` when the payload has nothing of that name.
    pub fn named<'a>(descriptor: &'a Descriptor, name: &str) -> Option<(&'a Field, Vec<Slot>)> {
        let (field, elements) = descriptor.named(name)?;
        Some((field, Slot::of(field)[elements].to_vec()))
    }

    /// Where the bytes of the element are in a payload.
    pub fn range(self) -> std::ops::Range<usize> {
        let start = self.offset as usize;
        start..start + self.element.size()
    }

    /// The element of a payload as a double.
    pub fn value(self, payload: &[u8]) -> f64 {
        self.element.to_f64(&payload[self.range()])
    }

    /// The element that stands `number` places behind this one.
    pub(crate) fn after(self, number: u32) -> Slot {
        let offset = self.offset + number * self.element.size() as u32;
        Slot { offset, ..self }
    }

    /// Whether this element and those behind it, `count` in all, are neighbours in one field of a payload of `descriptor`.
    pub(crate) fn run_fits(self, count: usize, descriptor: &Descriptor) -> bool {
        let size = self.element.size();
        let start = self.offset as usize;
        descriptor.fields.iter().any(|field| {
            let range = field.range();
            let end = count.checked_mul(size).and_then(|bytes| bytes.checked_add(start));
            field.element == self.element
                && range.contains(&start)
                && (start - range.start).is_multiple_of(size)
                && end.is_some_and(|end| end <= range.end)
        })
    }

    /// The bytes of the element.
    pub(crate) fn bytes(self, payload: &mut [u8]) -> &mut [u8] {
        &mut payload[self.range()]
    }

    /// True when the element lies inside a payload of `descriptor`.
    pub(crate) fn fits(self, descriptor: &Descriptor) -> bool {
        Slot::all(descriptor).contains(&self)
    }
}
