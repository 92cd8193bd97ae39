//! The places where a scenario names files: programs, and files whose content replaces the reference.

use toml::{Table, Value};

/// A place in a scenario that names files.
pub enum Named<'a> {
    /// `{ file = "…" }`: replaced by the file's content.
    File(&'a mut String),
    /// The table of a program.
    Run(&'a mut Table),
}

/// Calls `visit` with the key and the content of every place in the scenario `table` that names files.
pub fn each_named(table: &mut Table, visit: &mut dyn FnMut(&str, Named<'_>)) {
    for section in ["participants", "assessment", "faults"] {
        if let Some(value) = table.get_mut(section) {
            each_in(section, value, visit);
        }
    }
}

/// As [`each_named`], for the value at `key`.
pub fn each_in(key: &str, value: &mut Value, visit: &mut dyn FnMut(&str, Named<'_>)) {
    let last = key.rsplit('.').next().unwrap_or_default();
    match value {
        Value::Table(table) if ["run", "substitute"].contains(&last) => visit(key, Named::Run(table)),
        Value::Table(table) => {
            if let (1, Some(Value::String(file))) = (table.len(), table.get_mut("file")) {
                return visit(key, Named::File(file));
            }
            for (name, below) in table.iter_mut() {
                each_in(&format!("{key}.{name}"), below, visit);
            }
        }
        Value::Array(values) => {
            for (at, below) in values.iter_mut().enumerate() {
                each_in(&format!("{key}.{}", at + 1), below, visit);
            }
        }
        _ => {}
    }
}
