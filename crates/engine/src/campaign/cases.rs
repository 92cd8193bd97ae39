//! Campaigns of failures: a declared list of cases.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use serde::Deserialize;
use toml::{Table, Value};

use super::Column;
use super::dispersions::{keys_overlap, label_of};
use crate::scenario::{KeyLines, Mistake, Program, Scenario, ScenarioError};
use crate::text::check_title;

/// A mistake in a list of cases.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{}{}: {reason}", path.display(), line.map_or_else(String::new, |line| format!(":{line}")))]
pub struct CasesError {
    /// The file: the list, or the scenario.
    pub path: PathBuf,
    /// The line in it, from 1, where one is wrong.
    pub line: Option<usize>,
    /// The mistake, and the remedy.
    pub reason: String,
}

/// A file of cases.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct CasesFile {
    /// The one-line description.
    #[serde(default)]
    title: String,
    case: Vec<Case>,
}

/// `[[case]]`
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Case {
    name: String,
    /// Keys of the scenario and their values, as with `--set`.
    #[serde(default)]
    set: Table,
    /// Keys of the scenario that hold lists, and what is added to each.
    #[serde(default)]
    append: Table,
    /// Failures of the stock plant's actuators: added to its `faults`.
    #[serde(default)]
    actuators: Vec<Table>,
    /// Faults of the scenario: added to its list `faults`.
    #[serde(default)]
    faults: Vec<Table>,
}

/// Points with their labels.
#[derive(Debug)]
pub struct Cases {
    /// The one-line description.
    pub title: String,
    /// The columns.
    pub columns: Vec<Column>,
    /// The changes of each.
    pub points: Vec<Vec<String>>,
}

/// The cases that the file `path` lists.
///
/// # Errors
/// Names the case and the key.
pub fn from_file(path: &Path, scenario: &Scenario) -> Result<Cases, CasesError> {
    let refuse_at = |line: Option<usize>, reason: String| CasesError {
        path: path.to_owned(),
        line,
        reason,
    };
    let text = std::fs::read_to_string(path).map_err(|error| refuse_at(None, format!("cannot be read: {error}")))?;
    let list: CasesFile = toml::from_str(&text).map_err(|error| {
        let line = error.span().map(|span| text[..span.start].matches('\n').count() + 1);
        refuse_at(line, error.message().to_owned())
    })?;
    let lines = KeyLines::of(&text);
    check_title(&list.title).map_err(|reason| refuse_at(lines.line("title"), format!("title: {reason}")))?;
    if list.case.is_empty() {
        return Err(refuse_at(None, "has no [[case]]".into()));
    }
    let columns = columns(&list.case);
    let (mut names, mut points) = (Vec::new(), Vec::new());
    for (at, case) in list.case.into_iter().enumerate() {
        let place = format!("case.{}", at + 1);
        let name_line = lines.line(&format!("{place}.name"));
        check_title(&case.name).map_err(|reason| refuse_at(name_line, format!("{place}.name: {reason}")))?;
        if names.contains(&case.name) {
            let name = &case.name;
            let reason = format!("{place}.name: another case is called `{name}` too: choose another name");
            return Err(refuse_at(name_line, reason));
        }
        let refuse = |part: &str, reason: String| {
            let line = lines.line(&format!("{place}.{part}"));
            refuse_at(line, format!("case `{}`: {reason}", case.name))
        };
        let mut changes: Vec<String> = case.set.iter().map(|(key, value)| format!("{key}={value}")).collect();
        let mut add = |part: &str, key: &str, more: Vec<Value>| -> Result<(), CasesError> {
            changes.push(appended(scenario, key, more).map_err(|reason| refuse(part, reason))?);
            Ok(())
        };
        for (key, more) in &case.append {
            let Value::Array(more) = more else {
                let reason = format!("append.\"{key}\" is {}: write a list", more.type_str());
                return Err(refuse("append", reason));
            };
            add("append", key, more.clone())?;
        }
        let tables = |tables: Vec<Table>| tables.into_iter().map(Value::Table).collect::<Vec<_>>();
        if !case.actuators.is_empty() {
            let plant = builtin(scenario, "plant")
                .ok_or_else(|| refuse("actuators", "`actuators`: the scenario has no stock plant".into()))?;
            let key = format!("participants.{plant}.parameters.faults");
            add("actuators", &key, tables(case.actuators))?;
        }
        if !case.faults.is_empty() {
            add("faults", "faults", tables(case.faults))?;
        }
        names.push(case.name);
        points.push(changes);
    }
    Ok(Cases {
        title: list.title,
        columns,
        points,
    })
}

/// `error`, which is of the scenario with the changes of the first case of the list `path`, at the place in the list that
/// causes it; unchanged where the case is not the cause.
pub fn locate_in_first_case(path: &Path, error: ScenarioError) -> ScenarioError {
    let text = std::fs::read_to_string(path).unwrap_or_default();
    let list = toml::from_str::<CasesFile>(&text).ok();
    let Some(first) = list.as_ref().and_then(|list| list.case.first()) else {
        return error;
    };
    let lines = KeyLines::of(&text);
    let mistakes = error.mistakes.iter().map(|mistake| {
        let part = first.section_that_sets(&mistake.key)?;
        Some(Mistake {
            line: lines.line(&format!("case.1.{part}")),
            key: format!("case `{}`: {part}", first.name),
            reason: format!("{}: {}", mistake.key, mistake.reason),
        })
    });
    match mistakes.collect::<Option<Vec<Mistake>>>() {
        Some(mistakes) => ScenarioError {
            file: path.to_owned(),
            mistakes,
        },
        None => error,
    }
}

impl Case {
    /// The part of the case that changes the scenario's `key`, a table around it, or a key in it.
    fn section_that_sets(&self, key: &str) -> Option<&'static str> {
        let has = |table: &Table| table.keys().any(|own| keys_overlap(own, key));
        let of_plant = key.starts_with("participants.") && key.contains(".parameters.faults");
        let parts = [
            ("set", has(&self.set)),
            ("append", has(&self.append)),
            ("actuators", !self.actuators.is_empty() && of_plant),
            ("faults", !self.faults.is_empty() && keys_overlap("faults", key)),
        ];
        parts.into_iter().find(|(_, has)| *has).map(|(part, _)| part)
    }
}

/// The name of each case, and for every key that a case sets or adds to, its value; empty where a case does not use the
/// key.
fn columns(cases: &[Case]) -> Vec<Column> {
    let mut rows: Vec<BTreeMap<String, String>> = Vec::new();
    for case in cases {
        let all = case.set.iter().chain(&case.append);
        let mut row: BTreeMap<String, String> = all.map(|(key, value)| (key.clone(), label_of(value))).collect();
        for (name, tables) in [("actuators", &case.actuators), ("faults", &case.faults)] {
            if !tables.is_empty() {
                let tables = tables.iter().cloned().map(Value::Table).collect();
                row.insert(name.to_owned(), Value::Array(tables).to_string());
            }
        }
        rows.push(row);
    }
    let keys: BTreeSet<&String> = rows.iter().flat_map(BTreeMap::keys).collect();
    let names = cases.iter().map(|case| case.name.clone()).collect();
    let set = keys.into_iter().map(|key| {
        let texts = rows.iter().map(|row| row.get(key).cloned().unwrap_or_default());
        Column::of_texts(key, texts.collect())
    });
    std::iter::once(Column::of_texts("case", names)).chain(set).collect()
}

/// The change that adds `more` to the list at `key`, which need not exist yet.
pub fn appended(scenario: &Scenario, key: &str, more: Vec<Value>) -> Result<String, String> {
    let mut parts = key.split('.');
    let first = parts.next().and_then(|part| scenario.resolved().get(part));
    let found = parts.fold(first, |value, part| value?.as_table()?.get(part));
    let mut list = match found {
        None => Vec::new(),
        Some(Value::Array(list)) => list.clone(),
        Some(other) => return Err(format!("`{key}` is {} and no list", other.type_str())),
    };
    list.extend(more);
    Ok(format!("{key}={}", Value::Array(list)))
}

/// The name of the participant that is an instance of the built-in `name`.
pub fn builtin<'a>(scenario: &'a Scenario, name: &str) -> Option<&'a str> {
    let found = scenario
        .participants
        .iter()
        .find(|entry| entry.program == Program::Builtin(name.to_owned()));
    found.map(|entry| entry.setup.name.as_str())
}
