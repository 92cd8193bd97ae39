//! Writing: from the value of a scenario to a table.

use serde::Serialize;
use toml::{Table, Value};

use super::entries::Entries;
use super::fault::FaultKind;
use super::record;
use super::scenario_spec::{FOLDER, ScenarioSpec, seed_value};
use crate::scenario::names::fault_name;

impl ScenarioSpec {
    /// The table for the scenario's file, with the defaults of participants and connections, the title and the seed.
    pub fn to_table(&self) -> Table {
        let mut table = Table::new();
        let mut put = |key: &str, value: Value| {
            table.insert(key.to_owned(), value);
        };
        put("title", Value::String(self.title.clone()));
        if let Some(folder) = &self.folder {
            put(FOLDER, Value::String(folder.clone()));
        }
        put("duration", Value::String(self.duration.to_string()));
        put("seed", seed_value(self.seed));
        if !self.inputs.is_empty() {
            put("inputs", Value::from(self.inputs.clone()));
        }
        let sections = [
            ("participants", section(&self.participants)),
            ("connections", section(&self.connections)),
            ("guards", section(&self.guards)),
            ("measures", section(&self.measures)),
            ("record", record::to_table(&self.record)),
        ];
        for (key, section) in sections.into_iter().filter(|(_, section)| !section.is_empty()) {
            put(key, Value::Table(section));
        }
        if !self.faults.is_empty() {
            put("faults", Value::Array(self.faults.iter().map(value).collect()));
        }
        let tables = [
            ("assessment", &self.assessment),
            ("report", &self.report),
            ("scene", &self.scene),
            ("campaign", &self.campaign),
        ];
        for (key, own) in tables {
            if let Some(own) = own {
                put(key, Value::Table(own.clone()));
            }
        }
        table
    }

    /// The scenario with every default that was left out, and each time in its shortest text.
    pub(in crate::scenario) fn with_defaults(&self) -> ScenarioSpec {
        let mut spec = self.clone();
        spec.for_each_time(&mut |_, time| time.shorten());
        for (position, own) in spec.faults.iter_mut().enumerate() {
            own.name = Some(fault_name(own.name.as_deref(), position));
            if own.substitute.is_some() {
                own.state.get_or_insert_default();
            }
            if own.kind.is_some_and(FaultKind::is_intermittent) {
                own.probability.get_or_insert(1.0);
            }
        }
        spec
    }

    /// The text of the scenario's file.
    pub fn to_text(&self) -> String {
        toml::to_string_pretty(&self.to_table()).expect("a table is TOML")
    }
}

fn section<T: Serialize>(entries: &Entries<T>) -> Table {
    entries
        .iter()
        .map(|(name, entry)| (name.clone(), value(entry)))
        .collect()
}

/// An entry as TOML. All entries are tables of texts, numbers and TOML values.
fn value<T: Serialize>(entry: &T) -> Value {
    Value::try_from(entry).expect("an entry is a table")
}
