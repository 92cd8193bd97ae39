//! `[connections.NAME]`

use lockstep::link::{Hold, Timing};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use toml::{Table, Value};

use super::time::Time;

/// A connection from an output to one input or several.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct ConnectionSpec {
    /// `PARTICIPANT.OUTPUT`, or a field of it.
    pub from: String,
    /// `PARTICIPANT.INPUT`, or fields; in a file one text or a list.
    #[serde(deserialize_with = "one_or_many", serialize_with = "as_few")]
    pub to: Vec<String>,
    /// How long a sample takes.
    #[serde(default)]
    pub delay: Time,
    /// How much longer it takes at most, drawn for each sample.
    #[serde(default)]
    pub jitter: Time,
    /// The probability that a sample is lost.
    #[serde(default)]
    pub drop: f64,
    /// What the input sees where no newer sample came through.
    #[serde(default)]
    pub hold: Hold,
    /// What the input sees at first: `"zero"`, `"first-sample"`, or a table of fields with units.
    #[serde(default = "zero")]
    pub initial: Value,
    /// Which fields of the input are made of which fields of the output: `"by-name"`, or a table.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub map: Option<Value>,
    /// What a field is multiplied by.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub factor: Option<Value>,
    /// What is added to a field.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub offset: Option<Value>,
    /// Whether it adds to what other connections give to the same fields.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub sum: bool,
    /// Which frames the fields at the two ends may be in; the same one unless given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frames: Option<Frames>,
}

/// Which frames the fields at the two ends may be in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Frames {
    /// The same one.
    Same,
    /// Whichever they are in.
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

fn as_few<S: Serializer>(to: &[String], serializer: S) -> Result<S::Ok, S::Error> {
    match to {
        [one] => serializer.serialize_str(one),
        many => many.serialize(serializer),
    }
}

impl ConnectionSpec {
    /// From an output to an input, both `PARTICIPANT.PORT` or `PARTICIPANT.PORT.FIELD`, without delay.
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

    /// One more input.
    #[must_use]
    pub fn and_to(mut self, to: &str) -> ConnectionSpec {
        self.to.push(to.to_owned());
        self
    }

    /// How long a sample takes.
    #[must_use]
    pub fn delay(mut self, delay: impl Into<Time>) -> ConnectionSpec {
        self.delay = delay.into();
        self
    }

    /// How much longer it takes at most.
    #[must_use]
    pub fn jitter(mut self, jitter: impl Into<Time>) -> ConnectionSpec {
        self.jitter = jitter.into();
        self
    }

    /// The probability that a sample is lost.
    #[must_use]
    pub fn dropping(mut self, probability: f64) -> ConnectionSpec {
        self.drop = probability;
        self
    }

    /// What the input sees where no newer sample came through.
    #[must_use]
    pub fn hold(mut self, hold: Hold) -> ConnectionSpec {
        self.hold = hold;
        self
    }

    /// What the input sees at first: a table of fields with units.
    #[must_use]
    pub fn initial(mut self, initial: impl Into<Value>) -> ConnectionSpec {
        self.initial = initial.into();
        self
    }

    /// At first the input sees the output's first sample.
    #[must_use]
    pub fn first_sample(self) -> ConnectionSpec {
        self.initial("first-sample")
    }

    /// Every field of the input is the output's field of the same name.
    #[must_use]
    pub fn by_name(mut self) -> ConnectionSpec {
        self.map = Some("by-name".into());
        self
    }

    /// The input's field `to` is made of `from`: the name of a field, a table with `from`, `factor` and `offset`, a list of them for
    /// their sum, or a constant.
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

    /// What the one field is multiplied by.
    #[must_use]
    pub fn factor(mut self, factor: impl Into<Value>) -> ConnectionSpec {
        self.factor = Some(factor.into());
        self
    }

    /// What is added to the one field.
    #[must_use]
    pub fn offset(mut self, offset: impl Into<Value>) -> ConnectionSpec {
        self.offset = Some(offset.into());
        self
    }

    /// It adds to what other connections give to the same fields.
    #[must_use]
    pub fn sum(mut self) -> ConnectionSpec {
        self.sum = true;
        self
    }

    /// The fields at the two ends may be in any frames.
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
