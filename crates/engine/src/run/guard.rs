//! Lies that have the form of the truth: values out of their range, and outputs that do not change any more.

use lockstep::fault::Slot;
use lockstep::port::Descriptor;
use lockstep::time::{Ticks, Timebase};

/// Watches some elements of one stream.
pub struct Watch {
    name: String,
    /// The number of the stream.
    pub(super) stream: usize,
    /// The elements with their names and units.
    elements: Vec<(Slot, String, String)>,
    range: Option<(f64, f64)>,
    frozen_for: Option<Ticks>,
    /// The bytes of the elements as they were last, and since when.
    held: Option<(Vec<u8>, Ticks)>,
}

impl Watch {
    /// A guard called `name` over the elements `slots` of the payload `descriptor` of stream number `stream`: they must lie
    /// in `range` (in the field's unit), and must not be the same for `frozen_for` ticks or longer.
    pub fn new(
        name: String,
        stream: usize,
        descriptor: &Descriptor,
        slots: Vec<Slot>,
        range: Option<(f64, f64)>,
        frozen_for: Option<Ticks>,
    ) -> Watch {
        let all = descriptor.fields.iter().flat_map(|field| {
            let unit = if field.unit == "1" {
                String::new()
            } else {
                format!(" {}", field.unit)
            };
            (0..field.len()).map(move |at| (field.element_name(at), unit.clone()))
        });
        let all = Slot::all(descriptor).into_iter().zip(all);
        let elements = all.filter(|(slot, _)| slots.contains(slot));
        Watch {
            name,
            stream,
            elements: elements.map(|(slot, (name, unit))| (slot, name, unit)).collect(),
            range,
            frozen_for,
            held: None,
        }
    }

    /// What is wrong with sample number `index`, stamped `stamp`, if anything is. To be called for each sample in turn.
    pub(super) fn look(&mut self, index: u64, stamp: Ticks, payload: &[u8], timebase: Timebase) -> Option<String> {
        let (guard, t) = (&self.name, timebase.seconds(stamp));
        if let Some((low, high)) = self.range {
            for (slot, name, unit) in &self.elements {
                let value = slot.value(payload);
                if !(low..=high).contains(&value) {
                    return Some(format!(
                        "sample #{index} at t = {t} s with {name} = {value}{unit}, outside of {low} to {high}{unit} (guard `{guard}`)"
                    ));
                }
            }
        }
        let frozen_for = self.frozen_for?;
        let bytes = || self.elements.iter().flat_map(|(slot, ..)| &payload[slot.range()]);
        match &mut self.held {
            Some((held, since)) if held.iter().eq(bytes()) => {
                if stamp - *since < frozen_for {
                    return None;
                }
                let (first, more) = match &self.elements[..] {
                    [] => return None,
                    [(slot, name, unit)] => (format!("{name} = {}{unit}", slot.value(payload)), ""),
                    [(slot, name, unit), ..] => {
                        (format!("{name} = {}{unit}", slot.value(payload)), " and the rest of it")
                    }
                };
                Some(format!(
                    "sample #{index} at t = {t} s frozen: {first}{more} has not changed since t = {} s (guard `{guard}`)",
                    timebase.seconds(*since)
                ))
            }
            held => {
                *held = Some((bytes().copied().collect(), stamp));
                None
            }
        }
    }

    /// Somebody else gives this stream from now on.
    pub(super) fn renew(&mut self) {
        self.held = None;
    }
}
