//! Names: of a scenario's participants or connections, with lookup by hash; of faults; of the program itself.

use std::collections::HashMap;

use toml::Value;

/// The program's own name where participants are named.
pub const ORCHESTRATOR: &str = "orchestrator";

/// Names with their numbers.
#[derive(Debug, Clone, Default)]
pub(super) struct Names {
    all: Vec<String>,
    numbers: HashMap<String, usize>,
}

/// The most known names in a message.
const SHOWN_MAX: usize = 24;

impl Names {
    pub(super) fn new(all: impl IntoIterator<Item = String>) -> Names {
        let all: Vec<String> = all.into_iter().collect();
        let numbers = all.iter().enumerate().map(|(number, name)| (name.clone(), number));
        Names {
            numbers: numbers.collect(),
            all,
        }
    }

    pub(super) fn number(&self, name: &str) -> Option<usize> {
        self.numbers.get(name).copied()
    }

    pub(super) fn contains(&self, name: &str) -> bool {
        self.numbers.contains_key(name)
    }

    /// The message that there is no `what` called `name`, with the names that exist.
    pub(super) fn unknown(&self, what: &str, name: &str) -> String {
        unknown(what, name, self.all.iter())
    }
}

/// The message that there is no `what` called `name`, with the names that exist: only the first ones if there are many.
pub(super) fn unknown<'a>(what: &str, name: &str, known: impl ExactSizeIterator<Item = &'a String>) -> String {
    let count = known.len();
    let shown: Vec<String> = known.take(SHOWN_MAX).map(|name| format!("`{name}`")).collect();
    let mut list = if shown.is_empty() {
        "none".to_owned()
    } else {
        shown.join(", ")
    };
    if count > SHOWN_MAX {
        list += &format!(" and {} more", count - SHOWN_MAX);
    }
    format!("there is no {what} `{name}`; there is {list}")
}

/// The name of a fault: its own, or one made of its number in the list, from 1.
pub fn fault_name(own: Option<&str>, position: usize) -> String {
    own.map_or_else(|| format!("fault-{}", position + 1), str::to_owned)
}

/// The position and the name of the table in `list` that a key addresses as `part`: by its name, else by its number, from 1.
pub fn find_entry(list: &[Value], part: &str) -> Option<(usize, String)> {
    let position = list
        .iter()
        .enumerate()
        .position(|(at, item)| entry_name(item, at) == part);
    let position = position.or_else(|| part.parse::<usize>().ok()?.checked_sub(1))?;
    let item = list.get(position).filter(|item| item.is_table())?;
    Some((position, entry_name(item, position)))
}

/// The name of the entry `item` at `position` of a list.
pub fn entry_name(item: &Value, position: usize) -> String {
    fault_name(item.get("name").and_then(Value::as_str), position)
}
