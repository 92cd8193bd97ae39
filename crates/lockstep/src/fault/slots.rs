//! The elements of a payload that a fault affects.

use serde::{Deserialize, Serialize};

use crate::port::{Descriptor, Element, Field};

/// The most elements that are addressed individually.
const ELEMENTS_MAX: usize = 1 << 20;

/// One element of a payload.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Slot {
    /// Its offset, bytes.
    pub offset: u32,
    /// Its type.
    pub element: Element,
}

impl Slot {
    /// Every element of a payload.
    pub fn all(descriptor: &Descriptor) -> Vec<Slot> {
        descriptor.fields.iter().flat_map(Slot::of).collect()
    }

    /// The elements of a field.
    fn of(field: &Field) -> impl Iterator<Item = Slot> {
        (0..field.len()).map(|index| Slot::element_of(field, index))
    }

    /// Element `index` of a field, row-major.
    pub fn element_of(field: &Field, index: usize) -> Slot {
        Slot {
            offset: field.offset + (index * field.element.size()) as u32,
            element: field.element,
        }
    }

    /// The elements that `name` refers to: a field (`q`) or one of its elements (`q[3]`, `R[0][2]`), with the field that contains
    /// them. `None` when the payload has nothing of that name.
    pub fn resolve<'a>(descriptor: &'a Descriptor, name: &str) -> Option<(&'a Field, Vec<Slot>)> {
        let (field, elements) = descriptor.resolve(name)?;
        let slots = elements.map(|index| Slot::element_of(field, index)).collect();
        Some((field, slots))
    }

    /// Why the elements that `name` refers to, or all of them, cannot be addressed individually, if there are too many.
    pub fn too_many(descriptor: &Descriptor, name: Option<&str>) -> Option<String> {
        let count = match name {
            Some(name) => descriptor.resolve(name)?.1.len(),
            None => descriptor.fields.iter().map(Field::len).sum(),
        };
        (count > ELEMENTS_MAX).then(|| {
            let first = descriptor.fields.first().map(|field| field.element_name(0)).unwrap_or_default();
            format!(
                "`{}` has {count} elements, and at most {ELEMENTS_MAX} are looked at one by one: name a field or an element of it, such as \
                 `{first}`",
                name.unwrap_or(&descriptor.name)
            )
        })
    }

    /// The range of the element's bytes in a payload.
    pub fn range(self) -> std::ops::Range<usize> {
        let start = self.offset as usize;
        start..start + self.element.size()
    }

    /// The element of a payload as a double.
    pub fn value(self, payload: &[u8]) -> f64 {
        self.element.to_f64(&payload[self.range()])
    }

    /// The element `number` places after this one.
    pub(crate) fn offset_by(self, number: u32) -> Slot {
        let offset = self.offset + number * self.element.size() as u32;
        Slot { offset, ..self }
    }

    /// Whether this element and those after it, `count` in all, are contiguous in one field of a payload of `descriptor`.
    pub(crate) fn fits_run(self, count: usize, descriptor: &Descriptor) -> bool {
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
        self.fits_run(1, descriptor)
    }
}
