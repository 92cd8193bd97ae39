//! The text of a scenario: values, the lines they stand on, files put in place of their names, and overrides.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use toml::de::{DeTable, DeValue};
use toml::{Table, Value};

use super::error::{Mistake, ScenarioError};
use super::faults;
use crate::Catalogue;

/// A scenario as it was read, before anything is understood.
pub(super) struct Source {
    pub(super) catalogue: Arc<Catalogue>,
    file: PathBuf,
    text: String,
    pub(super) table: Table,
    /// The keys that were given on the command line, with the option.
    overridden: Vec<(String, &'static str)>,
    /// The files whose contents stand in the table, for the run's record.
    pub(super) files: Vec<PathBuf>,
}

impl Source {
    /// Reads `file`, puts files in place of `{ file = "…" }`, and applies `overrides` of the form `key.path=value` or
    /// `faults+=entry`.
    pub(super) fn read(catalogue: &Arc<Catalogue>, file: &Path, overrides: &[String]) -> Result<Source, ScenarioError> {
        let text = std::fs::read_to_string(file).map_err(|error| ScenarioError {
            file: file.to_owned(),
            mistakes: vec![Mistake {
                line: None,
                key: String::new(),
                reason: format!("cannot be read: {error}"),
            }],
        })?;
        Source::of_text(catalogue, file, text, overrides)
    }

    /// What `file` would be if `text` stood in it.
    pub(super) fn of_text(
        catalogue: &Arc<Catalogue>,
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
            catalogue: catalogue.clone(),
            file: file.to_owned(),
            text,
            table,
            overridden: Vec::new(),
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

    /// The folder that relative names are relative to.
    pub(super) fn folder(&self) -> &Path {
        self.file.parent().unwrap_or(Path::new(""))
    }

    /// An error about `key`, with the line it stands on.
    pub(super) fn mistake(&self, key: &str, reason: impl Into<String>) -> Mistake {
        let mut reason = reason.into();
        let given = |(given, _): &&(String, _)| key == given || key.starts_with(&format!("{given}."));
        if let Some((_, option)) = self.overridden.iter().find(given) {
            reason += &format!(" (given with {option})");
            return Mistake {
                line: None,
                key: key.to_owned(),
                reason,
            };
        }
        Mistake {
            line: self.line(key),
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

    /// The line of `key`, or of the nearest table around it.
    fn line(&self, key: &str) -> Option<usize> {
        let document = DeTable::parse(&self.text).ok()?;
        let mut table = document.get_ref();
        let mut span: Option<Range<usize>> = None;
        let mut parts = key.split('.').filter(|part| !part.is_empty());
        while let Some(part) = parts.next() {
            let Some((name, value)) = table.iter().find(|(name, _)| name.get_ref() == part) else {
                break;
            };
            span = Some(name.span());
            match value.get_ref() {
                DeValue::Table(inner) => table = inner,
                DeValue::Array(items) => {
                    // A list of tables: the next part names one of them.
                    let wanted = parts.next();
                    let named = items.iter().enumerate().find_map(|(position, item)| {
                        let inner = item.get_ref().as_table()?;
                        let name = inner.iter().find(|(name, _)| name.get_ref() == "name");
                        let name = name.and_then(|(_, value)| value.get_ref().as_str());
                        (Some(fault_name(name, position).as_str()) == wanted).then_some((item.span(), inner))
                    });
                    let Some((place, inner)) = named else { break };
                    span = Some(place);
                    table = inner;
                }
                _ => break,
            }
        }
        span.map(|span| line_of(&self.text, &span))
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
        let value = value(text);
        let parts: Vec<&str> = key.split('.').collect();
        let (last, above) = parts.split_last().expect("split gives at least one part");
        if parts.iter().any(|part| part.is_empty()) {
            return Err(fail(key, "a key has no empty parts".into()));
        }
        let mut table = &mut self.table;
        for (depth, part) in above.iter().enumerate() {
            let known: Vec<String> = table.keys().map(|name| format!("`{name}`")).collect();
            // Names of participants and connections must exist; what is below may be a default that the file leaves out. A
            // guard may be new.
            if depth < 2 && above[0] != "guards" && !table.contains_key(*part) {
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
            table = match entry {
                Value::Table(inner) => inner,
                other => {
                    let reason = format!("`{part}` is {} and has no keys (given with --set)", other.type_str());
                    return Err(fail(key, reason));
                }
            };
        }
        table.insert((*last).to_owned(), value);
        self.overridden.push((key.to_owned(), "--set"));
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
        let entry = faults::table(text).map_err(refuse)?;
        let position = self.table.get("faults").and_then(Value::as_array).map_or(0, Vec::len);
        let name = fault_name(entry.get("name").and_then(Value::as_str), position);
        faults::append(&mut self.table, entry).map_err(refuse)?;
        self.overridden.push((format!("faults.{name}"), "--fault"));
        Ok(())
    }

    fn fill_in_files(&mut self) -> Result<(), ScenarioError> {
        let folder = self.file.parent().map(Path::to_owned).unwrap_or_default();
        let mut mistakes = Vec::new();
        let mut files = Vec::new();
        for section in ["participants", "assessment"] {
            if let Some(value) = self.table.get_mut(section) {
                fill_in(value, section, &folder, &mut files, &mut mistakes);
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

/// What a fault is called: its own name, or its number in the list, from 1.
pub fn fault_name(own: Option<&str>, position: usize) -> String {
    own.map_or_else(|| format!("fault-{}", position + 1), str::to_owned)
}

/// What reads as TOML is taken as TOML; anything else is text, so that quotes need not survive the shell.
pub(super) fn value(text: &str) -> Value {
    let read = format!("x = {text}").parse::<Table>().ok();
    // More than one key: the text had a line of its own.
    let one = read
        .filter(|table| table.len() == 1)
        .and_then(|mut table| table.remove("x"));
    one.unwrap_or_else(|| Value::String(text.to_owned()))
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
