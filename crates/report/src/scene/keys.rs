//! The keys of a table of a scene.

use toml::{Table, Value};

use crate::view::{Mistake, below};

/// A table in which only known keys are allowed. Written by hand: with some dozen tables, derived readers would be the
/// larger part of the code that a scene adds to a program.
pub(super) struct Keys<'a>(&'a Table);

/// Adds the key of a value to a mistake.
pub(super) fn at(key: &str) -> impl Fn(String) -> Mistake {
    move |reason| Mistake::new(key.to_owned(), reason)
}

impl Mistake {
    /// The same mistake, with the key `above` as a prefix of its key.
    pub(super) fn with_prefix(self, above: &str) -> Mistake {
        Mistake::new(below(above, &self.key), self.reason)
    }
}

impl<'a> Keys<'a> {
    /// Rejects a key that is not in `known`.
    pub(super) fn of(table: &'a Table, known: &[&str]) -> Result<Keys<'a>, Mistake> {
        match table.keys().find(|key| !known.contains(&key.as_str())) {
            None => Ok(Keys(table)),
            Some(key) => Err(at(key)(format!("there is no such key; there is {}", known.join(", ")))),
        }
    }

    pub(super) fn of_value(value: &'a Value, known: &[&str]) -> Result<Keys<'a>, Mistake> {
        let table = value.as_table();
        Keys::of(
            table.ok_or_else(|| at("")(format!("`{value}` is not a table: its keys are {}", known.join(", "))))?,
            known,
        )
    }

    pub(super) fn text(&self, key: &str) -> Result<Option<&'a str>, Mistake> {
        let refuse = |value: &Value| at(key)(format!("`{value}` is not a text: write it in quotes"));
        self.0
            .get(key)
            .map(|value| value.as_str().ok_or_else(|| refuse(value)))
            .transpose()
    }

    pub(super) fn required_text(&self, key: &str) -> Result<&'a str, Mistake> {
        self.text(key)?.ok_or_else(|| at("")(format!("`{key}` is missing")))
    }

    pub(super) fn table(&self, key: &str) -> Result<Option<&'a Table>, Mistake> {
        let refuse = |value: &Value| at(key)(format!("`{value}` is not a table"));
        self.0
            .get(key)
            .map(|value| value.as_table().ok_or_else(|| refuse(value)))
            .transpose()
    }

    pub(super) fn list(&self, key: &str) -> Result<&'a [Value], Mistake> {
        match self.0.get(key) {
            None => Ok(&[]),
            Some(Value::Array(items)) => Ok(items),
            Some(value) => Err(at(key)(format!("`{value}` is not a list"))),
        }
    }

    /// The result of `read` for a value.
    pub(super) fn value<T>(&self, key: &str, read: impl Fn(&Value) -> Result<T, String>) -> Result<Option<T>, Mistake> {
        self.0.get(key).map(|value| read(value).map_err(at(key))).transpose()
    }
}
