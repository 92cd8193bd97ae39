//! `[record]`: which samples are recorded.

use serde::{Deserialize, Serialize};
use toml::{Table, Value};

use super::entries::Entries;
use super::origin::{Origin, deserialize_at};
use super::time::Time;
use crate::scenario::error::Mistake;

/// The prefix of an input in the name of the stream that holds what a participant saw at that input.
pub(in crate::scenario) const SEEN: &str = "seen";

/// Which samples of a stream, or of all streams of a participant, are recorded.
#[derive(Debug, Clone, PartialEq)]
pub enum RecordSpec {
    /// Every sample.
    Whole,
    /// No sample.
    Nothing,
    /// Some samples.
    Part(RecordPart),
}

/// Which samples of a stream are recorded.
#[derive(Debug, Clone, Default, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct RecordPart {
    /// The interval between samples, a multiple of the stream's period.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub every: Option<Time>,
    /// The start of the recording.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub from: Option<Time>,
    /// The end of the recording.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub to: Option<Time>,
}

impl RecordSpec {
    /// One sample per `time`.
    pub fn every(time: impl Into<Time>) -> RecordSpec {
        RecordSpec::Part(RecordPart {
            every: Some(time.into()),
            ..RecordPart::default()
        })
    }

    fn read(origin: &Origin, key: &str, value: Value) -> Result<RecordSpec, Mistake> {
        match value {
            Value::Boolean(true) => Ok(RecordSpec::Whole),
            Value::Boolean(false) => Ok(RecordSpec::Nothing),
            Value::Table(_) => deserialize_at(origin, key, value).map(RecordSpec::Part),
            other => {
                let reason = format!(
                    "{other} does not specify what is recorded: write false, true, or a table such as {{ every = \"10 ms\", from = \"2 s\", to = \"5 s\" }}"
                );
                Err(origin.mistake(key, reason))
            }
        }
    }

    fn to_value(&self) -> Value {
        match self {
            RecordSpec::Whole => Value::Boolean(true),
            RecordSpec::Nothing => Value::Boolean(false),
            RecordSpec::Part(part) => Value::try_from(part).unwrap_or(Value::Boolean(true)),
        }
    }
}

/// Reads the table, with entries for `PARTICIPANT`, `PARTICIPANT.OUTPUT` or `PARTICIPANT.seen.INPUT`.
pub(super) fn read(origin: &Origin, table: Table, mistakes: &mut Vec<Mistake>) -> Entries<RecordSpec> {
    let mut all = Entries::default();
    let mut add = |key: String, value: Value| match RecordSpec::read(origin, &format!("record.{key}"), value) {
        Ok(part) => {
            all.insert(key, part);
        }
        Err(mistake) => mistakes.push(mistake),
    };
    for (participant, value) in table {
        let Value::Table(ports) = value else {
            add(participant, value);
            continue;
        };
        for (port, value) in ports {
            match value {
                Value::Table(inputs) if port == SEEN => {
                    let seen = inputs.into_iter();
                    seen.for_each(|(input, value)| add(format!("{participant}.{SEEN}.{input}"), value));
                }
                value => add(format!("{participant}.{port}"), value),
            }
        }
    }
    all
}

/// The table for `all`.
pub(super) fn to_table(all: &Entries<RecordSpec>) -> Table {
    let mut table = Table::new();
    for (key, part) in all {
        let mut names = key.split('.');
        let last = names.next_back().unwrap_or_default();
        let mut here = &mut table;
        for name in names {
            let below = here.entry(name).or_insert_with(|| Value::Table(Table::new()));
            if !below.is_table() {
                *below = Value::Table(Table::new());
            }
            here = below.as_table_mut().expect("it is one now");
        }
        here.insert(last.to_owned(), part.to_value());
    }
    table
}
