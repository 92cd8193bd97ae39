//! Signal faults: resolving names and units into the elements and numbers of a payload.

use lockstep::fault::{Effect, FaultPort, FaultWindow, SignalFault, Slot};
use lockstep::plan::Plan;
use lockstep::port::{Descriptor, Field};
use lockstep::time::Rational;
use lockstep::units;
use toml::Value;

use super::entry::Refusal;
use crate::scenario::ports::{not_a_port, parse_port};
use crate::scenario::spec::{FaultKind, FaultSpec};

/// A signal fault, resolved as far as possible without the message that it affects.
#[derive(Debug, Clone)]
pub(super) struct DeclaredSignalFault {
    name: String,
    /// Its key in the scenario.
    pub(super) key: String,
    span: FaultWindow,
    /// Participant and port.
    pub(super) port: (String, String),
    output: bool,
    field: Option<String>,
    kind: FaultKind,
    value: Option<Value>,
    bit: Option<u32>,
    probability: f64,
}

fn refusal(key: &str, reason: impl Into<String>) -> Refusal {
    (key.to_owned(), reason.into())
}

impl DeclaredSignalFault {
    pub(super) fn new(
        name: &str,
        key: &str,
        span: FaultWindow,
        at: String,
        output: bool,
        entry: &FaultSpec,
    ) -> Result<DeclaredSignalFault, Refusal> {
        let side = if output { "output" } else { "input" };
        let kind = entry.kind.ok_or_else(|| {
            refusal(
                "",
                "`kind` is missing: bias, scale, ramp, noise, stuck, dropout or bit-flip",
            )
        })?;
        let signal = DeclaredSignalFault {
            name: name.to_owned(),
            key: key.to_owned(),
            span,
            port: parse_port(&at).ok_or_else(|| refusal(side, not_a_port(&at)))?,
            output,
            field: entry.field.clone(),
            kind,
            value: entry.value.clone(),
            bit: entry.bit,
            probability: entry.probability.unwrap_or(1.0),
        };
        signal.check(entry)?;
        Ok(signal)
    }

    /// Its key, and its start time.
    pub(super) fn start_time(&self) -> (&str, Rational) {
        (&self.key, self.span.at)
    }

    /// Checks that all keys that its kind needs are given, and no others.
    fn check(&self, entry: &FaultSpec) -> Result<(), Refusal> {
        let kind = self.kind.name();
        let chance = self.kind.is_intermittent();
        if entry.probability.is_some() && !chance {
            return Err(refusal("probability", format!("a {kind} has none: it is always there")));
        }
        if !(0.0..=1.0).contains(&self.probability) {
            let reason = format!(
                "{} is not a probability: write a value between 0 and 1",
                self.probability
            );
            return Err(refusal("probability", reason));
        }
        if self.bit.is_some() && self.kind != FaultKind::BitFlip {
            return Err(refusal("bit", format!("a {kind} has none")));
        }
        if chance && self.value.is_some() {
            return Err(refusal("value", format!("a {kind} has none")));
        }
        let example = match self.kind {
            FaultKind::Bias | FaultKind::Noise => Some("\"0.2 deg\""),
            FaultKind::Ramp => Some("\"0.2 deg/s\""),
            FaultKind::Scale => Some("1.1"),
            FaultKind::Stuck | FaultKind::Dropout | FaultKind::BitFlip => None,
        };
        if let (None, Some(example)) = (&self.value, example) {
            return Err(refusal(
                "",
                format!("`value` is missing: a {kind} needs one, such as value = {example}"),
            ));
        }
        if self.value.is_some() && self.field.is_none() && self.kind != FaultKind::Scale {
            let reason = format!("`field` is missing: a {kind} with a value is one of a field, which has a unit");
            return Err(refusal("", reason));
        }
        Ok(())
    }

    /// The fault, resolved against the ports of `plan`; `None` if the participant's ports are not certain and it cannot be
    /// resolved.
    pub(super) fn resolve(
        &self,
        plan: &Plan,
        certain: &impl Fn(usize) -> bool,
    ) -> Result<Option<SignalFault>, Refusal> {
        let side = if self.output { "output" } else { "input" };
        let (participant, name) = (&self.port.0, &self.port.1);
        let number = plan.participant(participant);
        let number = number.ok_or_else(|| refusal(side, format!("there is no participant `{participant}`")))?;
        let interface = &plan.participants[number].interface;
        let ports: Vec<(&String, &Descriptor)> = if self.output {
            interface
                .outputs
                .iter()
                .map(|port| (&port.name, &port.descriptor))
                .collect()
        } else {
            interface
                .inputs
                .iter()
                .map(|port| (&port.name, &port.descriptor))
                .collect()
        };
        let found = ports.iter().position(|(own, _)| *own == name);
        let is_assumed = |at: usize| !certain(number) && ports[at].1.name == "unknown";
        let position = match found {
            Some(at) if is_assumed(at) => return Ok(None),
            Some(at) => at,
            None if !certain(number) => return Ok(None),
            None => {
                let known: Vec<String> = ports.iter().map(|(name, _)| format!("`{name}`")).collect();
                let reason = format!("`{participant}` has no {side} `{name}`; it has {}", known.join(", "));
                return Err(refusal(side, reason));
            }
        };
        let (field, slots) = self.slots(ports[position].1)?;
        let place = if self.output {
            FaultPort::Output {
                participant: number,
                port: position,
            }
        } else {
            FaultPort::Input {
                participant: number,
                port: position,
            }
        };
        Ok(Some(SignalFault {
            name: self.name.clone(),
            place,
            span: self.span,
            effect: self.effect(field, &slots)?,
            slots,
            description: self.description(),
        }))
    }

    fn slots<'a>(&self, descriptor: &'a Descriptor) -> Result<(Option<&'a Field>, Vec<Slot>), Refusal> {
        if let Some(reason) = Slot::too_many(descriptor, self.field.as_deref()) {
            return Err(refusal(if self.field.is_some() { "field" } else { "" }, reason));
        }
        let Some(name) = &self.field else {
            return Ok((None, Slot::all(descriptor)));
        };
        match Slot::resolve(descriptor, name) {
            Some((field, slots)) => Ok((Some(field), slots)),
            None => {
                let known: Vec<String> = descriptor.fields.iter().map(|field| format!("`{field}`")).collect();
                let reason = format!(
                    "`{}` has no field or element `{name}`; it has {}",
                    descriptor.name,
                    known.join("; ")
                );
                Err(refusal("field", reason))
            }
        }
    }

    fn effect(&self, field: Option<&Field>, slots: &[Slot]) -> Result<Effect, Refusal> {
        let symbols = slots.iter().any(|slot| !slot.element.is_number());
        if symbols && !matches!(self.kind, FaultKind::Stuck | FaultKind::Dropout) {
            let reason = format!(
                "a {} changes numbers, and {} has a bool, an enumeration, a text or bytes, which can be stuck or drop out: name a field of \
                 numbers, or take kind = \"stuck\" or \"dropout\"",
                self.kind.name(),
                field.map_or_else(|| "the message".to_owned(), |field| format!("`{field}`")),
            );
            return Err(refusal(if field.is_some() { "kind" } else { "" }, reason));
        }
        let unit = field.map_or("1", |field| field.unit.as_str());
        let given = |unit: &str| match &self.value {
            Some(value) => values(value, unit, slots.len()).map_err(|reason| refusal("value", reason)),
            None => Err(refusal("value", "is missing")),
        };
        Ok(match self.kind {
            FaultKind::Bias => Effect::Bias(given(unit)?),
            FaultKind::Scale => Effect::Scale(given("1")?),
            FaultKind::Ramp => Effect::Ramp(given(&format!("{unit}/s"))?),
            FaultKind::Noise => {
                let sigma = given(unit)?;
                if let Some(negative) = sigma.iter().find(|sigma| **sigma < 0.0) {
                    let reason = format!("{negative} {unit} is negative: a noise is given by its standard deviation");
                    return Err(refusal("value", reason));
                }
                Effect::Noise(sigma)
            }
            FaultKind::Stuck if symbols => {
                if let Some(field) = field.filter(|field| field.element.room().is_some() && self.value.is_some()) {
                    let reason =
                        format!("`{field}` is stuck at what it was when the fault begins: leave the value out");
                    return Err(refusal("value", reason));
                }
                let given = self.value.as_ref().zip(field);
                let values = given.map(|(value, field)| {
                    let values = crate::scenario::symbols::symbols(value, field, slots.len());
                    values.map_err(|reason| refusal("value", format!("`{field}`: {reason}")))
                });
                Effect::Stuck(values.transpose()?)
            }
            FaultKind::Stuck => Effect::Stuck(self.value.is_some().then(|| given(unit)).transpose()?),
            FaultKind::Dropout => Effect::Dropout(self.probability),
            FaultKind::BitFlip => {
                let width = slots
                    .iter()
                    .map(|slot| slot.element.size() as u32 * 8)
                    .min()
                    .unwrap_or(0);
                if let Some(bit) = self.bit.filter(|bit| *bit >= width) {
                    let reason = format!(
                        "there is no bit {bit}: the elements have bits 0 (the least) to {}",
                        width - 1
                    );
                    return Err(refusal("bit", reason));
                }
                Effect::BitFlip {
                    bit: self.bit,
                    probability: self.probability,
                }
            }
        })
    }

    /// `controller.measured q[3]: bias 0.2 deg`
    fn description(&self) -> String {
        let mut words = format!("{}.{}", self.port.0, self.port.1);
        if let Some(field) = &self.field {
            words += &format!(" {field}");
        }
        words += &format!(": {}", self.kind.name());
        match &self.value {
            Some(Value::String(text)) => words += &format!(" {text}"),
            Some(other) => words += &format!(" {other}"),
            None => {}
        }
        words.extend(self.bit.map(|bit| format!(" of bit {bit}")));
        if self.probability < 1.0 {
            words += &format!(" in {} % of the samples", 100.0 * self.probability);
        }
        words
    }
}

/// One value for each of `count` elements, in `unit`: one for all, or a list.
pub(in crate::scenario) fn values(value: &Value, unit: &str, count: usize) -> Result<Vec<f64>, String> {
    let (numbers, listed) = match value {
        Value::String(text) => units::convert(text, unit).map_err(|error| error.to_string())?,
        bare if unit == "1" => {
            plain_numbers(bare).ok_or_else(|| format!("`{bare}` is neither a number nor a list of numbers"))?
        }
        other => {
            return Err(format!(
                "`{other}` has no unit; write it in {unit} or a unit that fits, such as \"{other} {unit}\""
            ));
        }
    };
    match (numbers.len(), listed) {
        (1, false) => Ok(vec![numbers[0]; count]),
        (given, true) if given == count => Ok(numbers),
        (given, _) => Err(format!(
            "{given} values are given for {count} elements: give one for all, or a list of {count}"
        )),
    }
}

fn plain_numbers(value: &Value) -> Option<(Vec<f64>, bool)> {
    let number = |value: &Value| match value {
        Value::Float(number) => Some(*number),
        Value::Integer(number) => Some(*number as f64),
        _ => None,
    };
    match value {
        Value::Array(items) => Some((items.iter().map(number).collect::<Option<_>>()?, true)),
        one => Some((vec![number(one).filter(|number| number.is_finite())?], false)),
    }
}
