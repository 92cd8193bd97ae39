//! The places where a scenario names files: programs, and files whose content replaces the reference.

use toml::{Table, Value};

/// A place in a scenario that names files.
pub enum FileReference<'a> {
    /// `{ file = "…" }`: replaced by the file's content.
    File(&'a mut String),
    /// The table of a program.
    Run(&'a mut Table),
}

/// Calls `visit` with the key and the content of every place in the scenario `table` that names files.
pub fn visit_file_references(table: &mut Table, visit: &mut dyn FnMut(&str, FileReference<'_>)) {
    for section in ["participants", "assessment", "faults"] {
        if let Some(value) = table.get_mut(section) {
            visit_file_references_at(section, value, visit);
        }
    }
}

/// As [`visit_file_references`], for the value at `key`.
pub fn visit_file_references_at(key: &str, value: &mut Value, visit: &mut dyn FnMut(&str, FileReference<'_>)) {
    let last = key.rsplit('.').next().unwrap_or_default();
    match value {
        Value::Table(table) if ["run", "substitute"].contains(&last) => visit(key, FileReference::Run(table)),
        Value::Table(table) => {
            if let (1, Some(Value::String(file))) = (table.len(), table.get_mut("file")) {
                return visit(key, FileReference::File(file));
            }
            for (name, below) in table.iter_mut() {
                visit_file_references_at(&format!("{key}.{name}"), below, visit);
            }
        }
        Value::Array(values) => {
            for (at, below) in values.iter_mut().enumerate() {
                visit_file_references_at(&format!("{key}.{}", at + 1), below, visit);
            }
        }
        _ => {}
    }
}
