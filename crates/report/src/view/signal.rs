//! Signals: fields of streams, addressed by name.

use lockstep::port::Field;
use tape::StreamSpec;

/// A field of a stream, or some of its elements.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Signal {
    /// The participant; `None` for the first one with such a port and field.
    pub participant: Option<String>,
    /// The output, or `seen.INPUT` for the samples received at an input with a fault.
    pub port: String,
    /// The names the field may have: the first that a stream has is used. A name may end in an element, as `q[2]`.
    pub names: Vec<String>,
    /// Only the elements `from..to`.
    pub part: Option<(usize, usize)>,
}

/// A field with the selected elements.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Slice {
    pub(crate) field: Field,
    pub(crate) from: usize,
    pub(crate) len: usize,
}

impl Slice {
    pub(crate) fn value(&self, payload: &[u8], index: usize) -> f64 {
        self.field.value(payload, self.from + index)
    }

    pub(crate) fn four(&self, payload: &[u8]) -> [f64; 4] {
        std::array::from_fn(|i| self.value(payload, i))
    }
}

impl Signal {
    /// The first of these fields at the port of that name, of any participant.
    pub fn at(port: &str, names: &[&str]) -> Signal {
        Signal {
            participant: None,
            port: port.to_owned(),
            names: names.iter().map(|name| (*name).to_owned()).collect(),
            part: None,
        }
    }

    /// Only the elements `from..to`.
    #[must_use]
    pub fn part(mut self, from: usize, to: usize) -> Signal {
        self.part = Some((from, to));
        self
    }

    /// Parses `PARTICIPANT.OUTPUT.FIELD` or `PARTICIPANT.OUTPUT.FIELD[ELEMENT]`; samples received at an input are
    /// `PARTICIPANT.seen.INPUT.FIELD`.
    pub fn named(text: &str) -> Option<Signal> {
        let (participant, rest) = text.split_once('.')?;
        let seen = rest.strip_prefix("seen.").map_or(0, |_| "seen.".len());
        let cut = seen + rest[seen..].find('.')?;
        let (port, field) = (&rest[..cut], &rest[cut + 1..]);
        let parts = [participant, &port[seen..], field];
        parts.iter().all(|part| !part.is_empty()).then(|| Signal {
            participant: Some(participant.to_owned()),
            port: port.to_owned(),
            names: vec![field.to_owned()],
            part: None,
        })
    }

    /// Whether this is a stream of the signal's port.
    pub(crate) fn is_stream_of_port(&self, spec: &StreamSpec) -> bool {
        let mine = |name: &String| *name == spec.participant;
        spec.port == self.port && self.participant.as_ref().is_none_or(mine)
    }

    /// The stream's own field under one of the names.
    pub(crate) fn slice(&self, spec: &StreamSpec) -> Option<Slice> {
        self.names.iter().find_map(|name| slice(spec, name, self.part))
    }

    /// The first stream that has the signal, and the position in it.
    pub(crate) fn find(&self, streams: &[StreamSpec]) -> Option<(usize, Slice)> {
        let mut all = streams
            .iter()
            .enumerate()
            .filter(|(_, spec)| self.is_stream_of_port(spec));
        all.find_map(|(at, spec)| Some((at, self.slice(spec)?)))
    }

    /// The available alternatives to a signal that no stream has.
    pub(crate) fn alternatives_text(&self, streams: &[StreamSpec]) -> String {
        let listed = |names: Vec<String>| {
            let mut names: Vec<String> = names.into_iter().map(|name| format!("`{name}`")).collect();
            names.dedup();
            if names.is_empty() {
                "none".to_owned()
            } else {
                names.join(", ")
            }
        };
        let who = self.participant.as_deref().unwrap_or("any participant");
        let field = self.names.join(", ");
        if !streams.iter().any(|spec| spec.participant == who) {
            let known = streams.iter().map(|spec| spec.participant.clone()).collect();
            return format!(
                "there is no participant `{who}` with outputs; there is {}",
                listed(known)
            );
        }
        let Some(spec) = streams.iter().find(|spec| self.is_stream_of_port(spec)) else {
            let own = streams.iter().filter(|spec| spec.participant == who);
            let known = own.map(|spec| spec.port.clone()).collect();
            return format!("`{who}` has no output `{}`; it has {}", self.port, listed(known));
        };
        let known = spec.descriptor.fields.iter().map(|field| {
            let extents: Vec<String> = field.shape.iter().map(|extent| format!("[{extent}]")).collect();
            format!("{}{}", field.name, extents.concat())
        });
        format!(
            "`{}` has no field or element `{field}`; it has {}",
            spec.name(),
            listed(known.collect())
        )
    }
}

fn slice(spec: &StreamSpec, name: &str, part: Option<(usize, usize)>) -> Option<Slice> {
    let (field, all) = spec.descriptor.resolve(name)?;
    let (from, to) = match part {
        None => (all.start, all.end),
        Some(part) if field.name == name => part,
        // An element has no sub-elements.
        Some(_) => return None,
    };
    (from < to && to <= field.len()).then(|| Slice {
        field: field.clone(),
        from,
        len: to - from,
    })
}
