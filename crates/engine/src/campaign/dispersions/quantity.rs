//! Values of keys as numbers that can be changed and written back.

use lockstep::units::{convert, unit_in};
use toml::{Table, Value};

use crate::scenario::find_entry;

/// One number or a list of numbers, with their unit.
#[derive(Debug, Clone, PartialEq)]
pub struct Quantity {
    /// The numbers.
    pub numbers: Vec<f64>,
    /// Decimals that each is written with; as many as needed where nothing was rounded.
    pub decimals: Vec<Option<usize>>,
    /// Their unit as the user writes it; empty where there is none.
    pub unit: String,
    /// Whether they are written in brackets.
    pub is_list: bool,
}

impl Quantity {
    /// Numbers without rounding.
    pub fn new(numbers: Vec<f64>, unit: &str, is_list: bool) -> Quantity {
        Quantity {
            decimals: vec![None; numbers.len()],
            numbers,
            unit: unit.to_owned(),
            is_list,
        }
    }

    /// The value of a scenario's key, where that is numbers: `12`, `0.5`, `"10 ms"`, `[1, 2]`, `"[1, 2, 3] m"`. Whole
    /// numbers stay whole.
    pub fn of(value: &Value) -> Option<Quantity> {
        match value {
            Value::Integer(whole) => Some(Quantity {
                decimals: vec![Some(0)],
                ..Quantity::new(vec![*whole as f64], "", false)
            }),
            Value::Float(number) => Some(Quantity::new(vec![*number], "", false)),
            Value::Array(items) => {
                let numbers: Option<Vec<f64>> = items.iter().map(number).collect();
                numbers
                    .filter(|numbers| !numbers.is_empty())
                    .map(|numbers| Quantity::new(numbers, "", true))
            }
            Value::String(text) => {
                let unit = unit_in(text)?;
                let (numbers, is_list) = convert(text, unit).ok()?;
                Some(Quantity::new(numbers, unit, is_list))
            }
            _ => None,
        }
    }

    /// Number `at` as it is written.
    pub fn digits(&self, at: usize) -> String {
        match self.decimals[at] {
            Some(decimals) => format!("{:.decimals$}", self.numbers[at]),
            None => format!("{:?}", self.numbers[at]),
        }
    }

    /// As `--set` takes it.
    pub fn text(&self) -> String {
        let digits: Vec<String> = (0..self.numbers.len()).map(|at| self.digits(at)).collect();
        let digits = digits.join(", ");
        let space = if self.unit.is_empty() { "" } else { " " };
        if self.is_list {
            format!("[{digits}]{space}{}", self.unit)
        } else {
            format!("{digits}{space}{}", self.unit)
        }
    }

    /// Rounds number `at` to a multiple of `step`.
    pub fn round(&mut self, at: usize, step: &RoundingStep) {
        self.numbers[at] = libm::round(self.numbers[at] / step.size) * step.size;
        self.decimals[at] = Some(step.decimals);
        // The written number is exact: seven steps of 0.1 are 0.7.
        self.numbers[at] = self.digits(at).parse().unwrap_or(self.numbers[at]);
        // A small number below zero becomes zero, without its sign.
        if self.numbers[at] == 0.0 {
            self.numbers[at] = 0.0;
        }
    }
}

/// The step of which rounded values are multiples.
#[derive(Debug, Clone, PartialEq)]
pub struct RoundingStep {
    /// Its size, in `unit`.
    pub size: f64,
    /// The decimals that it is written with.
    pub decimals: usize,
    /// Its unit; empty where it has none.
    pub unit: String,
}

impl RoundingStep {
    /// Reads `0.5`, `1`, `"0.1 ms"`; `None` for anything but such a number above zero.
    pub fn of(value: &Value) -> Option<RoundingStep> {
        let text = match value {
            Value::String(text) => text.clone(),
            Value::Integer(_) | Value::Float(_) => value.to_string(),
            _ => return None,
        };
        let digits: String = text.chars().take_while(|c| c.is_ascii_digit() || *c == '.').collect();
        let size: f64 = digits.parse().ok().filter(|size| *size > 0.0)?;
        let unit = text[digits.len()..].trim().to_owned();
        // An exponent would be read as the start of a unit.
        let plain = unit.chars().next().is_none_or(|c| !matches!(c, 'e' | 'E' | '-' | '+'));
        let decimals = digits.split_once('.').map_or(0, |(_, behind)| behind.len());
        plain.then_some(RoundingStep { size, decimals, unit })
    }
}

/// A number of a TOML value.
pub fn number(value: &Value) -> Option<f64> {
    match value {
        Value::Integer(whole) => Some(*whole as f64),
        Value::Float(number) => Some(*number),
        _ => None,
    }
}

/// Whether one of two dotted keys is the other, or a table around it.
pub fn keys_overlap(one: &str, other: &str) -> bool {
    let within = |inner: &str, outer: &str| {
        let rest = inner.strip_prefix(outer);
        rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
    };
    within(one, other) || within(other, one)
}

/// The dotted `key`, in which entries of lists of tables are called by their names, as in the scenario's own messages.
pub fn with_entry_names(table: &Table, key: &str) -> String {
    let parts: Vec<&str> = key.split('.').collect();
    let named = parts.iter().enumerate().map(|(depth, part)| {
        let above = if depth == 0 {
            None
        } else {
            at_key(table, &parts[..depth].join("."))
        };
        let own = above.and_then(Value::as_array).and_then(|items| {
            let (position, name) = find_entry(items, part)?;
            // Another entry may have the same name, or one that a key cannot contain.
            (find_entry(items, &name)?.0 == position && !name.contains('.')).then_some(name)
        });
        own.unwrap_or_else(|| (*part).to_owned())
    });
    named.collect::<Vec<_>>().join(".")
}

/// The value at the dotted `key`. Entries of lists of tables are addressed by name or by number, from 1.
pub fn at_key<'a>(table: &'a Table, key: &str) -> Option<&'a Value> {
    let mut parts = key.split('.');
    let first = table.get(parts.next()?)?;
    parts.try_fold(first, |value, part| match value {
        Value::Table(table) => table.get(part),
        Value::Array(items) => find_entry(items, part).map(|(position, _)| &items[position]),
        _ => None,
    })
}
