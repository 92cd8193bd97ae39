//! The text of a scenario: values, the lines they stand on, files put in place of their names, and overrides.

use std::collections::HashMap;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use serde::de::DeserializeOwned;
use toml::{Table, Value};

use super::error::{Mistake, ScenarioError};
use super::faults::{append as append_fault, table as fault_table};
use super::lines::Lines;
use super::names::fault_name;
use super::value::{keep_decimal, value};
use crate::builtins::Builtins;

/// The key of the folder that relative paths are relative to.
pub(super) const FOLDER: &str = "folder";

/// A scenario as it was read, before anything is understood.
#[derive(Clone)]
pub(super) struct Source {
    pub(super) builtins: Arc<Builtins>,
    file: PathBuf,
    text: String,
    /// The lines of its keys, once there is a mistake.
    lines: OnceLock<Lines>,
    pub(super) table: Table,
    /// The keys that were given on the command line, with the option.
    overridden: HashMap<String, &'static str>,
    /// The files whose contents stand in the table, for the run's record.
    pub(super) files: Vec<PathBuf>,
}

impl Source {
    /// Reads `file`, puts files in place of `{ file = "…" }`, and applies `overrides` of the form `key.path=value` or
    /// `faults+=entry`.
    pub(super) fn read(builtins: &Arc<Builtins>, file: &Path, overrides: &[String]) -> Result<Source, ScenarioError> {
        let text = std::fs::read_to_string(file).map_err(|error| ScenarioError {
            file: file.to_owned(),
            mistakes: vec![Mistake {
                line: None,
                key: String::new(),
                reason: format!("cannot be read: {error}"),
            }],
        })?;
        Source::of_text(builtins, file, text, overrides)
    }

    /// What `file` would be if `text` stood in it.
    pub(super) fn of_text(
        builtins: &Arc<Builtins>,
        file: &Path,
        text: String,
        overrides: &[String],
    ) -> Result<Source, ScenarioError> {
        let whole = |line, reason: String| ScenarioError {
            file: file.to_owned(),
            mistakes: vec![Mistake {
                line,
                key: String::new(),
                reason,
            }],
        };
        let table = text.parse::<Table>().map_err(|error| {
            whole(
                error.span().map(|span| line_of(&text, &span)),
                format!("is not TOML: {}", error.message()),
            )
        })?;
        let mut source = Source {
            builtins: builtins.clone(),
            file: file.to_owned(),
            text,
            table,
            lines: OnceLock::new(),
            overridden: HashMap::new(),
            files: Vec::new(),
        };
        source.fill_in_files()?;
        for one in overrides {
            match one.strip_prefix("faults+=") {
                Some(entry) => source.add_fault(entry)?,
                None => source.set(one)?,
            }
        }
        source.fill_in_files()?;
        Ok(source)
    }

    /// The folder that relative paths are relative to: the file's own unless it names another.
    pub(super) fn folder(&self) -> PathBuf {
        let own = self.file.parent().unwrap_or(Path::new(""));
        let named = self.table.get(FOLDER).and_then(Value::as_str);
        named.map_or_else(|| own.to_owned(), |named| own.join(named))
    }

    /// The same from the root on; `None` when there is no current folder.
    pub(super) fn folder_in_full(&self) -> Option<PathBuf> {
        std::path::absolute(self.folder().join(".")).ok()
    }

    /// A mistake about `key`, with the line it stands on, or with the option that gave it.
    pub(super) fn mistake(&self, key: &str, reason: impl Into<String>) -> Mistake {
        let reason = reason.into();
        // The key itself, then the tables around it.
        let ends = key.rmatch_indices('.').map(|(at, _)| at);
        let mut around = std::iter::once(key.len()).chain(ends).map(|end| &key[..end]);
        if let Some(option) = around.find_map(|key| self.overridden.get(key)) {
            return Mistake {
                line: None,
                key: key.to_owned(),
                reason: format!("{reason} (given with {option})"),
            };
        }
        Mistake {
            line: self.lines.get_or_init(|| Lines::of(&self.text)).line(key),
            key: key.to_owned(),
            reason,
        }
    }

    pub(super) fn error(&self, mistakes: Vec<Mistake>) -> ScenarioError {
        ScenarioError {
            file: self.file.clone(),
            mistakes,
        }
    }

    fn set(&mut self, one: &str) -> Result<(), ScenarioError> {
        let fail = |key: &str, reason: String| ScenarioError {
            file: self.file.clone(),
            mistakes: vec![Mistake {
                line: None,
                key: key.to_owned(),
                reason,
            }],
        };
        let Some((key, text)) = one.split_once('=') else {
            return Err(fail(
                one,
                "--set takes KEY.PATH=VALUE, such as connections.measured.delay=10ms".into(),
            ));
        };
        let (key, text) = (key.trim(), text.trim());
        let mut value = value(text);
        if key == FOLDER {
            let reason =
                "is where the file's own relative paths lead: it is changed in the file alone (given with --set)";
            return Err(fail(key, reason.into()));
        }
        let parts: Vec<&str> = key.split('.').collect();
        let (last, above) = parts.split_last().expect("split gives at least one part");
        if parts.iter().any(|part| part.is_empty()) {
            return Err(fail(key, "a key has no empty parts".into()));
        }
        let mut table = &mut self.table;
        let mut way = above.iter().enumerate();
        while let Some((depth, part)) = way.next() {
            let known: Vec<String> = table.keys().map(|name| format!("`{name}`")).collect();
            // Names of participants and connections must exist; what is below may be a default that the file leaves out. A
            // guard, a measure, what the report or the playback draws or what is recorded may be new.
            if depth < 2
                && !["guards", "measures", "report", "scene", "record"].contains(&above[0])
                && !table.contains_key(*part)
            {
                let place = above[..depth].join(".");
                let there = if place.is_empty() {
                    "the scenario".to_owned()
                } else {
                    format!("`{place}`")
                };
                return Err(fail(
                    key,
                    format!(
                        "there is no `{part}` in {there} (given with --set); there is {}",
                        known.join(", ")
                    ),
                ));
            }
            let entry = table
                .entry((*part).to_owned())
                .or_insert_with(|| Value::Table(Table::new()));
            let kind = entry.type_str();
            table = match entry {
                Value::Table(inner) => inner,
                Value::Array(list) if list.iter().any(Value::is_table) => {
                    let part = way.next().map(|(_, part)| *part);
                    entry_of(list, part).map_err(|reason| fail(key, reason))?
                }
                _ => {
                    let reason = format!("`{part}` is {kind} and has no keys (given with --set)");
                    return Err(fail(key, reason));
                }
            };
        }
        if let Some(before) = table.get(*last) {
            keep_decimal(&mut value, before);
        }
        table.insert((*last).to_owned(), value);
        self.overridden.insert(key.to_owned(), "--set");
        Ok(())
    }

    fn add_fault(&mut self, text: &str) -> Result<(), ScenarioError> {
        let refuse = |reason: String| ScenarioError {
            file: self.file.clone(),
            mistakes: vec![Mistake {
                line: None,
                key: "faults".into(),
                reason: format!("{reason} (given with --fault)"),
            }],
        };
        let entry = fault_table(text).map_err(refuse)?;
        let position = self.table.get("faults").and_then(Value::as_array).map_or(0, Vec::len);
        let name = fault_name(entry.get("name").and_then(Value::as_str), position);
        append_fault(&mut self.table, entry).map_err(refuse)?;
        self.overridden.insert(format!("faults.{name}"), "--fault");
        Ok(())
    }

    fn fill_in_files(&mut self) -> Result<(), ScenarioError> {
        let folder = self.folder();
        let mut mistakes = Vec::new();
        let mut files = Vec::new();
        for section in ["participants", "assessment", "scene"] {
            if let Some(value) = self.table.get_mut(section) {
                fill_in(value, section, &folder, &mut files, &mut mistakes);
            }
        }
        let bodies = self
            .table
            .get_mut("scene")
            .and_then(|scene| scene.get_mut("bodies")?.as_table_mut());
        for (name, body) in bodies.into_iter().flatten() {
            let shapes = body.get_mut("shape").and_then(Value::as_array_mut);
            for (position, shape) in shapes.into_iter().flatten().enumerate() {
                let key = format!("scene.bodies.{name}.shape.{}", position + 1);
                fill_in(shape, &key, &folder, &mut files, &mut mistakes);
            }
        }
        let faults = self.table.get_mut("faults").and_then(Value::as_array_mut);
        for (position, fault) in faults.into_iter().flatten().enumerate() {
            let name = fault_name(fault.get("name").and_then(Value::as_str), position);
            fill_in(fault, &format!("faults.{name}"), &folder, &mut files, &mut mistakes);
        }
        self.files.extend(files);
        if mistakes.is_empty() {
            return Ok(());
        }
        let mistakes = mistakes
            .into_iter()
            .map(|(key, reason)| self.mistake(&key, reason))
            .collect();
        Err(self.error(mistakes))
    }
}

/// Reads one section; a mistake gets the key that it is about.
pub(super) fn typed<T: DeserializeOwned>(source: &Source, key: &str, value: Value) -> Result<T, Mistake> {
    serde_path_to_error::deserialize(value).map_err(|error| {
        let path = error.path().to_string();
        let key = match (key, path.as_str()) {
            (key, ".") => key.to_owned(),
            ("", path) => path.to_owned(),
            (key, path) => format!("{key}.{path}"),
        };
        source.mistake(&key, error.into_inner().message())
    })
}

/// An entry of a list of tables, by its name or its number, from 1.
fn entry_of<'a>(list: &'a mut [Value], name: Option<&str>) -> Result<&'a mut Table, String> {
    let names: Vec<String> = list
        .iter()
        .enumerate()
        .map(|(position, item)| fault_name(item.get("name").and_then(Value::as_str), position))
        .collect();
    let wanted = name.unwrap_or_default();
    let at = names.iter().position(|own| own == wanted);
    let number = || wanted.parse::<usize>().ok()?.checked_sub(1);
    let at = at.or_else(number);
    let found = at.and_then(|at| list.get_mut(at)).and_then(Value::as_table_mut);
    found.ok_or_else(|| {
        let known: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
        let known = known.join(", ");
        format!("the list has no entry `{wanted}` with keys (given with --set); there is {known}, or a number from 1")
    })
}

fn fill_in(
    value: &mut Value,
    key: &str,
    folder: &Path,
    files: &mut Vec<PathBuf>,
    mistakes: &mut Vec<(String, String)>,
) {
    let Value::Table(table) = value else { return };
    if let (1, Some(Value::String(name))) = (table.len(), table.get("file")) {
        let path = folder.join(name);
        match contents(&path) {
            Ok(filled) => {
                *value = filled;
                files.push(path);
            }
            Err(reason) => mistakes.push((key.to_owned(), format!("the file `{}` {reason}", path.display()))),
        }
        return;
    }
    for (name, inner) in table.iter_mut() {
        fill_in(inner, &format!("{key}.{name}"), folder, files, mistakes);
    }
}

/// No file that belongs to a scenario is larger, bytes.
const FILE_MAX: u64 = 64 << 20;

/// The text of a file. A device or a pipe might never end, and is refused.
fn bounded(path: &Path) -> std::io::Result<String> {
    let about = std::fs::metadata(path)?;
    if !about.is_file() {
        return Err(std::io::Error::other("it is not a file"));
    }
    if about.len() > FILE_MAX {
        return Err(std::io::Error::other(format!(
            "it has more than {} MiB",
            FILE_MAX >> 20
        )));
    }
    std::fs::read_to_string(path)
}

fn contents(path: &Path) -> Result<Value, String> {
    let text = bounded(path).map_err(|error| format!("cannot be read: {error}"))?;
    if path.extension().is_some_and(|extension| extension == "toml") {
        let table = text.parse::<Table>().map_err(|error| {
            let line = error
                .span()
                .map(|span| format!("line {}: ", line_of(&text, &span)))
                .unwrap_or_default();
            format!("is not TOML: {line}{}", error.message())
        })?;
        return Ok(Value::Table(table));
    }
    Ok(Value::String(text))
}

fn line_of(text: &str, span: &Range<usize>) -> usize {
    text.as_bytes()[..span.start.min(text.len())]
        .iter()
        .filter(|&&byte| byte == b'\n')
        .count()
        + 1
}
