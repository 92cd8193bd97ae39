//! The figures of a point as numbers.

use std::collections::BTreeSet;

use report::page::split_unit;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::assessment::{self, Criterion};

/// A figure of merit, or an element of one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Number {
    /// As it is called everywhere: with a unit suffix where the assessment gives it one.
    pub key: String,
    /// Without the unit.
    pub name: String,
    /// The unit; empty where it has none.
    pub unit: String,
    /// What it is; what is not finite or was not measured is missing.
    pub value: Option<f64>,
}

impl Number {
    fn of_key(key: String, value: Option<f64>) -> Number {
        let (stem, element) = key.split_once('[').unwrap_or((&key, ""));
        let (short, unit) = split_unit(stem);
        let name = if element.is_empty() {
            short.to_owned()
        } else {
            format!("{short}[{element}")
        };
        Number {
            name,
            unit: unit.to_owned(),
            key,
            value,
        }
    }

    /// In words: without underscores.
    pub fn words(&self) -> String {
        self.name.replace('_', " ")
    }
}

/// Figures of merit as numbers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Figures {
    /// An entry for each element of a list.
    pub numbers: Vec<Number>,
    /// The criteria and what became of them.
    pub criteria: Vec<Criterion>,
}

impl Figures {
    /// Those of a run.
    pub fn of(figures: &assessment::Figures) -> Figures {
        Figures {
            numbers: numbers(figures),
            criteria: figures.criteria.clone(),
        }
    }

    /// All of them: those with a criterion first, the others by name.
    pub fn ordered(&self) -> Vec<Number> {
        let judged = self.criteria.iter().flat_map(|criterion| {
            let own = |number: &&Number| number.name.split('[').next() == Some(&*criterion.name);
            self.numbers.iter().filter(own)
        });
        let mut seen = BTreeSet::new();
        let mut all: Vec<Number> = judged.chain(&self.numbers).cloned().collect();
        all.retain(|number| seen.insert(number.key.clone()));
        all
    }

    /// The value of the figure with this key.
    pub fn value(&self, key: &str) -> Option<f64> {
        self.numbers.iter().find(|number| number.key == key)?.value
    }
}

/// Everything of `figures` that is a number: those of the assessment by name, then the measures.
fn numbers(figures: &assessment::Figures) -> Vec<Number> {
    let mut out = Vec::new();
    for (key, value) in figures.values.clone() {
        match value {
            Value::Array(items) if items.iter().all(Value::is_number) => {
                let elements = items.iter().enumerate();
                out.extend(elements.map(|(at, item)| Number::of_key(format!("{key}[{at}]"), item.as_f64())));
            }
            Value::Number(number) => out.push(Number::of_key(key, number.as_f64())),
            // what could not be measured has its column all the same
            Value::Null if key != "incomplete" => out.push(Number::of_key(key, None)),
            Value::Bool(yes) => out.push(Number::of_key(key, Some(f64::from(u8::from(yes))))),
            _ => {}
        }
    }
    for measure in &figures.measures {
        let number = |name: String, value: &Value| Number {
            key: name.clone(),
            name,
            unit: if measure.unit == "1" {
                String::new()
            } else {
                measure.unit.clone()
            },
            value: value.as_f64(),
        };
        match &measure.value {
            Value::Array(items) => {
                let elements = items.iter().enumerate();
                out.extend(elements.map(|(at, item)| number(format!("{}[{at}]", measure.name), item)));
            }
            value => out.push(number(measure.name.clone(), value)),
        }
    }
    out
}
