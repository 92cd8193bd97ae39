//! One point under construction: the values that its dispersions give to keys and columns.

use std::collections::BTreeMap;

use lockstep::units::{Dimension, unit_factor};

use crate::campaign::cell::{Cell, Head, Point};
use crate::campaign::dispersions::{DimensionedValue, Dispersion, Formula, Quantity, SampledValue};

/// A point under construction.
pub(super) struct PointBuilder<'a> {
    nominal: &'a BTreeMap<String, Quantity>,
    /// Keys that have numbers so far.
    numbers: BTreeMap<&'a str, Quantity>,
    pub(super) settings: BTreeMap<String, String>,
    /// The numbers of the dispersions so far, in SI units, for formulas.
    formula_values: BTreeMap<String, DimensionedValue>,
    rejection: Option<String>,
    heads: Vec<Head>,
    cells: Vec<Cell>,
}

impl<'a> PointBuilder<'a> {
    pub(super) fn new(nominal: &'a BTreeMap<String, Quantity>) -> PointBuilder<'a> {
        PointBuilder {
            nominal,
            numbers: BTreeMap::new(),
            settings: BTreeMap::new(),
            formula_values: BTreeMap::new(),
            rejection: None,
            heads: Vec::new(),
            cells: Vec::new(),
        }
    }

    fn add_cell(&mut self, name: &str, unit: &str, text: String, number: Option<f64>) {
        self.heads.push(Head {
            name: name.to_owned(),
            unit: unit.to_owned(),
        });
        self.cells.push(Cell { text, number });
    }

    pub(super) fn add_text(&mut self, name: &str, text: String) {
        self.add_cell(name, "", text, None);
    }

    pub(super) fn add_integer(&mut self, name: &str, number: u64) {
        self.add_cell(name, "", number.to_string(), Some(number as f64));
    }

    pub(super) fn evaluate(&self, formula: &Formula) -> Option<f64> {
        let value = formula.value(&|name| self.formula_values.get(name).copied());
        value.ok().map(|(value, _)| value)
    }

    pub(super) fn apply(&mut self, one: &'a Dispersion, drawn: SampledValue) {
        let draw = match drawn {
            SampledValue::Numbers(draw) => draw,
            SampledValue::Value(value, label) => {
                for target in &one.targets {
                    self.settings.insert(target.key.clone(), value.to_string());
                }
                return self.add_text(&one.name, label);
            }
        };
        let mut shown = None;
        for target in &one.targets {
            let current = self
                .numbers
                .get(target.key.as_str())
                .or_else(|| self.nominal.get(&target.key));
            let value = one.apply(current, target.element, &draw);
            shown.get_or_insert_with(|| (value.clone(), target.element));
            self.numbers.insert(&target.key, value);
        }
        let (shown, element) = shown.unwrap_or_else(|| (one.apply(None, None, &draw), None));
        let single = element.is_some() || shown.numbers.len() == 1 && !shown.is_list;
        let factor = if shown.unit.is_empty() {
            Ok((1.0, Dimension::default()))
        } else {
            unit_factor(&shown.unit)
        };
        for at in element.map_or(0..shown.numbers.len(), |at| at..at + 1) {
            let name = if single {
                one.name.clone()
            } else {
                format!("{}[{at}]", one.name)
            };
            let number = shown.numbers[at];
            if !number.is_finite() {
                self.rejection
                    .get_or_insert(format!("vary.{}: {number} is drawn, which is not finite", one.name));
            }
            if let Ok((factor, dimension)) = factor {
                self.formula_values.insert(name.clone(), (number * factor, dimension));
            }
            let space = if shown.unit.is_empty() { "" } else { " " };
            let text = format!("{}{space}{}", shown.digits(at), shown.unit);
            self.add_cell(&name, &shown.unit, text, Some(number));
        }
    }

    /// Returns the point and the heads. A table is set before the keys below it.
    pub(super) fn finish(mut self) -> (Point, Vec<Head>) {
        for (key, quantity) in std::mem::take(&mut self.numbers) {
            self.settings.insert(key.to_owned(), quantity.text());
        }
        let mut settings: Vec<(usize, String, String)> = self
            .settings
            .into_iter()
            .map(|(key, text)| (key.split('.').count(), key, text))
            .collect();
        settings.sort();
        let settings = settings.into_iter().map(|(_, key, text)| format!("{key}={text}"));
        let point = Point {
            settings: match self.rejection {
                None => Ok(settings.collect()),
                Some(reason) => Err(reason),
            },
            cells: self.cells,
        };
        (point, self.heads)
    }
}
