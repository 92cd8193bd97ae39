//! Parameters as foreign code reads them: one by one, by dotted key.

use std::cell::{Cell, RefCell};
use std::collections::BTreeSet;

use lockstep::participant::ParameterError;
use lockstep::units;
use toml::{Table, Value};

/// Takes the place of a parameter's key in a rejection: the table or the library itself cannot be used.
pub const NO_PARTICIPANT: &str = "(participant)";

/// The parameters of a participant, and which of them have been read.
#[derive(Debug)]
pub struct Parameters {
    table: Table,
    read_keys: RefCell<BTreeSet<String>>,
    /// Whether the participant reads the whole text itself.
    whole: Cell<bool>,
}

/// The result of a lookup: an error, `None` where the value is optional, or the value.
pub type Found<T> = Result<Option<T>, ParameterError>;

impl Parameters {
    /// None of `table` has been read yet.
    pub fn new(table: Table) -> Parameters {
        Parameters {
            table,
            read_keys: RefCell::default(),
            whole: Cell::new(false),
        }
    }

    /// All parameters as text. A participant that reads it must check for misspelt keys itself.
    pub fn text(&self) -> String {
        self.table.to_string()
    }

    /// From now on no key is reported as unknown.
    pub fn all_are_read(&self) {
        self.whole.set(true);
    }

    /// A value as the scenario has it, by its dotted key.
    ///
    /// # Errors
    /// When a required one is missing.
    pub fn get(&self, key: &str, required: bool) -> Found<&Value> {
        self.read_keys.borrow_mut().insert(key.to_owned());
        let mut parts = key.split('.');
        let first = parts.next().and_then(|first| self.table.get(first));
        let found = parts.fold(first, |value, part| value?.as_table()?.get(part));
        match found {
            None if required => Err(ParameterError::new(key, "missing: the participant needs it")),
            found => Ok(found),
        }
    }

    /// Reads `count` numbers in `unit`; 0 stands for one number without brackets.
    ///
    /// # Errors
    /// When a required one is missing, has the wrong dimension or count, or is not finite.
    pub fn numbers(&self, key: &str, unit: &str, required: bool, count: usize) -> Found<Vec<f64>> {
        let Some(value) = self.get(key, required)? else {
            return Ok(None);
        };
        let plain = unit.is_empty() || unit == "1";
        let refuse = |reason: String| Err(ParameterError::new(key, reason));
        let wanted = match (count, plain) {
            (0, true) => "a number is needed".to_owned(),
            (0, false) => format!("a number with a unit is needed, such as \"1 {unit}\""),
            (_, true) => format!("{count} numbers in brackets are needed"),
            (_, false) => format!("{count} numbers in brackets with a unit are needed, such as \"[0, 1] {unit}\""),
        };
        let number = |value: &Value| match value {
            Value::Integer(whole) => Some(*whole as f64),
            Value::Float(number) => Some(*number),
            _ => None,
        };
        let (found, listed) = match value {
            Value::String(text) if !plain => match units::convert(text, unit) {
                Ok(found) => found,
                Err(error) => return refuse(error.to_string()),
            },
            Value::Array(items) if plain => match items.iter().map(number).collect::<Option<Vec<f64>>>() {
                Some(found) => (found, true),
                None => return refuse(format!("{value}: {wanted}")),
            },
            single if plain && number(single).is_some() => (number(single).into_iter().collect(), false),
            other => return refuse(format!("{other}: {wanted}")),
        };
        let fits = if count == 0 {
            !listed && found.len() == 1
        } else {
            listed && found.len() == count
        };
        if !fits {
            return refuse(format!("{value}: {wanted}"));
        }
        if let Some(number) = found.iter().find(|number| !number.is_finite()) {
            return refuse(format!("{number} is not finite"));
        }
        Ok(Some(found))
    }

    /// Reads an integer.
    ///
    /// # Errors
    /// When a required one is missing, or the value is of another type.
    pub fn integer(&self, key: &str, required: bool) -> Found<i64> {
        let Some(value) = self.get(key, required)? else {
            return Ok(None);
        };
        let refused = || ParameterError::new(key, format!("{value}: a whole number is needed"));
        value.as_integer().ok_or_else(refused).map(Some)
    }

    /// Reads a Boolean.
    ///
    /// # Errors
    /// As for [`Parameters::integer`].
    pub fn flag(&self, key: &str, required: bool) -> Found<bool> {
        let Some(value) = self.get(key, required)? else {
            return Ok(None);
        };
        let refused = || ParameterError::new(key, format!("{value}: true or false is needed"));
        value.as_bool().ok_or_else(refused).map(Some)
    }

    /// Reads a text.
    ///
    /// # Errors
    /// As for [`Parameters::integer`].
    pub fn string(&self, key: &str, required: bool) -> Found<&str> {
        let Some(value) = self.get(key, required)? else {
            return Ok(None);
        };
        let refused = || ParameterError::new(key, format!("{value}: a text is needed"));
        value.as_str().ok_or_else(refused).map(Some)
    }

    /// A parameter that has not been read: most likely a misspelt one.
    pub fn unknown(&self) -> Option<ParameterError> {
        if self.whole.get() {
            return None;
        }
        let read_keys = self.read_keys.borrow();
        let mut key = String::new();
        find_unread_key(&self.table, &read_keys, &mut key).then(|| {
            let known: Vec<String> = read_keys.iter().map(|key| format!("`{key}`")).collect();
            let known = if known.is_empty() {
                "it has no parameters".to_owned()
            } else {
                format!("there is {}", known.join(", "))
            };
            ParameterError::new(key, format!("the participant knows no such parameter; {known}"))
        })
    }
}

/// Searches for a key of `table` below `key` that has not been read, and leaves it in `key`.
fn find_unread_key(table: &Table, read_keys: &BTreeSet<String>, key: &mut String) -> bool {
    for (name, value) in table {
        let before = key.len();
        if before > 0 {
            key.push('.');
        }
        key.push_str(name);
        let inner = format!("{key}.");
        let below = read_keys.iter().any(|one| one.starts_with(&inner));
        let known = read_keys.contains(key.as_str());
        let strange = match value {
            Value::Table(table) if below => find_unread_key(table, read_keys, key),
            _ => !known,
        };
        if strange {
            return true;
        }
        key.truncate(before);
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(text: &str) -> Parameters {
        Parameters::new(text.parse().unwrap())
    }

    #[test]
    fn parameters_are_read_with_their_units() {
        let all =
            of("k = 3\nmass = '2000 g'\nat = '[1, 2] mm'\nlist = [1, 2.5]\n[gains]\nn = -4\non = true\nname = 'x'");
        assert_eq!(all.numbers("k", "", true, 0), Ok(Some(vec![3.0])));
        assert_eq!(all.numbers("mass", "kg", true, 0), Ok(Some(vec![2.0])));
        assert_eq!(all.numbers("at", "m", true, 2), Ok(Some(vec![0.001, 0.002])));
        assert_eq!(all.numbers("list", "1", true, 2), Ok(Some(vec![1.0, 2.5])));
        assert_eq!(all.numbers("absent", "m", false, 0), Ok(None));
        assert_eq!(all.integer("gains.n", true), Ok(Some(-4)));
        assert_eq!(all.flag("gains.on", true), Ok(Some(true)));
        assert_eq!(all.unknown().unwrap().key, "gains.name");
        assert_eq!(all.string("gains.name", true), Ok(Some("x")));
        assert_eq!(all.unknown(), None);
    }

    #[test]
    fn refusals_name_key_value_and_remedy() {
        let all = of("k = '3 m'\nmass = 2\nat = '[1, 2, 3] mm'\nn = 0.5\nbad = nan");
        for (refused, key, part) in [
            (all.numbers("mass", "kg", true, 0).err(), "mass", "such as \"1 kg\""),
            (all.numbers("k", "kg", true, 0).err(), "k", "dimension"),
            (all.numbers("k", "", true, 0).err(), "k", "a number is needed"),
            (all.numbers("at", "m", true, 2).err(), "at", "2 numbers"),
            (all.numbers("bad", "", true, 0).err(), "bad", "not finite"),
            (all.numbers("gone", "m", true, 0).err(), "gone", "missing"),
            (all.integer("n", true).err(), "n", "whole number"),
        ] {
            let refused = refused.unwrap();
            assert_eq!(refused.key, key);
            assert!(refused.reason.contains(part), "{refused}");
        }
    }
}
