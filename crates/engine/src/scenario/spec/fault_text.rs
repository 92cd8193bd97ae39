//! A fault on the command line: `at=12s,until=14s,input=controller.measured,field=q[3],kind=bias,value=0.2deg`.

use std::str::FromStr;

use toml::{Table, Value};

use super::fault::FaultSpec;
use crate::scenario::value::toml_reason;

/// Parses `text` into an entry of `[[faults]]`. Values are read as TOML if they are valid TOML, otherwise as text; commas inside
/// brackets, braces and quotes belong to the value.
pub(super) fn table(text: &str) -> Result<Table, String> {
    let mut entry = Table::new();
    for part in parts(text) {
        let Some((key, value)) = part.split_once('=') else {
            return Err(format!(
                "`{}` is not KEY=VALUE; write for example at=12s,input=controller.measured,field=q[3],kind=bias,value=0.2deg",
                part.trim()
            ));
        };
        let (key, value) = (key.trim(), value.trim());
        if key.is_empty() {
            return Err(format!("`{}` has no key", part.trim()));
        }
        if entry.insert(key.to_owned(), crate::scenario::value(value)).is_some() {
            return Err(format!("`{key}` is given twice"));
        }
    }
    Ok(entry)
}

impl FromStr for FaultSpec {
    type Err = String;

    fn from_str(text: &str) -> Result<FaultSpec, String> {
        serde_path_to_error::deserialize(Value::Table(table(text)?)).map_err(|error| {
            let path = error.path().to_string();
            match (path.as_str(), toml_reason(&error.into_inner())) {
                (".", reason) => reason,
                (key, reason) => format!("{key}: {reason}"),
            }
        })
    }
}

/// The parts between commas that are in no brackets, braces or quotes.
fn parts(text: &str) -> Vec<&str> {
    let (mut parts, mut start, mut depth, mut quote) = (Vec::new(), 0, 0_i32, None);
    for (at, c) in text.char_indices() {
        match (quote, c) {
            (Some(open), c) if open == c => quote = None,
            (Some(_), _) => {}
            (None, '"' | '\'') => quote = Some(c),
            (None, '[' | '{') => depth += 1,
            (None, ']' | '}') => depth -= 1,
            (None, ',') if depth <= 0 => {
                parts.push(&text[start..at]);
                start = at + 1;
            }
            _ => {}
        }
    }
    parts.push(&text[start..]);
    parts
}

/// Appends the entry to a scenario's list of faults, in the form that `--set` would write.
pub(super) fn append(table: &mut Table, entry: Table) -> Result<(), String> {
    let list = table.entry("faults").or_insert_with(|| Value::Array(Vec::new()));
    match list {
        Value::Array(list) => {
            list.push(Value::Table(entry));
            Ok(())
        }
        other => Err(format!(
            "`faults` is {}, not a list: write [[faults]]",
            other.type_str()
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fault_text_keeps_commas_inside_values() {
        let text = "at=12s, field=q[3],value=[1, 2] deg,run={ exe = \"./a,b\", args = ['c,d'] },drop=0.3";
        let entry = table(text).unwrap();
        assert_eq!(entry["at"], Value::String("12s".into()));
        assert_eq!(entry["field"], Value::String("q[3]".into()));
        assert_eq!(entry["value"], Value::String("[1, 2] deg".into()));
        assert_eq!(entry["run"]["exe"], Value::String("./a,b".into()));
        assert_eq!(entry["run"]["args"][0], Value::String("c,d".into()));
        assert_eq!(entry["drop"], Value::Float(0.3));
        for (bad, part) in [
            ("at", "KEY=VALUE"),
            ("at=1s,at=2s", "twice"),
            ("=1", "no key"),
            ("", "KEY=VALUE"),
        ] {
            assert!(table(bad).unwrap_err().contains(part), "{bad}");
        }
    }
}
