//! One point under construction: the values that its dispersions give to keys and columns.

use std::collections::BTreeMap;

use lockstep::units::{Dimension, unit_factor};

use crate::campaign::cell::{Cell, Head, Point};
use crate::campaign::dispersions::{Dispersion, Drawn, Formula, Quantity, Sized};

/// A point under construction.
pub(super) struct Made<'a> {
    start: &'a BTreeMap<String, Quantity>,
    /// Keys that have numbers so far.
    numbers: BTreeMap<&'a str, Quantity>,
    pub(super) settings: BTreeMap<String, String>,
    /// The numbers of the dispersions so far, in SI units, for formulas.
    known: BTreeMap<String, Sized>,
    refused: Option<String>,
    heads: Vec<Head>,
    cells: Vec<Cell>,
}

impl<'a> Made<'a> {
    pub(super) fn new(start: &'a BTreeMap<String, Quantity>) -> Made<'a> {
        Made {
            start,
            numbers: BTreeMap::new(),
            settings: BTreeMap::new(),
            known: BTreeMap::new(),
            refused: None,
            heads: Vec::new(),
            cells: Vec::new(),
        }
    }

    fn cell(&mut self, name: &str, unit: &str, text: String, number: Option<f64>) {
        self.heads.push(Head {
            name: name.to_owned(),
            unit: unit.to_owned(),
        });
        self.cells.push(Cell { text, number });
    }

    pub(super) fn text(&mut self, name: &str, text: String) {
        self.cell(name, "", text, None);
    }

    pub(super) fn whole(&mut self, name: &str, number: u64) {
        self.cell(name, "", number.to_string(), Some(number as f64));
    }

    pub(super) fn formula(&self, formula: &Formula) -> Option<f64> {
        let value = formula.value(&|name| self.known.get(name).copied());
        value.ok().map(|(value, _)| value)
    }

    pub(super) fn put(&mut self, one: &'a Dispersion, drawn: Drawn) {
        let draw = match drawn {
            Drawn::Numbers(draw) => draw,
            Drawn::Value(value, label) => {
                for target in &one.targets {
                    self.settings.insert(target.key.clone(), value.to_string());
                }
                return self.text(&one.name, label);
            }
        };
        let mut shown = None;
        for target in &one.targets {
            let own = self
                .numbers
                .get(target.key.as_str())
                .or_else(|| self.start.get(&target.key));
            let made = one.applied(own, target.element, &draw);
            shown.get_or_insert_with(|| (made.clone(), target.element));
            self.numbers.insert(&target.key, made);
        }
        let (shown, element) = shown.unwrap_or_else(|| (one.applied(None, None, &draw), None));
        let single = element.is_some() || shown.numbers.len() == 1 && !shown.listed;
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
                self.refused
                    .get_or_insert(format!("vary.{}: {number} is drawn, which is not finite", one.name));
            }
            if let Ok((factor, dimension)) = factor {
                self.known.insert(name.clone(), (number * factor, dimension));
            }
            let space = if shown.unit.is_empty() { "" } else { " " };
            let text = format!("{}{space}{}", shown.digits(at), shown.unit);
            self.cell(&name, &shown.unit, text, Some(number));
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
            settings: match self.refused {
                None => Ok(settings.collect()),
                Some(reason) => Err(reason),
            },
            cells: self.cells,
        };
        (point, self.heads)
    }
}
