//! Inclusion of files: `{ file = "…" }` is replaced by the content of the file.

use std::path::{Path, PathBuf};

use toml::{Table, Value};

use super::origin::Origin;
use super::run::RunSpec;
use super::scenario_spec::ScenarioSpec;
use super::text::line_of;
use crate::scenario::error::{Mistake, ScenarioError};
use crate::scenario::names::{entry_name, fault_name};

/// Includes files in a scenario's table; relative paths are relative to `folder`.
pub(super) fn include_files(table: &mut Table, folder: &Path, origin: &mut Origin) -> Result<(), ScenarioError> {
    let mut mistakes = Vec::new();
    let mut files = Vec::new();
    for section in ["participants", "assessment", "scene"] {
        if let Some(value) = table.get_mut(section) {
            include(value, section, folder, &mut files, &mut mistakes);
        }
    }
    let bodies = table
        .get_mut("scene")
        .and_then(|scene| scene.get_mut("bodies")?.as_table_mut());
    for (name, body) in bodies.into_iter().flatten() {
        let shapes = body.get_mut("shape").and_then(Value::as_array_mut);
        for (position, shape) in shapes.into_iter().flatten().enumerate() {
            let key = format!("scene.bodies.{name}.shape.{}", position + 1);
            include(shape, &key, folder, &mut files, &mut mistakes);
        }
    }
    let faults = table.get_mut("faults").and_then(Value::as_array_mut);
    for (position, fault) in faults.into_iter().flatten().enumerate() {
        let name = entry_name(fault, position);
        include(fault, &format!("faults.{name}"), folder, &mut files, &mut mistakes);
    }
    origin.files.extend(files);
    if mistakes.is_empty() {
        return Ok(());
    }
    let mistakes = mistakes.into_iter();
    let mistakes: Vec<Mistake> = mistakes.map(|(key, reason)| origin.mistake(&key, reason)).collect();
    Err(origin.error(mistakes))
}

impl ScenarioSpec {
    /// Includes files in the fields of a scenario that may refer to files.
    pub(in crate::scenario) fn include_files(&mut self, folder: &Path) -> Result<(), ScenarioError> {
        let mut tables: Vec<(String, &mut Table)> = Vec::new();
        for (name, own) in &mut self.participants {
            let key = format!("participants.{name}");
            tables.extend(fmu_tables(&mut own.run, &key));
            tables.push((format!("{key}.parameters"), &mut own.parameters));
        }
        for (position, own) in self.faults.iter_mut().enumerate() {
            let key = format!("faults.{}", fault_name(own.name.as_deref(), position));
            tables.extend(own.run.iter_mut().flat_map(|run| fmu_tables(run, &key)));
            tables.extend(own.parameters.iter_mut().map(|own| (format!("{key}.parameters"), own)));
        }
        tables.extend(self.assessment.iter_mut().map(|own| ("assessment".to_owned(), own)));
        let (mut files, mut wrong) = (Vec::new(), Vec::new());
        for (key, table) in tables {
            let mut value = Value::Table(std::mem::take(table));
            include(&mut value, &key, folder, &mut files, &mut wrong);
            match value {
                Value::Table(filled) => *table = filled,
                _ => {
                    let reason = "the file has text where keys are needed: name a file in TOML";
                    wrong.push((key, reason.to_owned()));
                }
            }
        }
        self.origin.files.extend(files);
        let wrong = wrong.into_iter();
        let mut mistakes: Vec<Mistake> = wrong.map(|(key, reason)| self.origin.mistake(&key, reason)).collect();
        // The shapes of a scene are in lists.
        if let Some(scene) = self.scene.take() {
            let mut scene_table = Table::from_iter([("scene".to_owned(), Value::Table(scene))]);
            if let Err(error) = include_files(&mut scene_table, folder, &mut self.origin) {
                mistakes.extend(error.mistakes);
            }
            self.scene = match scene_table.remove("scene") {
                Some(Value::Table(scene)) => Some(scene),
                _ => None,
            };
        }
        if mistakes.is_empty() {
            Ok(())
        } else {
            Err(self.origin.error(mistakes))
        }
    }
}

/// The tables in an FMU's `run`, which is below `key`.
fn fmu_tables<'a>(run: &'a mut RunSpec, key: &str) -> Vec<(String, &'a mut Table)> {
    let given = run.fmu_options_mut().into_iter();
    let tables = given.filter_map(|(name, value)| Some((name, value.as_mut()?.as_table_mut()?)));
    tables
        .map(|(name, table)| (format!("{key}.run.{name}"), table))
        .collect()
}

fn include(
    value: &mut Value,
    key: &str,
    folder: &Path,
    files: &mut Vec<PathBuf>,
    mistakes: &mut Vec<(String, String)>,
) {
    let Value::Table(table) = value else { return };
    if let (1, Some(Value::String(name))) = (table.len(), table.get("file")) {
        let path = folder.join(name);
        match read_value(&path) {
            Ok(filled) => {
                *value = filled;
                files.push(path);
            }
            Err(reason) => mistakes.push((key.to_owned(), format!("the file `{}` {reason}", path.display()))),
        }
        return;
    }
    for (name, inner) in table.iter_mut() {
        include(inner, &format!("{key}.{name}"), folder, files, mistakes);
    }
}

/// The largest file of a scenario, bytes.
const FILE_MAX: u64 = 64 << 20;

/// The text of a file. A device or a pipe might never end, and is refused.
fn read_bounded(path: &Path) -> std::io::Result<String> {
    let metadata = std::fs::metadata(path)?;
    if !metadata.is_file() {
        return Err(std::io::Error::other("it is not a file"));
    }
    if metadata.len() > FILE_MAX {
        return Err(std::io::Error::other(format!(
            "it has more than {} MiB",
            FILE_MAX >> 20
        )));
    }
    std::fs::read_to_string(path)
}

fn read_value(path: &Path) -> Result<Value, String> {
    let text = read_bounded(path).map_err(|error| format!("cannot be read: {error}"))?;
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
