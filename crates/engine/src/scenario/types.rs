//! The sections of a scenario file.

use std::collections::BTreeMap;
use std::fmt;

use lockstep::link::{Hold, Timing};
use lockstep::time::Rational;
use serde::de::{Error, Unexpected, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
use toml::{Table, Value};

/// `[participants.NAME]`
#[derive(Debug, Clone, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ParticipantEntry {
    pub(super) run: RunEntry,
    pub(super) period: Rational,
    #[serde(default)]
    pub(super) offset: Rational,
    #[serde(default)]
    pub(super) parameters: Table,
    #[serde(default, rename = "on-failure")]
    pub(super) on_failure: OnFailureEntry,
    #[serde(default, rename = "start-within", skip_serializing_if = "Option::is_none")]
    pub(super) start_within: Option<Rational>,
}

/// `on-failure = "stop"`, `"restart-from-checkpoint"`, or `{ substitute = { … } }`
#[derive(Debug, Clone, Deserialize, Serialize)]
#[serde(
    untagged,
    expecting = "write \"stop\", \"restart-from-checkpoint\" or { substitute = { exe = \"FILE\" } }"
)]
pub(super) enum OnFailureEntry {
    Named(Named),
    Substitute(Box<SubstituteEntry>),
}

#[derive(Debug, Clone, Copy, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Named {
    Stop,
    RestartFromCheckpoint,
}

#[derive(Debug, Clone, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SubstituteEntry {
    pub(super) substitute: RunEntry,
}

impl Default for OnFailureEntry {
    fn default() -> OnFailureEntry {
        OnFailureEntry::Named(Named::Stop)
    }
}

/// `run = { builtin = "plant" }`, `{ exe = "…", args = […] }`, `{ library = "…", participant = "…" }` or `{ fmu = "…", ports = { … } }`
#[derive(Debug, Clone, Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RunEntry {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) builtin: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) exe: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) library: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) participant: Option<String>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) args: Vec<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) fmu: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) ports: Option<Value>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) messages: Option<Value>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) record: Option<Value>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) feedthrough: Option<Value>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) tolerance: Option<Value>,
}

impl RunEntry {
    /// The keys that go with `fmu`.
    pub(super) fn beside_fmu(&self) -> Table {
        let keys = [
            ("ports", &self.ports),
            ("messages", &self.messages),
            ("record", &self.record),
            ("feedthrough", &self.feedthrough),
            ("tolerance", &self.tolerance),
        ];
        let given = keys
            .into_iter()
            .filter_map(|(key, value)| Some((key.to_owned(), value.clone()?)));
        given.collect()
    }
}

/// One input or several with the same link.
#[derive(Debug, Clone, Deserialize, Serialize)]
#[serde(untagged)]
pub(super) enum To {
    One(String),
    Many(Vec<String>),
}

impl To {
    pub(super) fn all(&self) -> &[String] {
        match self {
            To::One(one) => std::slice::from_ref(one),
            To::Many(many) => many,
        }
    }
}

/// `[connections.NAME]`
#[derive(Debug, Clone, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ConnectionEntry {
    pub(super) from: String,
    pub(super) to: To,
    #[serde(default)]
    pub(super) delay: Rational,
    #[serde(default)]
    pub(super) jitter: Rational,
    #[serde(default)]
    pub(super) drop: f64,
    #[serde(default)]
    pub(super) hold: Hold,
    #[serde(default = "zero")]
    pub(super) initial: Value,
    /// Which fields of the input are made of which fields of the output.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) map: Option<Value>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) factor: Option<Value>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) offset: Option<Value>,
    /// Whether it adds to what other connections give to the same fields.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub(super) sum: bool,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) frames: Option<Frames>,
}

/// Which frames the fields at the two ends may be in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Frames {
    /// The same one.
    Same,
    /// Whichever they are in.
    Any,
}

fn zero() -> Value {
    Value::String("zero".into())
}

impl ConnectionEntry {
    pub(super) fn any_frames(&self) -> bool {
        self.frames == Some(Frames::Any)
    }

    pub(super) fn timing(&self) -> Timing {
        Timing {
            delay: self.delay,
            jitter: self.jitter,
            drop: self.drop,
            hold: self.hold,
        }
    }
}

/// The keys that stand at the top of the file.
#[derive(Debug, Clone, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Top {
    #[serde(default)]
    pub(super) title: String,
    /// Read with the text itself: paths depend on it.
    #[serde(default, rename = "folder", skip_serializing_if = "Option::is_none")]
    pub(super) _folder: Option<String>,
    pub(super) duration: Rational,
    #[serde(default = "one", deserialize_with = "seed")]
    pub(super) seed: u64,
    #[serde(default)]
    pub(super) participants: BTreeMap<String, Value>,
    #[serde(default)]
    pub(super) connections: BTreeMap<String, Value>,
    /// Inputs that nobody feeds though their participants need them: a program that drives the run sets them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) inputs: Vec<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) assessment: Option<Table>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) faults: Vec<Value>,
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub(super) guards: BTreeMap<String, Value>,
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub(super) measures: BTreeMap<String, Value>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) report: Option<Table>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) scene: Option<Table>,
    /// What varies in a campaign: no run depends on it.
    #[serde(default, rename = "campaign", skip_serializing_if = "Option::is_none")]
    pub(super) _campaign: Option<Table>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) record: Option<Table>,
}

fn one() -> u64 {
    1
}

/// A seed is a whole number. TOML's end at 2^63; what is larger is written as text.
fn seed<'de, D: Deserializer<'de>>(deserializer: D) -> Result<u64, D::Error> {
    struct Seed;
    impl Visitor<'_> for Seed {
        type Value = u64;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            write!(f, "a whole number from 0 to {}, in quotes above {}", u64::MAX, i64::MAX)
        }

        fn visit_i64<E: Error>(self, seed: i64) -> Result<u64, E> {
            u64::try_from(seed).map_err(|_| E::invalid_value(Unexpected::Signed(seed), &self))
        }

        fn visit_u64<E: Error>(self, seed: u64) -> Result<u64, E> {
            Ok(seed)
        }

        fn visit_str<E: Error>(self, text: &str) -> Result<u64, E> {
            text.parse().map_err(|_| E::invalid_value(Unexpected::Str(text), &self))
        }
    }
    deserializer.deserialize_any(Seed)
}
