//! The sections of a scenario file.

use std::collections::BTreeMap;

use lockstep::link::{Hold, Timing};
use lockstep::time::Rational;
use serde::{Deserialize, Serialize};
use toml::{Table, Value};

use super::failure::OnFailureEntry;

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

/// `run = { builtin = "plant" }` or `run = { exe = "…", args = […] }`
#[derive(Debug, Clone, Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RunEntry {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) builtin: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) exe: Option<String>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) args: Vec<String>,
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
}

fn zero() -> Value {
    Value::String("zero".into())
}

impl ConnectionEntry {
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
    pub(super) duration: Rational,
    #[serde(default = "one")]
    pub(super) seed: u64,
    #[serde(default)]
    pub(super) participants: BTreeMap<String, Value>,
    #[serde(default)]
    pub(super) connections: BTreeMap<String, Value>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) assessment: Option<Table>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) faults: Vec<Value>,
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub(super) guards: BTreeMap<String, Value>,
}

fn one() -> u64 {
    1
}
