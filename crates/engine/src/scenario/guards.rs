//! `[guards.NAME]`: conditions that an output must never violate.

use lockstep::fault::Slot;
use lockstep::plan::Plan;
use lockstep::time::Rational;
use toml::Value;

use super::error::{Mistake, ScenarioError};
use super::faults::values;
use super::names::{Names, unknown};
use super::ports::{not_a_port, parse_port};
use super::source::SourceContext;
use super::spec::{Entries, GuardSpec, Time};
use super::symbols::symbols;
use crate::run::{Forbidden, SampleGuard};

/// A guard, resolved as far as possible without the ports.
#[derive(Debug, Clone)]
pub(super) struct Guard {
    pub(super) name: String,
    /// Participant and output.
    port: (String, String),
    field: Option<String>,
    range: Option<Value>,
    never: Option<Value>,
    frozen_for: Option<Rational>,
}

/// The key below the guard that is wrong, and why.
type Refusal = (&'static str, String);

/// Reads all sections, as far as possible without the ports of the participants.
pub(super) fn read(
    source: &SourceContext,
    participants: &Names,
    sections: &Entries<GuardSpec>,
) -> Result<Vec<Guard>, Vec<Mistake>> {
    let (mut guards, mut mistakes) = (Vec::new(), Vec::new());
    for (name, entry) in sections {
        match Guard::new(name, participants, entry).map_err(|wrong| mistake(source, name, wrong)) {
            Ok(guard) => guards.push(guard),
            Err(mistake) => mistakes.push(mistake),
        }
    }
    if mistakes.is_empty() { Ok(guards) } else { Err(mistakes) }
}

fn mistake(source: &SourceContext, guard: &str, (key, reason): Refusal) -> Mistake {
    let dot = if key.is_empty() { "" } else { "." };
    source.mistake(&format!("guards.{guard}{dot}{key}"), reason)
}

impl Guard {
    fn new(name: &str, participants: &Names, entry: &GuardSpec) -> Result<Guard, Refusal> {
        let port = parse_port(&entry.output).ok_or_else(|| ("output", not_a_port(&entry.output)))?;
        if !participants.contains(&port.0) {
            return Err(("output", participants.unknown("participant", &port.0)));
        }
        if entry.range.is_none() && entry.frozen_for.is_none() && entry.never.is_none() {
            let reason = "guards against nothing: write range = \"[-10, 10] N m\", never = \"fault\" (of an enumeration), frozen-for = \
                          \"1 s\", or several of them";
            return Err(("", reason.into()));
        }
        if entry.range.is_some() && entry.field.is_none() {
            let reason = "`field` is missing: a range is one of a field, which has a unit";
            return Err(("", reason.into()));
        }
        if entry.never.is_some() && entry.field.is_none() {
            let reason = "`field` is missing: `never` names values of a bool or an enumeration";
            return Err(("", reason.into()));
        }
        let frozen_for = entry.frozen_for.as_ref().map(Time::checked);
        if let Some(time) = frozen_for.filter(|time| !time.is_positive()) {
            return Err(("frozen-for", format!("{time} must be above zero")));
        }
        Ok(Guard {
            name: name.to_owned(),
            port,
            field: entry.field.clone(),
            range: entry.range.clone(),
            never: entry.never.clone(),
            frozen_for,
        })
    }

    /// The guard, resolved against the ports of `plan`; `None` if the participant's ports are not certain.
    fn watch(&self, plan: &Plan, certain: &impl Fn(usize) -> bool) -> Result<Option<SampleGuard>, Refusal> {
        let (participant, output) = (&self.port.0, &self.port.1);
        let Some(number) = plan.participant(participant).filter(|&number| certain(number)) else {
            return Ok(None);
        };
        let own = &plan.participants[number];
        let ports = || own.interface.outputs.iter();
        let Some(position) = ports().position(|port| port.name == *output) else {
            let known: Vec<&String> = ports().map(|port| &port.name).collect();
            return Err(("output", unknown("output", output, known.into_iter())));
        };
        let descriptor = &own.interface.outputs[position].descriptor;
        if let Some(reason) = Slot::too_many(descriptor, self.field.as_deref()) {
            return Err((if self.field.is_some() { "field" } else { "output" }, reason));
        }
        let (field, slots) = match &self.field {
            None => (None, Slot::all(descriptor)),
            Some(name) => {
                let Some((field, slots)) = Slot::resolve(descriptor, name) else {
                    let known: Vec<String> = descriptor.fields.iter().map(|field| format!("`{field}`")).collect();
                    let reason = format!(
                        "`{}` has no field or element `{name}`; it has {}",
                        descriptor.name,
                        known.join("; ")
                    );
                    return Err(("field", reason));
                };
                (Some(field), slots)
            }
        };
        let bounds = |value: &Value, unit: &str| match values(value, unit, 2).map_err(|reason| ("range", reason))?[..] {
            [low, high] if low < high => Ok((low, high)),
            _ => Err((
                "range",
                format!("{value} is not a range: write two bounds, the lower one first, such as \"[-10, 10] {unit}\""),
            )),
        };
        if let Some(field) = field.filter(|field| field.element.room().is_some())
            && (self.range.is_some() || self.never.is_some())
        {
            let key = if self.range.is_some() { "range" } else { "never" };
            let reason =
                format!("`{field}` has neither a range nor named values: it can be guarded with `frozen-for` alone");
            return Err((key, reason));
        }
        if let (Some(_), Some(field)) = (&self.range, field.filter(|field| !field.element.is_number())) {
            let reason =
                format!("`{field}` has no range: name the values that it must not have, such as never = \"fault\"");
            return Err(("range", reason));
        }
        let never = match (&self.never, field) {
            (Some(value), Some(field)) if !field.element.is_number() => {
                let values = symbols(value, field, value.as_array().map_or(1, Vec::len));
                values.map_err(|reason| ("never", format!("`{field}`: {reason}")))?
            }
            (Some(_), Some(field)) => {
                let reason = format!("`{field}` is made of numbers, which have a `range`");
                return Err(("never", reason));
            }
            _ => Vec::new(),
        };
        let range = match (&self.range, field) {
            (Some(value), Some(field)) => Some(bounds(value, &field.unit)?),
            _ => None,
        };
        let ticks = |time| plan.timebase.ceil(time);
        let frozen_for = self.frozen_for.map(ticks).transpose();
        let frozen_for = frozen_for.map_err(|error| ("frozen-for", error.to_string()))?;
        let (name, stream) = (self.name.clone(), own.first_stream as usize + position);
        let forbidden = Forbidden { range, never };
        Ok(Some(SampleGuard::new(
            name, stream, descriptor, slots, forbidden, frozen_for,
        )))
    }
}

impl Guard {
    /// The guarded output and its conditions, as text.
    pub(super) fn description(&self) -> String {
        let mut words = format!("{}.{}", self.port.0, self.port.1);
        words.extend(self.field.iter().map(|field| format!(" {field}")));
        match &self.range {
            Some(Value::String(range)) => words += &format!(" within {range}"),
            Some(range) => words += &format!(" within {range}"),
            None => {}
        }
        words.extend(self.never.iter().map(|never| format!(" never {never}")));
        words.extend(self.frozen_for.map(|time| format!(", not frozen for {time}")));
        words
    }
}

/// `guards`, resolved against the ports of `plan`; those of participants whose ports are not `certain` are left out.
pub(super) fn watches(
    guards: &[Guard],
    source: &SourceContext,
    plan: &Plan,
    certain: impl Fn(usize) -> bool,
) -> Result<Vec<SampleGuard>, ScenarioError> {
    let (mut watches, mut mistakes) = (Vec::new(), Vec::new());
    for guard in guards {
        match guard.watch(plan, &certain) {
            Ok(watch) => watches.extend(watch),
            Err(wrong) => mistakes.push(mistake(source, &guard.name, wrong)),
        }
    }
    if mistakes.is_empty() {
        Ok(watches)
    } else {
        Err(source.error(mistakes))
    }
}
