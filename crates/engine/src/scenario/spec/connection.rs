//! `[connections.NAME]` as a value: the ends of a connection, its delivery and its map.

use lockstep::link::{Hold, Timing};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use toml::{Table, Value};

use super::time::Time;

/// A connection from an output to one input or several.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(
    deny_unknown_fields,
    expecting = "a table with the keys of a connection, such as { from = \"PARTICIPANT.OUTPUT\", to = \"PARTICIPANT.INPUT\" }"
)]
pub struct ConnectionSpec {
    /// `PARTICIPANT.OUTPUT`, or a field of it.
    pub from: String,
    /// `PARTICIPANT.INPUT`, or fields; in a file one text or a list.
    #[serde(deserialize_with = "one_or_many", serialize_with = "one_or_list")]
    pub to: Vec<String>,
    /// The delay of a sample.
    #[serde(default)]
    pub delay: Time,
    /// The largest additional delay, drawn for each sample.
    #[serde(default)]
    pub jitter: Time,
    /// The probability that a sample is lost.
    #[serde(default)]
    pub drop: f64,
    /// What the input shows when no newer sample has arrived.
    #[serde(default)]
    pub hold: Hold,
    /// The start value of the input: `"zero"`, `"first-sample"`, or a table of fields with units.
    #[serde(default = "zero")]
    pub initial: Value,
    /// How the fields of the input are composed of fields of the output: `"by-name"`, or a table.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub map: Option<Value>,
    /// The factor by which a field is multiplied.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub factor: Option<Value>,
    /// The offset that is added to a field.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub offset: Option<Value>,
    /// Whether the values are added to those of other connections to the same fields.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub sum: bool,
    /// Which frames the fields at the two ends may be in; unless given, both must be in the same frame.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frames: Option<Frames>,
}

/// Which frames the fields at the two ends may be in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Frames {
    /// The same frame.
    Same,
    /// Any frames.
    Any,
}

fn zero() -> Value {
    Value::String("zero".into())
}

fn one_or_many<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<String>, D::Error> {
    #[derive(Deserialize)]
    #[serde(untagged)]
    enum To {
        One(String),
        Many(Vec<String>),
    }
    Ok(match To::deserialize(deserializer)? {
        To::One(one) => vec![one],
        To::Many(many) => many,
    })
}

fn one_or_list<S: Serializer>(to: &[String], serializer: S) -> Result<S::Ok, S::Error> {
    match to {
        [one] => serializer.serialize_str(one),
        many => many.serialize(serializer),
    }
}

impl ConnectionSpec {
    /// A connection from an output to an input, both `PARTICIPANT.PORT` or `PARTICIPANT.PORT.FIELD`, without delay.
    pub fn new(from: &str, to: &str) -> ConnectionSpec {
        ConnectionSpec {
            from: from.to_owned(),
            to: vec![to.to_owned()],
            delay: Time::default(),
            jitter: Time::default(),
            drop: 0.0,
            hold: Hold::default(),
            initial: zero(),
            map: None,
            factor: None,
            offset: None,
            sum: false,
            frames: None,
        }
    }

    /// Adds another input.
    #[must_use]
    pub fn and_to(mut self, to: &str) -> ConnectionSpec {
        self.to.push(to.to_owned());
        self
    }

    /// Sets the delay of a sample.
    #[must_use]
    pub fn delay(mut self, delay: impl Into<Time>) -> ConnectionSpec {
        self.delay = delay.into();
        self
    }

    /// Sets the largest additional delay.
    #[must_use]
    pub fn jitter(mut self, jitter: impl Into<Time>) -> ConnectionSpec {
        self.jitter = jitter.into();
        self
    }

    /// Sets the probability that a sample is lost.
    #[must_use]
    pub fn dropping(mut self, probability: f64) -> ConnectionSpec {
        self.drop = probability;
        self
    }

    /// Sets what the input shows when no newer sample has arrived.
    #[must_use]
    pub fn hold(mut self, hold: Hold) -> ConnectionSpec {
        self.hold = hold;
        self
    }

    /// Sets the start value of the input: a table of fields with units.
    #[must_use]
    pub fn initial(mut self, initial: impl Into<Value>) -> ConnectionSpec {
        self.initial = initial.into();
        self
    }

    /// The output's first sample becomes the start value of the input.
    #[must_use]
    pub fn first_sample(self) -> ConnectionSpec {
        self.initial("first-sample")
    }

    /// Every field of the input becomes the output's field of the same name.
    #[must_use]
    pub fn by_name(mut self) -> ConnectionSpec {
        self.map = Some("by-name".into());
        self
    }

    /// Composes the input's field `to` of `from`: the name of a field, a table with `from`, `factor` and `offset`, a list of them
    /// for their sum, or a constant.
    #[must_use]
    pub fn field(mut self, to: &str, from: impl Into<Value>) -> ConnectionSpec {
        let mut map = match self.map {
            Some(Value::Table(map)) => map,
            _ => Table::new(),
        };
        map.insert(to.to_owned(), from.into());
        self.map = Some(Value::Table(map));
        self
    }

    /// Sets the factor by which the single field is multiplied.
    #[must_use]
    pub fn factor(mut self, factor: impl Into<Value>) -> ConnectionSpec {
        self.factor = Some(factor.into());
        self
    }

    /// Sets the offset that is added to the single field.
    #[must_use]
    pub fn offset(mut self, offset: impl Into<Value>) -> ConnectionSpec {
        self.offset = Some(offset.into());
        self
    }

    /// Adds the values to those of other connections to the same fields.
    #[must_use]
    pub fn sum(mut self) -> ConnectionSpec {
        self.sum = true;
        self
    }

    /// Allows the fields at the two ends to be in any frames.
    #[must_use]
    pub fn in_any_frames(mut self) -> ConnectionSpec {
        self.frames = Some(Frames::Any);
        self
    }

    pub(in crate::scenario) fn any_frames(&self) -> bool {
        self.frames == Some(Frames::Any)
    }

    pub(in crate::scenario) fn timing(&self) -> Timing {
        Timing {
            delay: self.delay.checked(),
            jitter: self.jitter.checked(),
            drop: self.drop,
            hold: self.hold,
        }
    }
}
