//! Guards against samples that are well-formed but wrong: values out of range, and outputs that no longer change.

use lockstep::fault::Slot;
use lockstep::port::{Descriptor, Field};
use lockstep::time::{Ticks, Timebase};

/// The values that the elements must not have.
#[derive(Debug, Clone, Default)]
pub struct Forbidden {
    /// Numbers outside of this range, in the unit of the field.
    pub range: Option<(f64, f64)>,
    /// These values of a truth value or an enumeration.
    pub never: Vec<f64>,
}

/// Watches some elements of one stream.
pub struct SampleGuard {
    name: String,
    /// The number of the stream.
    pub(crate) stream: usize,
    elements: Vec<Element>,
    forbidden: Forbidden,
    frozen_for: Option<Ticks>,
    /// The latest bytes of the elements, and since when they are unchanged.
    last_value: Option<(Vec<u8>, Ticks)>,
}

/// The key of a guard, and its state.
pub(crate) type SavedGuard = (String, Option<(Vec<u8>, Ticks)>);

/// An element with its name, and the field that it is of.
struct Element {
    slot: Slot,
    name: String,
    unit: String,
    field: Field,
}

impl Element {
    /// `q[3] = 0.25 rad`, `mode = fault`
    fn describe(&self, payload: &[u8]) -> String {
        let at = (self.slot.offset - self.field.offset) as usize / self.slot.element.size();
        format!("{} = {}{}", self.name, self.field.shown(payload, at), self.unit)
    }
}

impl SampleGuard {
    /// A guard called `name` over the elements `slots` of the payload `descriptor` of stream number `stream`: they must
    /// not be what is `forbidden`, and must not be the same for `frozen_for` ticks or longer.
    pub fn new(
        name: String,
        stream: usize,
        descriptor: &Descriptor,
        slots: Vec<Slot>,
        forbidden: Forbidden,
        frozen_for: Option<Ticks>,
    ) -> SampleGuard {
        let all = descriptor.fields.iter().flat_map(|field| {
            let unit = if field.unit == "1" {
                String::new()
            } else {
                format!(" {}", field.unit)
            };
            (0..field.len()).map(move |at| (field.element_name(at), unit.clone(), field.clone()))
        });
        let all = Slot::all(descriptor).into_iter().zip(all);
        let elements = all.filter(|(slot, _)| slots.contains(slot));
        let element = |(slot, (name, unit, field))| Element {
            slot,
            name,
            unit,
            field,
        };
        SampleGuard {
            name,
            stream,
            elements: elements.map(element).collect(),
            forbidden,
            frozen_for,
            last_value: None,
        }
    }

    /// What is wrong with sample number `index`, stamped `stamp`, if anything is. To be called for each sample in order.
    pub(crate) fn check(&mut self, index: u64, stamp: Ticks, payload: &[u8], timebase: Timebase) -> Option<String> {
        let (guard, t) = (&self.name, timebase.seconds(stamp));
        if let Some((low, high)) = self.forbidden.range {
            let outside = |element: &&Element| !(low..=high).contains(&element.slot.value(payload));
            if let Some(element) = self.elements.iter().find(outside) {
                let (value, unit) = (element.describe(payload), &element.unit);
                return Some(format!(
                    "sample #{index} at t = {t} s with {value}, outside of {low} to {high}{unit} (guard `{guard}`)"
                ));
            }
        }
        let forbidden = |element: &&Element| self.forbidden.never.contains(&element.slot.value(payload));
        if let Some(element) = self.elements.iter().find(forbidden) {
            let value = element.describe(payload);
            return Some(format!(
                "sample #{index} at t = {t} s with {value}, which must never be (guard `{guard}`)"
            ));
        }
        let frozen_for = self.frozen_for?;
        let bytes = || {
            let slots = self.elements.iter().map(|element| element.slot);
            slots.flat_map(|slot| &payload[slot.range()])
        };
        match &mut self.last_value {
            Some((last_value, since)) if last_value.iter().eq(bytes()) => {
                if stamp - *since < frozen_for {
                    return None;
                }
                let (first, more) = match &self.elements[..] {
                    [] => return None,
                    [element] => (element.describe(payload), ""),
                    [element, ..] => (element.describe(payload), " and the rest of it"),
                };
                Some(format!(
                    "sample #{index} at t = {t} s frozen: {first}{more} has not changed since t = {} s (guard `{guard}`)",
                    timebase.seconds(*since)
                ))
            }
            last_value => {
                *last_value = Some((bytes().copied().collect(), stamp));
                None
            }
        }
    }

    /// Its state, for a guard of the same elements and conditions.
    pub(crate) fn saved(&self) -> SavedGuard {
        (self.key(), self.last_value.clone())
    }

    /// Restores the state that a guard of the same elements and conditions has saved; returns whether there is one.
    pub(crate) fn restore(&mut self, all: &[SavedGuard]) -> bool {
        let key = self.key();
        let saved = all.iter().find(|(saved, _)| *saved == key);
        saved
            .inspect(|(_, last_value)| self.last_value.clone_from(last_value))
            .is_some()
    }

    /// Its elements and conditions, as a key.
    fn key(&self) -> String {
        let elements: Vec<&str> = self.elements.iter().map(|element| &*element.name).collect();
        let SampleGuard {
            forbidden, frozen_for, ..
        } = self;
        format!("{} {elements:?} {forbidden:?} {frozen_for:?}", self.stream)
    }

    /// Its name for messages.
    pub(crate) fn label(&self) -> String {
        format!("guard `{}`", self.name)
    }

    /// Another program provides this stream from now on.
    pub(crate) fn reset(&mut self) {
        self.last_value = None;
    }
}
