//! The keys of one table `[vary.NAME]`, read one by one.

use std::collections::BTreeSet;

use lockstep::units::{convert, unit_in};
use sampling::distribution::InvalidParameter;
use toml::{Table, Value};

use super::quantity::{RoundingStep, number};

/// A table, and the mistakes found so far.
pub(super) struct KeyReader<'a> {
    table: &'a Table,
    used: BTreeSet<String>,
    /// Mistakes, by key; the empty key is the whole table.
    pub(super) mistakes: Vec<(String, String)>,
    /// The unit of its quantities, once it is known.
    pub(super) unit: Option<String>,
    /// Whether the table gives that unit, so that numbers without one have it.
    has_own_unit: bool,
    /// Its quantities are fractions: plain numbers, or with `%`.
    pub(super) as_fractions: bool,
}

impl<'a> KeyReader<'a> {
    pub(super) fn new(table: &'a Table) -> KeyReader<'a> {
        KeyReader {
            table,
            used: BTreeSet::new(),
            mistakes: Vec::new(),
            unit: None,
            has_own_unit: false,
            as_fractions: false,
        }
    }

    /// Reads the unit that the table gives, if any.
    pub(super) fn read_unit(&mut self) {
        self.unit = self.text("unit").map(str::to_owned);
        self.has_own_unit = self.unit.is_some();
    }

    /// Names keys that the table may have: a mistake in one of them keeps the others from being read, and they are no unknown keys.
    pub(super) fn expect(&mut self, keys: &[&str]) {
        self.used.extend(keys.iter().map(|key| (*key).to_owned()));
    }

    pub(super) fn refuse(&mut self, key: &str, reason: impl Into<String>) {
        self.mistakes.push((key.to_owned(), reason.into()));
    }

    /// The value at `key`, if present.
    pub(super) fn value(&mut self, key: &str) -> Option<&'a Value> {
        self.used.insert(key.to_owned());
        self.table.get(key)
    }

    /// The value at `key`, which is required.
    pub(super) fn required_value(&mut self, key: &str, example: &str) -> Option<&'a Value> {
        let found = self.value(key);
        if found.is_none() {
            self.refuse("", format!("`{key}` is missing: write for example {key} = {example}"));
        }
        found
    }

    pub(super) fn text(&mut self, key: &str) -> Option<&'a str> {
        let value = self.value(key)?;
        let text = value.as_str();
        if text.is_none() {
            self.refuse(key, format!("{value} is no text"));
        }
        text
    }

    pub(super) fn flag(&mut self, key: &str) -> bool {
        match self.value(key) {
            Some(Value::Boolean(yes)) => *yes,
            Some(other) => {
                self.refuse(key, format!("{other} is neither true nor false"));
                false
            }
            None => false,
        }
    }

    pub(super) fn integer(&mut self, key: &str, most: usize) -> Option<usize> {
        let value = self.value(key)?;
        let whole = value.as_integer().and_then(|whole| usize::try_from(whole).ok());
        let whole = whole.filter(|whole| (1..=most).contains(whole));
        if whole.is_none() {
            self.refuse(key, format!("{value} is no whole number from 1 to {most}"));
        }
        whole
    }

    /// One of `words`.
    pub(super) fn one_of<T: Copy>(&mut self, key: &str, words: &[(&str, T)]) -> Option<T> {
        let text = self.text(key)?;
        let found = words.iter().find(|(word, _)| *word == text);
        if found.is_none() {
            let known: Vec<&str> = words.iter().map(|(word, _)| *word).collect();
            self.refuse(key, format!("`{text}` is unknown; there is {}", known.join(", ")));
        }
        found.map(|(_, one)| *one)
    }

    /// Numbers in the unit of the table, which the first quantity determines where it was not determined before.
    pub(super) fn quantity(&mut self, value: &Value) -> Result<(Vec<f64>, bool), String> {
        let plain = match value {
            Value::Array(items) => items
                .iter()
                .map(number)
                .collect::<Option<Vec<f64>>>()
                .map(|all| (all, true)),
            other => number(other).map(|one| (vec![one], false)),
        };
        let example = || match &self.unit {
            Some(unit) if unit.is_empty() => "0.5".to_owned(),
            Some(unit) => format!("\"0.5 {unit}\""),
            None if self.as_fractions => "\"5 %\"".to_owned(),
            None => "\"0.5 kg\"".to_owned(),
        };
        let (numbers, is_list) = if let Some((numbers, is_list)) = plain {
            if !self.as_fractions && !self.has_own_unit {
                if self.unit.as_ref().is_some_and(|unit| !unit.is_empty()) {
                    return Err(format!("{value} has no unit: write for example {}", example()));
                }
                self.unit = Some(String::new());
            }
            (numbers, is_list)
        } else {
            let Value::String(text) = value else {
                return Err(format!("{value} is no number: write for example {}", example()));
            };
            if self.as_fractions {
                let share = text.strip_suffix('%').and_then(|text| text.trim().parse::<f64>().ok());
                let share = share.ok_or_else(|| format!("`{text}` is no part: write 0.05 or \"5 %\""))?;
                (vec![share / 100.0], false)
            } else {
                let own = unit_in(text)
                    .ok_or_else(|| format!("`{text}` is no number with a unit: write for example {}", example()))?;
                let unit = self.unit.get_or_insert_with(|| own.to_owned());
                if unit.is_empty() {
                    return Err(format!(
                        "`{text}` has a unit where plain numbers belong: write them all with it or without"
                    ));
                }
                convert(text, unit).map_err(|error| error.to_string())?
            }
        };
        if numbers.iter().any(|number| !number.is_finite()) {
            return Err(format!("{value} is not finite"));
        }
        Ok((numbers, is_list))
    }

    /// One number at `key`.
    pub(super) fn number(&mut self, key: &str) -> Option<f64> {
        let value = self.value(key)?;
        match self.quantity(value) {
            Ok((numbers, false)) => numbers.first().copied(),
            Ok(_) => {
                self.refuse(key, format!("{value} is a list where one number belongs"));
                None
            }
            Err(reason) => {
                self.refuse(key, reason);
                None
            }
        }
    }

    /// The number at `key`, which is required.
    pub(super) fn required_number(&mut self, key: &str, example: &str) -> Option<f64> {
        self.required_value(key, example)?;
        self.number(key)
    }

    /// Numbers in brackets at `key`.
    pub(super) fn numbers(&mut self, key: &str) -> Option<Vec<f64>> {
        let value = self.value(key)?;
        match self.quantity(value) {
            Ok((numbers, true)) => Some(numbers),
            Ok(_) => {
                self.refuse(key, format!("{value} is one number where a list in brackets belongs"));
                None
            }
            Err(reason) => {
                self.refuse(key, reason);
                None
            }
        }
    }

    /// An angle at `key`, rad.
    pub(super) fn angle(&mut self, key: &str) -> Option<f64> {
        let value = self.value(key)?;
        let read = value.as_str().map(|text| convert(text, "rad"));
        match read {
            Some(Ok((numbers, false))) if numbers.len() == 1 => Some(numbers[0]),
            _ => {
                self.refuse(key, format!("{value} is no angle: write for example \"0.2 deg\""));
                None
            }
        }
    }

    /// A number without a unit at `key`, or a fraction with `%`.
    pub(super) fn fraction(&mut self, key: &str) -> Option<f64> {
        let value = self.value(key)?;
        let share = |text: &str| Some(text.strip_suffix('%')?.trim().parse::<f64>().ok()? / 100.0);
        let found = number(value).or_else(|| value.as_str().and_then(share));
        let found = found.filter(|number| number.is_finite());
        if found.is_none() {
            self.refuse(key, format!("{value} is no part: write 0.05 or \"5 %\""));
        }
        found
    }

    /// The rounding step of values, in the unit of the table.
    pub(super) fn step(&mut self, unit: &str) -> Option<RoundingStep> {
        let value = self.value("round")?;
        let step = RoundingStep::of(value).filter(|step| step.unit == unit);
        if step.is_none() {
            let example = if unit.is_empty() {
                "1".to_owned()
            } else {
                format!("\"0.1 {unit}\"")
            };
            self.refuse(
                "round",
                format!("{value} is no step above zero in the unit of the value: write for example {example}"),
            );
        }
        step
    }

    /// All mistakes, including unknown keys.
    pub(super) fn finish(mut self) -> Vec<(String, String)> {
        let known: Vec<&str> = self.used.iter().map(String::as_str).collect();
        let known = known.join(", ");
        for key in self.table.keys().filter(|key| !self.used.contains(*key)) {
            self.mistakes
                .push((key.clone(), format!("unknown key; there is {known}")));
        }
        self.mistakes
    }
}

/// The keys of a distribution, in addition to those of every table.
pub(super) fn keys_of(distribution: &str) -> &'static [&'static str] {
    match distribution {
        "uniform" => &["from", "to"],
        "normal" => &["mean", "deviation"],
        "truncated-normal" => &["mean", "deviation", "from", "to"],
        "log-normal" => &["median", "log-deviation"],
        "triangular" => &["from", "mode", "to"],
        "discrete" => &["values", "labels", "weights"],
        "column" => &["file", "column", "order"],
        "constant" => &["value"],
        "formula" => &["formula"],
        "correlated-normal" => &["mean", "deviations", "correlations"],
        "sphere" => &["length"],
        "cone" => &["length", "axis", "half-angle"],
        "rotation" => &["written"],
        "misalignment" => &["written", "deviation"],
        "inertia" => &["log-deviation", "turn"],
        _ => &[],
    }
}

/// A distribution that could be constructed; else a mistake is recorded at its key.
pub(super) fn valid_or_record<T>(keys: &mut KeyReader<'_>, distribution: Result<T, InvalidParameter>) -> Option<T> {
    distribution
        .map_err(|error| keys.refuse(error.parameter, error.reason))
        .ok()
}
