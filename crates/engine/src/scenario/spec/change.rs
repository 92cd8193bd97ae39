//! Changes by key paths: `--set`, `--fault`, and the same from code.

use toml::{Table, Value};

use super::fault_text;
use super::origin::Origin;
use super::scenario_spec::FOLDER;
use crate::scenario::error::Mistake;
use crate::scenario::names::{self, entry_name, fault_name};
use crate::scenario::value::{checked_value, keep_decimal};

/// How a change was made: the end of a message about it.
pub(super) const VARIED: &str = "varied by the campaign";
pub(super) const IN_CODE: &str = "set in code";

fn refuse(key: &str, reason: String) -> Mistake {
    Mistake {
        line: None,
        key: key.to_owned(),
        reason,
    }
}

/// Makes a change in a scenario's table: `key.path=value` or `faults+=entry`. `how` is the origin of the change.
pub(super) fn change(table: &mut Table, origin: &mut Origin, one: &str, how: &'static str) -> Result<(), Mistake> {
    if let Some(entry) = one.strip_prefix("faults+=") {
        return add_fault(table, origin, entry, how);
    }
    let Some((key, text)) = one.split_once('=') else {
        let reason = "--set takes KEY.PATH=VALUE, such as connections.measured.delay=10ms";
        return Err(refuse(one, reason.into()));
    };
    let key = key.trim();
    let value = checked_value(text.trim()).map_err(|reason| refuse(key, format!("{reason} ({how})")))?;
    set(table, origin, key, value, how)
}

/// The most parts of a key. What reads a scenario follows its tables recursively.
const PARTS_MAX: usize = 64;

/// Sets `key` to `value`; `how` is the origin of the change.
pub(super) fn set(
    mut table: &mut Table,
    origin: &mut Origin,
    key: &str,
    mut value: Value,
    how: &'static str,
) -> Result<(), Mistake> {
    if key == FOLDER {
        let reason = format!("is where the file's own relative paths lead: it is changed in the file alone ({how})");
        return Err(refuse(key, reason));
    }
    let parts: Vec<&str> = key.split('.').collect();
    let (last, above) = parts.split_last().expect("split gives at least one part");
    if parts.iter().any(|part| part.is_empty()) {
        return Err(refuse(key, "a key has no empty parts".into()));
    }
    if parts.len() > PARTS_MAX {
        let shown: String = key.chars().take(60).collect();
        let reason = format!(
            "a key has at most {PARTS_MAX} parts, and this one has {} ({how})",
            parts.len()
        );
        return Err(refuse(&format!("{shown}…"), reason));
    }
    // Mistakes call an entry of a list by its name, so the change is known by it too, however the entry was called.
    let mut named: Vec<String> = parts.iter().map(|part| (*part).to_owned()).collect();
    let mut segments = above.iter().enumerate();
    while let Some((depth, part)) = segments.next() {
        let known: Vec<String> = table.keys().map(|name| format!("`{name}`")).collect();
        // Names of participants and connections must exist; keys below may be defaults that the file leaves out. A guard, a
        // measure, an entry of the report or the playback, or an entry of the recording may be new.
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
            return Err(refuse(
                key,
                format!("there is no `{part}` in {there} ({how}); there is {}", known.join(", ")),
            ));
        }
        let entry = table
            .entry((*part).to_owned())
            .or_insert_with(|| Value::Table(Table::new()));
        let kind = entry.type_str();
        table = match entry {
            Value::Table(inner) => inner,
            Value::Array(list) if list.iter().any(Value::is_table) => {
                let part = segments.next();
                let called = part.map(|(_, part)| *part);
                let (name, entry) = find_entry(list, called, how).map_err(|reason| refuse(key, reason))?;
                if let Some((depth, _)) = part {
                    named[depth] = name;
                }
                entry
            }
            _ => {
                let reason = format!("`{part}` is {kind} and has no keys ({how})");
                return Err(refuse(key, reason));
            }
        };
    }
    if let Some(before) = table.get(*last) {
        keep_decimal(&mut value, before);
    }
    table.insert((*last).to_owned(), value);
    origin.record_change(named.join("."), how);
    Ok(())
}

fn add_fault(table: &mut Table, origin: &mut Origin, text: &str, how: &'static str) -> Result<(), Mistake> {
    let refuse = |reason: String| refuse("faults", format!("{reason} ({how})"));
    let entry = fault_text::table(text).map_err(refuse)?;
    let position = table.get("faults").and_then(Value::as_array).map_or(0, Vec::len);
    let name = fault_name(entry.get("name").and_then(Value::as_str), position);
    fault_text::append(table, entry).map_err(refuse)?;
    origin.record_change(format!("faults.{name}"), how);
    Ok(())
}

/// An entry of a list of tables, by its name or its number, from 1; with its name.
fn find_entry<'a>(list: &'a mut [Value], name: Option<&str>, how: &str) -> Result<(String, &'a mut Table), String> {
    let wanted = name.unwrap_or_default();
    let names: Vec<String> = (0..).zip(&*list).map(|(at, item)| entry_name(item, at)).collect();
    let found = names::find_entry(list, wanted);
    let found = found.and_then(|(at, name)| Some((name, list.get_mut(at)?.as_table_mut()?)));
    found.ok_or_else(|| {
        let known: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
        let known = known.join(", ");
        format!("the list has no entry `{wanted}` with keys ({how}); there is {known}, or a number from 1")
    })
}
