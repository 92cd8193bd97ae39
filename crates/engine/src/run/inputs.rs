//! Values of unconnected inputs: set from code while a run is paused, held until they are set again.

use std::collections::BTreeMap;

use lockstep::plan::{Plan, Position};
use lockstep::port::{Content, Descriptor, Element, Field};
use lockstep::time::Rational;
use tape::{Event, EventKind};
use toml::{Table, Value};

use super::outcome::RunFailure;
use crate::scenario::payload;

/// The values that are held, by participant and input.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Inputs(BTreeMap<(usize, usize), Vec<u8>>);

impl Inputs {
    pub(super) fn insert(&mut self, input: (usize, usize), payload: Vec<u8>) {
        self.0.insert(input, payload);
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = (usize, usize, &[u8])> {
        self.0
            .iter()
            .map(|(&(participant, input), payload)| (participant, input, payload.as_slice()))
    }

    /// Puts the held values into the positions from which the participants continue.
    pub(super) fn put_into(&self, positions: &mut [Position]) {
        for (participant, input, payload) in self.iter() {
            positions[participant].values[input] = payload.to_owned();
        }
    }

    /// The values that `events` of a tape leave.
    pub(super) fn of_events(plan: &Plan, events: &[Event]) -> Result<Inputs, RunFailure> {
        let mut inputs = Inputs::default();
        for event in events.iter().filter(|event| event.kind == EventKind::Input) {
            let (input, payload) = read(plan, event)
                .map_err(|reason| RunFailure::Other(format!("the tape's event `{}`: {reason}", event.text)))?;
            inputs.insert(input, payload);
        }
        Ok(inputs)
    }
}

/// The input and the value that an event reports.
pub(super) fn read(plan: &Plan, event: &Event) -> Result<((usize, usize), Vec<u8>), String> {
    let table: Table = event.text.parse().map_err(|error| format!("{error}"))?;
    let (name, value) = table.iter().next().ok_or("it names no input")?;
    let port = format!("{}.{name}", event.participant.as_deref().unwrap_or_default());
    let input = find(plan, &port).map_err(|failure| failure.to_string())?;
    let descriptor = &plan.participants[input.0].interface.inputs[input.1].descriptor;
    Ok((input, payload(value, descriptor)?))
}

/// The tape's event for a value of an input.
pub(super) fn event(plan: &Plan, time: Rational, (participant, input): (usize, usize), payload: &[u8]) -> Event {
    let planned = &plan.participants[participant];
    let port = &planned.interface.inputs[input];
    Event {
        time,
        kind: EventKind::Input,
        participant: Some(planned.name.clone()),
        text: format!("{} = {}", port.name, Value::Table(fields(&port.descriptor, payload))),
    }
}

/// The fields of `payload`, written so that they can be read back to the last bit.
fn fields(descriptor: &Descriptor, payload: &[u8]) -> Table {
    let fields = descriptor.fields.iter().map(|field| {
        let bytes = payload[field.range()].chunks_exact(field.element.size());
        let values = bytes
            .enumerate()
            .map(|(at, bytes)| value(field, field.value(payload, at), bytes));
        let mut values: Vec<Value> = values.collect();
        let value = match (field.shape.is_empty(), values.pop()) {
            (true, Some(value)) => value,
            (_, last) => {
                values.extend(last);
                Value::Array(values)
            }
        };
        (field.name.clone(), value)
    });
    fields.collect()
}

/// One element: as a name where it has one, as text where the number exceeds TOML's range.
fn value(field: &Field, number: f64, bytes: &[u8]) -> Value {
    match field.element.content(bytes) {
        Ok(Content::Text(text)) => return Value::String(text.to_owned()),
        Ok(Content::Bytes(bytes)) => return Value::String(crate::scenario::hexadecimal(bytes)),
        Err(_) => {}
    }
    match (field.element, field.name_of(number)) {
        (Element::F64 | Element::F32, _) => Value::Float(number),
        (Element::Bool, _) => Value::Boolean(number != 0.0),
        (_, Some(name)) => Value::String(name.to_owned()),
        (element, None) => {
            let whole = element.to_integer(bytes);
            i64::try_from(whole).map_or_else(|_| Value::String(whole.to_string()), Value::Integer)
        }
    }
}

/// The number of the participant and of its unconnected input called `PARTICIPANT.INPUT`.
///
/// # Errors
/// When there is no such input, or when it is connected; the message then names the output that feeds it.
pub(super) fn find(plan: &Plan, port: &str) -> Result<(usize, usize), RunFailure> {
    let refuse = |reason: String| RunFailure::Port {
        port: port.to_owned(),
        reason,
    };
    let (participant, name) = port
        .split_once('.')
        .ok_or_else(|| refuse("is not a port: write \"PARTICIPANT.INPUT\"".into()))?;
    let number = plan
        .participant(participant)
        .ok_or_else(|| refuse(format!("there is no participant `{participant}`")))?;
    let planned = &plan.participants[number];
    let inputs = &planned.interface.inputs;
    let input = inputs.iter().position(|input| input.name == name).ok_or_else(|| {
        let known: Vec<String> = inputs.iter().map(|input| format!("`{}`", input.name)).collect();
        let known = if known.is_empty() {
            "none".to_owned()
        } else {
            known.join(", ")
        };
        refuse(format!("`{participant}` has no input `{name}`; it has {known}"))
    })?;
    match planned.inputs[input].first() {
        None => Ok((number, input)),
        Some(&link) => {
            let link = &plan.links[link];
            Err(refuse(format!(
                "cannot be set: `{}` feeds it, by the connection `{}`; leave that out of the scenario, and name the input in `inputs`",
                plan.output_name(link.from),
                link.name
            )))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lockstep::port::{Bytes, Text};

    lockstep::enumeration! {
        /// Named values.
        pub enum Mode {
            /// Nothing.
            Off = 0,
            /// Something.
            On = 9,
        }
    }

    lockstep::message! {
        /// One of each.
        pub struct All {
            /// Doubles.
            pub doubles: [[f64; 2]; 2] = "m",
            /// Large.
            pub large: u64 = "1",
            /// Below zero.
            pub below: i64 = "1",
            /// Single.
            pub single: f32 = "1",
            /// Short.
            pub short: i32 = "1",
            /// Shorter.
            pub shorter: [i16; 2] = "1",
            /// Above zero.
            pub above: u16 = "1",
            /// Shortest.
            pub shortest: i8 = "1",
            /// Named.
            pub mode: Mode = "1",
            /// True or false.
            pub truths: [bool; 8] = "1",
            /// Said.
            pub said: [Text<8>; 2] = "1",
            /// Sent.
            pub sent: Bytes<4> = "1",
        }
    }

    #[test]
    fn value_in_an_event_is_read_back_to_the_last_bit() {
        use lockstep::participant::Payload;
        use lockstep::port::Message;
        let value = All {
            doubles: [[-0.0, 1.0 / 3.0], [1e-308, 6.02e23]],
            large: u64::MAX,
            below: i64::MIN,
            single: 0.1,
            short: -7,
            shorter: [i16::MIN, 300],
            above: u16::MAX,
            shortest: -1,
            mode: Mode::On,
            truths: [true, false, true, true, false, false, true, false],
            said: [Text::new("a \"b\"\n").unwrap(), Text::default()],
            sent: Bytes::new(&[0, 255, 16]).unwrap(),
        };
        let payload = Payload::of(&value);
        let text = format!("x = {}", Value::Table(fields(&All::descriptor(), payload.bytes())));
        let table: Table = text.parse().unwrap();
        let back = super::payload(&table["x"], &All::descriptor()).unwrap();
        assert_eq!(back, payload.bytes(), "{text}");
    }
}
