//! A dispersion: the keys that it sets, the source of its values, and its design.

use super::quantity::{Quantity, RoundingStep};
use super::value_source::ValueSource;

/// A key of the scenario, or one element of the list at a key.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Target {
    /// The dotted key.
    pub key: String,
    /// The element, from 0.
    pub element: Option<usize>,
}

/// How a draw becomes the value of a key.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    /// The draw is the value.
    Absolute,
    /// The draw is added to the scenario's own value.
    Offset,
    /// The scenario's own value grows by this fraction.
    Relative,
    /// The scenario's own value is multiplied by the draw.
    Factor,
}

/// The design that a dispersion is drawn with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Design {
    /// Independent random samples.
    Random,
    /// A Latin hypercube.
    LatinHypercube,
    /// A scrambled Sobol' sequence.
    Sobol,
    /// Every combination with the values of the other dispersions on the grid.
    Grid,
    /// The matrices A, B and AB from which Sobol' indices are estimated.
    Saltelli,
    /// Subset simulation: levels that approach a rare event.
    Subset,
}

impl Design {
    /// The name in a campaign file.
    pub fn name(self) -> &'static str {
        let known = DESIGNS.iter().find(|(_, design)| *design == self);
        known.map_or("", |(word, _)| word)
    }
}

/// Names of designs.
pub const DESIGNS: [(&str, Design); 6] = [
    ("random", Design::Random),
    ("latin-hypercube", Design::LatinHypercube),
    ("sobol", Design::Sobol),
    ("grid", Design::Grid),
    ("saltelli", Design::Saltelli),
    ("subset", Design::Subset),
];

/// One `[vary.NAME]`.
#[derive(Debug, Clone)]
pub struct Dispersion {
    /// Its name: that of its random numbers and of its columns.
    pub name: String,
    /// The keys whose values it sets. None where it is used in formulas only.
    pub targets: Vec<Target>,
    /// Where its values come from.
    pub source: ValueSource,
    /// How a draw is applied.
    pub mode: Mode,
    /// The unit of the samples; empty where they have none.
    pub unit: String,
    /// The unit of the values at its keys.
    pub value_unit: String,
    /// The rounding step of values.
    pub step: Option<RoundingStep>,
    /// Sampled once for all points.
    pub once: bool,
    /// Its own design, where it differs from the campaign's.
    pub design: Option<Design>,
    /// Number of values on a grid, where those are not a list.
    pub levels: Option<usize>,
}

impl Dispersion {
    /// The value of a target whose present value is `current`, which the mode [`Mode::Absolute`] does not need.
    pub fn apply(&self, current: Option<&Quantity>, element: Option<usize>, draw: &[f64]) -> Quantity {
        let (Some(current), true) = (
            current,
            self.mode != Mode::Absolute || element.is_some() || self.source.transforms_value(),
        ) else {
            let mut result = Quantity::new(draw.to_vec(), &self.unit, self.source.is_list());
            self.round_to_step(&mut result, None);
            return result;
        };
        let mut result = current.clone();
        if let Some(transformed) = self.source.transformed(current, draw) {
            result.numbers = transformed;
            result.decimals = vec![None; result.numbers.len()];
        } else {
            let single = element.map_or(0..result.numbers.len(), |at| at..at + 1);
            for (number, at) in single.enumerate() {
                // One draw for all numbers of a list, or one for each.
                let x = draw[number.min(draw.len() - 1)];
                let value = &mut result.numbers[at];
                *value = match self.mode {
                    Mode::Absolute => x,
                    Mode::Offset => *value + x,
                    Mode::Relative => *value * (1.0 + x),
                    Mode::Factor => *value * x,
                };
                result.decimals[at] = None;
            }
        }
        self.round_to_step(&mut result, element);
        result
    }

    /// Whether the previous value of a key is replaced.
    pub fn replaces(&self) -> bool {
        self.mode == Mode::Absolute && !self.source.transforms_value()
    }

    fn round_to_step(&self, quantity: &mut Quantity, element: Option<usize>) {
        if let Some(step) = &self.step {
            let all = element.map_or(0..quantity.numbers.len(), |at| at..at + 1);
            all.for_each(|at| quantity.round(at, step));
        }
    }
}
