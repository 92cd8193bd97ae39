//! Resolution of `PARTICIPANT.OUTPUT.FIELD` into elements of a stream.

use lockstep::fault::Slot;
use lockstep::port::{Element, Field};
use tape::StreamSpec;
use toml::Value;

use super::refusal::{Refusal, conversion_factor, refusal};
use crate::measures::Reading;
use crate::scenario::names::unknown;
use crate::scenario::symbols::symbol;

/// One or several elements named by the user.
pub(super) struct SelectedElements<'a> {
    pub(super) path: &'a str,
    stream: usize,
    pub(super) field: &'a Field,
    pub(super) slots: Vec<Slot>,
    /// Whether it is the whole field, not an element of it.
    pub(super) whole: bool,
}

impl<'a> SelectedElements<'a> {
    /// Resolves `path`, which is `PARTICIPANT.OUTPUT.FIELD`, or an element of it.
    pub(super) fn find(streams: &'a [StreamSpec], key: &str, path: &'a str) -> Result<SelectedElements<'a>, Refusal> {
        let names = || streams.iter().map(StreamSpec::name);
        let rest = |name: &String| path.strip_prefix(name.as_str()).and_then(|rest| rest.strip_prefix('.'));
        let Some(stream) = names().position(|name| rest(&name).is_some()) else {
            return refusal(key, unknown_stream_message(streams, path));
        };
        let spec = &streams[stream];
        let name = &path[spec.name().len() + 1..];
        if let Some(reason) = Slot::too_many(&spec.descriptor, Some(name)) {
            return refusal(key, reason);
        }
        let Some((field, slots)) = Slot::resolve(&spec.descriptor, name) else {
            let known: Vec<String> = spec
                .descriptor
                .fields
                .iter()
                .map(|field| format!("`{field}`"))
                .collect();
            let reason = format!(
                "`{}` has no field or element `{name}`; it has {}",
                spec.name(),
                known.join("; ")
            );
            return refusal(key, reason);
        };
        Ok(SelectedElements {
            path,
            stream,
            whole: field.name == name,
            field,
            slots,
        })
    }

    fn shape(&self) -> &[u32] {
        if self.whole { &self.field.shape } else { &[] }
    }

    /// The factor from the unit of this into the unit of `of`, from which this is subtracted.
    pub(super) fn factor_into(&self, of: &SelectedElements<'_>) -> Result<f64, Refusal> {
        if self.shape() != of.shape() {
            let reason = format!(
                "`{}` has the shape {:?}, `{}` has {:?}: both must have the same",
                self.path,
                self.shape(),
                of.path,
                of.shape()
            );
            return refusal("minus", reason);
        }
        let (own, other) = (&self.field.frame, &of.field.frame);
        if own != other && !own.is_empty() && !other.is_empty() {
            let reason = format!(
                "`{}` is given in the frame `{own}`, `{}` in `{other}`: what is taken from it must be in the same",
                self.path, of.path
            );
            return refusal("minus", reason);
        }
        conversion_factor(&self.field.unit, &of.field.unit).map_err(|_| {
            let reason = format!(
                "`{}` is in {}, `{}` in {}: the units do not fit",
                self.path, self.field.unit, of.path, of.field.unit
            );
            ("minus".to_owned(), reason)
        })
    }

    pub(super) fn check_attitude(&self, key: &str) -> Result<(), Refusal> {
        if self.slots.len() == 4 && self.field.unit == "1" {
            return Ok(());
        }
        let reason = format!(
            "`{}` is {} numbers in {}; an angle is one of attitudes, each a quaternion of four numbers in 1, the scalar first",
            self.path,
            self.slots.len(),
            self.field.unit
        );
        refusal(key, reason)
    }

    /// The value of an enumeration that `is` names.
    pub(super) fn enum_value(&self, is: Option<&Value>) -> Result<Option<f64>, Refusal> {
        let Some(is) = is else { return Ok(None) };
        if self.field.element != Element::Enum {
            let reason = format!(
                "asks for a value of an enumeration, and `{}` is `{}`: leave it out",
                self.path, self.field
            );
            return refusal("is", reason);
        }
        let byte = symbol(is, self.field).map_err(|reason| ("is".to_owned(), reason))?;
        Ok(Some(f64::from(byte)))
    }

    /// Checks that the elements are numbers, so that arithmetic makes sense.
    pub(super) fn check_number(&self, key: &str) -> Result<(), Refusal> {
        if self.field.element.room().is_some() {
            let reason = format!(
                "`{}` is `{}`, with which nothing can be computed: ask for compute = \"changes\"",
                self.path, self.field
            );
            return refusal(key, reason);
        }
        if self.field.element != Element::Enum {
            return Ok(());
        }
        let example = self.field.values.first().map_or("", |named| named.name.as_str());
        let reason = format!(
            "`{}` is `{}`, with which nothing can be computed: ask for one of its values, such as is = \"{example}\", which is 1 where \
             it has it and 0 elsewhere, or for compute = \"changes\", \"final\" or \"at\"",
            self.path, self.field
        );
        refusal(key, reason)
    }

    pub(super) fn reading(&self, is: Option<f64>) -> Reading {
        Reading {
            stream: self.stream,
            slots: self.slots.clone(),
            is,
        }
    }
}

/// The message that `path` names no field of `streams`.
fn unknown_stream_message(streams: &[StreamSpec], path: &str) -> String {
    let names: Vec<String> = streams.iter().map(StreamSpec::name).collect();
    let parts: Vec<&str> = path.split('.').collect();
    // A stream is PARTICIPANT.OUTPUT, or PARTICIPANT.seen.INPUT.
    let length = if parts.get(1) == Some(&"seen") { 3 } else { 2 };
    if parts.len() > length {
        return unknown("stream", &parts[..length].join("."), names.iter());
    }
    let listed: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
    format!(
        "`{path}` is not a field of a stream: write \"PARTICIPANT.OUTPUT.FIELD\", or an element such as \
         \"PARTICIPANT.OUTPUT.FIELD[2]\"; the streams are {}",
        match listed.is_empty() {
            true => "none".to_owned(),
            false => listed.join(", "),
        }
    )
}
