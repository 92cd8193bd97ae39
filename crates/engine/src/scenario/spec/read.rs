//! Reading: from a table to the value of a scenario, with all mistakes.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::path::Path;

use serde::de::{DeserializeOwned, Error, Unexpected, Visitor};
use serde::{Deserialize, Deserializer};
use toml::{Table, Value};

use super::change::change;
use super::changes::{Changes, WITH_DURATION, WITH_FAULT, WITH_SEED, WITH_SUBSTITUTE};
use super::entries::Entries;
use super::fault::FaultSpec;
use super::files::include_files;
use super::measure::MeasureSpec;
use super::origin::{Origin, WITH_SET, deserialize_at};
use super::record::{self, RecordSpec};
use super::scenario_spec::{FOLDER, ScenarioSpec, folder_of};
use super::text;
use super::time::Time;
use crate::scenario::error::{Mistake, ScenarioError};
use crate::scenario::names::{entry_name, fault_name};

/// The keys at the top level of the file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ScenarioTable {
    #[serde(default)]
    title: String,
    #[serde(default)]
    folder: Option<String>,
    #[serde(default)]
    duration: Option<Time>,
    #[serde(default = "one", deserialize_with = "seed")]
    seed: u64,
    #[serde(default)]
    participants: BTreeMap<String, Value>,
    #[serde(default)]
    connections: BTreeMap<String, Value>,
    #[serde(default)]
    inputs: Vec<String>,
    #[serde(default)]
    assessment: Option<Table>,
    #[serde(default)]
    faults: Vec<Value>,
    #[serde(default)]
    guards: BTreeMap<String, Value>,
    #[serde(default)]
    measures: BTreeMap<String, Value>,
    #[serde(default)]
    report: Option<Table>,
    #[serde(default)]
    scene: Option<Table>,
    #[serde(default)]
    campaign: Option<Table>,
    #[serde(default)]
    record: Option<Table>,
}

fn one() -> u64 {
    1
}

/// A seed is an integer. TOML's integers end at 2^63; larger ones are written as text.
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

/// The result of reading: the scenario as far as it can be read, and the mistakes in the rest.
pub(in crate::scenario) struct PartialScenario {
    pub(in crate::scenario) spec: ScenarioSpec,
    pub(in crate::scenario) unread: UnreadEntries,
    pub(in crate::scenario) mistakes: Vec<Mistake>,
}

/// The entries that could not be read, so that references to them are not refused.
#[derive(Default)]
pub(in crate::scenario) struct UnreadEntries {
    pub(in crate::scenario) participants: BTreeSet<String>,
    pub(in crate::scenario) connections: BTreeSet<String>,
    /// Their positions in the list.
    pub(in crate::scenario) faults: BTreeSet<usize>,
}

impl PartialScenario {
    /// Reads `text` as if it were the content of `file`, with files included, and with `changes`.
    pub(in crate::scenario) fn of_text(
        file: &Path,
        text: String,
        changes: &Changes,
    ) -> Result<PartialScenario, ScenarioError> {
        if changes.changes_substitute() {
            let mut partial = PartialScenario::of_text(file, text, &Changes::default())?.with_changes(changes)?;
            let folder = partial.spec.folder_at(file);
            partial.spec.include_files(&folder)?;
            return Ok(partial);
        }
        let mut table = text::parse(file, &text)?;
        let mut origin = Origin::of(file.to_owned(), text);
        let folder = folder_of(file, table.get(FOLDER).and_then(Value::as_str));
        include_files(&mut table, &folder, &mut origin)?;
        for one in &changes.set {
            change(&mut table, &mut origin, one, WITH_SET).map_err(|mistake| origin.error(vec![mistake]))?;
        }
        if !changes.set.is_empty() {
            include_files(&mut table, &folder, &mut origin)?;
        }
        let mut partial = PartialScenario::of_table(origin, table, changes)?;
        if !changes.faults.is_empty() {
            partial.spec.include_files(&folder)?;
        }
        Ok(partial)
    }

    pub(in crate::scenario) fn of_file(file: &Path, changes: &Changes) -> Result<PartialScenario, ScenarioError> {
        PartialScenario::of_text(file, text::read(file)?, changes)
    }

    /// Applies `changes` in order: a key that is set may belong to a substitute, which must be there first.
    pub(super) fn with_changes(mut self, changes: &Changes) -> Result<PartialScenario, ScenarioError> {
        let first = Changes {
            substitutes: changes.substitutes.clone(),
            ..Changes::default()
        };
        self.apply_values(&first);
        let spec = self.into_spec()?;
        let (mut table, mut origin) = (spec.to_table(), spec.origin);
        for one in &changes.set {
            change(&mut table, &mut origin, one, WITH_SET).map_err(|mistake| origin.error(vec![mistake]))?;
        }
        let rest = Changes {
            substitutes: Vec::new(),
            ..changes.clone()
        };
        PartialScenario::of_table(origin, table, &rest)
    }

    /// Reads a table, and applies those of `changes` that are not made in a table.
    pub(super) fn of_table(origin: Origin, table: Table, changes: &Changes) -> Result<PartialScenario, ScenarioError> {
        if table.contains_key("scenario") && !table.contains_key("participants") {
            let reason = "this is a campaign file: run it with `sweep`, or give the scenario that it names";
            return Err(origin.error(vec![origin.mistake("scenario", reason)]));
        }
        let top: ScenarioTable =
            deserialize_at(&origin, "", Value::Table(table)).map_err(|mistake| origin.error(vec![mistake]))?;
        let (mut mistakes, mut unread) = (Vec::new(), UnreadEntries::default());
        let participants = section(
            &origin,
            "participants",
            top.participants,
            &mut unread.participants,
            &mut mistakes,
        );
        let mut faults = Vec::new();
        for (position, value) in top.faults.into_iter().enumerate() {
            let name = entry_name(&value, position);
            match deserialize_at::<FaultSpec>(&origin, &format!("faults.{name}"), value) {
                Ok(fault) => faults.push(fault),
                Err(mistake) => {
                    unread.faults.insert(position);
                    mistakes.push(mistake);
                }
            }
        }
        let mut none = BTreeSet::new();
        let guards = section(&origin, "guards", top.guards, &mut none, &mut mistakes);
        let measures = section(&origin, "measures", top.measures, &mut none, &mut mistakes);
        let record = record::read(&origin, top.record.unwrap_or_default(), &mut mistakes);
        let connections = section(
            &origin,
            "connections",
            top.connections,
            &mut unread.connections,
            &mut mistakes,
        );
        if top.duration.is_none() && changes.duration.is_none() {
            mistakes.push(origin.mistake("", "missing field `duration`"));
        }
        let spec = ScenarioSpec {
            title: top.title,
            folder: top.folder,
            duration: top.duration.unwrap_or_default(),
            seed: top.seed,
            participants,
            connections,
            inputs: top.inputs,
            assessment: top.assessment,
            faults,
            guards,
            measures,
            report: top.report,
            scene: top.scene,
            campaign: top.campaign,
            record,
            origin,
        };
        let mut partial = PartialScenario { spec, unread, mistakes };
        partial.apply_values(changes);
        Ok(partial)
    }

    /// Applies those of `changes` that are values.
    fn apply_values(&mut self, changes: &Changes) {
        let spec = &mut self.spec;
        for (participant, run) in &changes.substitutes {
            if !self.unread.participants.contains(participant)
                && let Err(error) = spec.set_run(participant, run, WITH_SUBSTITUTE)
            {
                self.mistakes.extend(error.mistakes);
            }
        }
        for fault in &changes.faults {
            let position = spec.faults.len() + self.unread.faults.len();
            let name = fault_name(fault.name.as_deref(), position);
            spec.origin.record_change(format!("faults.{name}"), WITH_FAULT);
            spec.faults.push(fault.clone());
        }
        if let Some(seed) = changes.seed {
            spec.seed = seed;
            spec.origin.record_change("seed".to_owned(), WITH_SEED);
        }
        if let Some(duration) = &changes.duration {
            spec.duration = duration.clone();
            spec.origin.record_change("duration".to_owned(), WITH_DURATION);
        }
    }

    /// A reading of a scenario that is complete.
    pub(in crate::scenario) fn of_spec(spec: ScenarioSpec) -> PartialScenario {
        PartialScenario {
            spec,
            unread: UnreadEntries::default(),
            mistakes: Vec::new(),
        }
    }

    /// The scenario, if no mistake has been found so far.
    pub(super) fn into_spec(self) -> Result<ScenarioSpec, ScenarioError> {
        if self.mistakes.is_empty() {
            Ok(self.spec)
        } else {
            Err(self.spec.origin.error(self.mistakes))
        }
    }
}

/// The entries of a section; those that cannot be read are added to the `unread` ones.
fn section<T: DeserializeOwned>(
    origin: &Origin,
    key: &str,
    entries: BTreeMap<String, Value>,
    unread: &mut BTreeSet<String>,
    mistakes: &mut Vec<Mistake>,
) -> Entries<T> {
    let mut all = Entries::default();
    for (name, value) in entries {
        match deserialize_at(origin, &format!("{key}.{name}"), value) {
            Ok(entry) => {
                all.insert(name, entry);
            }
            Err(mistake) => {
                mistakes.push(mistake);
                unread.insert(name);
            }
        }
    }
    all
}

/// The content of a file as far as it concerns measures and recording. The rest of the file does not matter.
pub(in crate::scenario) struct MeasureTables {
    pub(in crate::scenario) origin: Origin,
    pub(in crate::scenario) measures: Entries<MeasureSpec>,
    pub(in crate::scenario) record: Entries<RecordSpec>,
}

/// Reads the measures and the recording of `file`.
pub(in crate::scenario) fn read_measures(file: &Path) -> Result<MeasureTables, ScenarioError> {
    let text = text::read(file)?;
    let mut table = text::parse(file, &text)?;
    let origin = Origin::of(file.to_owned(), text);
    let mut mistakes = Vec::new();
    let measures = match table.remove("measures") {
        Some(Value::Table(sections)) => {
            let sections = sections.into_iter().collect();
            section(&origin, "measures", sections, &mut BTreeSet::new(), &mut mistakes)
        }
        _ => Entries::default(),
    };
    let record = match table.remove("record") {
        Some(Value::Table(record)) => record::read(&origin, record, &mut mistakes),
        _ => Entries::default(),
    };
    if !mistakes.is_empty() {
        return Err(origin.error(mistakes));
    }
    Ok(MeasureTables {
        origin,
        measures,
        record,
    })
}
