//! Figures of a point as numbers.

use std::cmp::Ordering;
use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, PoisonError};

use lockstep::units::convert;
use report::page::split_unit;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::assessment::{self, Criterion};

/// A figure of merit, or an element of one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Number {
    /// Its key in tables and files: with a unit suffix where the assessment gives it one.
    pub key: String,
    /// Without the unit.
    pub name: String,
    /// The unit; empty where it has none.
    pub unit: String,
    /// The value; values that are not finite or were not measured are missing.
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

    /// The name with spaces in place of underscores.
    pub fn display_name(&self) -> String {
        self.name.replace('_', " ")
    }
}

/// Figures of merit as numbers.
///
/// A campaign holds the figures of all its points. The points of one scenario have the same figures: names and units are
/// stored once.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(from = "FiguresJson", into = "FiguresJson")]
pub struct Figures {
    /// An entry for each element of a list, without values.
    names: Arc<Vec<Number>>,
    /// The values; NaN for what is missing.
    values: Box<[f64]>,
    /// The criteria and their results.
    pub criteria: Vec<Criterion>,
}

/// The same in JSON.
#[derive(Serialize, Deserialize)]
struct FiguresJson {
    numbers: Vec<Number>,
    criteria: Vec<Criterion>,
}

impl From<FiguresJson> for Figures {
    fn from(json: FiguresJson) -> Figures {
        Figures::new(json.numbers, json.criteria)
    }
}

impl From<Figures> for FiguresJson {
    fn from(figures: Figures) -> FiguresJson {
        FiguresJson {
            numbers: figures.numbers().collect(),
            criteria: figures.criteria,
        }
    }
}

impl PartialEq for Figures {
    fn eq(&self, other: &Figures) -> bool {
        let bits = |figures: &Figures| figures.values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
        self.names == other.names && bits(self) == bits(other) && self.criteria == other.criteria
    }
}

/// Returns the stored names if they are equal to these, else these. Few are stored: points whose figures differ are rare.
fn interned(names: Vec<Number>) -> Arc<Vec<Number>> {
    const INTERNED_MAX: usize = 8;
    static KNOWN: Mutex<Vec<Arc<Vec<Number>>>> = Mutex::new(Vec::new());
    let mut known = KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(own) = known.iter().find(|own| ***own == names) {
        return own.clone();
    }
    let own = Arc::new(names);
    known.truncate(INTERNED_MAX - 1);
    known.insert(0, own.clone());
    own
}

impl Figures {
    /// These numbers and criteria.
    pub fn new(mut numbers: Vec<Number>, criteria: Vec<Criterion>) -> Figures {
        let values = numbers.iter_mut().map(|number| number.value.take().unwrap_or(f64::NAN));
        Figures {
            values: values.collect(),
            names: interned(numbers),
            criteria,
        }
    }

    /// The first figure that differs in `other`, or that only one of the two has, as text for both.
    pub fn difference(&self, other: &Figures) -> Option<(String, String)> {
        let words = |number: &Number| {
            let value = number
                .value
                .map_or("not measured".to_owned(), |value| value.to_string());
            format!("{} = {value} {}", number.name, number.unit)
                .trim_end()
                .to_owned()
        };
        let of = |figures: &Figures, number: &Number| {
            let mut all = figures.numbers();
            let own = all.find(|own| own.key == number.key);
            own.map_or_else(|| format!("no {}", number.name), |own| words(&own))
        };
        let mut all = self.numbers().chain(other.numbers());
        all.find_map(|number| Some((of(self, &number), of(other, &number))).filter(|(own, its)| own != its))
    }

    /// The limits of `criterion` in the unit of the figure `number`, which it judges; `None` where the factor between the two units is
    /// not known from these figures.
    pub fn limits_of(&self, number: &Number, criterion: &Criterion) -> Option<Vec<f64>> {
        let limits = criterion.limit.into_iter().chain(criterion.at_least);
        let plain = |unit: &str| if unit == "1" { String::new() } else { unit.to_owned() };
        if plain(&number.unit) == plain(&criterion.unit) {
            return Some(limits.collect());
        }
        let in_unit = |limit: f64| convert(&format!("{limit:?} {}", criterion.unit), &number.unit).ok();
        let converted = |limit: f64| in_unit(limit).and_then(|(numbers, _)| numbers.first().copied());
        // An assessment may have units of its own.
        let factor = || Some(self.value(&number.key)? / criterion.value.filter(|value| *value != 0.0)?);
        limits
            .map(|limit| converted(limit).or_else(|| Some(limit * factor()?)))
            .collect()
    }

    /// Those of a run.
    pub fn of(figures: &assessment::Figures) -> Figures {
        Figures::new(numbers(figures), figures.criteria.clone())
    }

    /// All of them, in stored order.
    pub fn numbers(&self) -> impl Iterator<Item = Number> {
        self.names.iter().zip(self.values.iter()).map(|(name, value)| Number {
            value: Some(*value).filter(|value| !value.is_nan()),
            ..name.clone()
        })
    }

    /// All of them: those with a criterion first, the others by name.
    pub fn ordered(&self) -> Vec<Number> {
        let with_criterion = self.criteria.iter().flat_map(|criterion| {
            let own = |number: &Number| number.name.split('[').next() == Some(&*criterion.name);
            self.numbers().filter(own)
        });
        let mut seen = BTreeSet::new();
        let mut all: Vec<Number> = with_criterion.chain(self.numbers()).collect();
        all.retain(|number| seen.insert(number.key.clone()));
        all
    }

    /// The value of the figure with this key.
    pub fn value(&self, key: &str) -> Option<f64> {
        let at = self.names.iter().position(|number| number.key == key)?;
        Some(self.values[at]).filter(|value| !value.is_nan())
    }
}

/// All numbers among `figures`: those of the assessment by name, then the measures.
fn numbers(figures: &assessment::Figures) -> Vec<Number> {
    let mut out = Vec::new();
    for (key, value) in figures.values.clone() {
        match value {
            Value::Array(items) if items.iter().all(Value::is_number) => {
                let elements = items.iter().enumerate();
                out.extend(elements.map(|(at, item)| Number::of_key(format!("{key}[{at}]"), item.as_f64())));
            }
            Value::Number(number) => out.push(Number::of_key(key, number.as_f64())),
            // a figure that was not measured still has its column
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

/// How near a point is to a limit or how far beyond it: more is worse.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LimitUsage {
    /// The fraction of the limit that is used: 1 at the limit. Infinite beyond a limit of which there is no fraction, 0 within it.
    fraction: f64,
    /// The distance beyond the limit, in the unit of the figure.
    excess: f64,
}

impl LimitUsage {
    /// For a figure of which more is worse; one that was not measured is worst.
    pub(crate) fn of_value(value: Option<f64>) -> LimitUsage {
        let fraction = value.unwrap_or(f64::INFINITY);
        LimitUsage {
            fraction,
            excess: fraction,
        }
    }

    fn of(criterion: &Criterion) -> Option<LimitUsage> {
        let Some(value) = criterion.value else {
            return Some(LimitUsage::of_value(None));
        };
        let side = |fraction: Option<f64>, excess: f64| LimitUsage {
            fraction: fraction.unwrap_or(if excess > 0.0 { f64::INFINITY } else { 0.0 }),
            excess,
        };
        let most = (criterion.limit).map(|limit| side((limit > 0.0).then(|| value / limit), value - limit));
        let least = criterion.at_least.map(|least| {
            let fraction = (least > 0.0 && value > 0.0).then(|| least / value);
            side(fraction, least - value)
        });
        most.into_iter().chain(least).max_by(LimitUsage::cmp_severity)
    }

    /// The fraction, where there is one.
    pub(crate) fn fraction(&self) -> Option<f64> {
        Some(self.fraction).filter(|fraction| fraction.is_finite())
    }

    pub(crate) fn cmp_severity(&self, other: &LimitUsage) -> Ordering {
        let by_fraction = self.fraction.total_cmp(&other.fraction);
        by_fraction.then(self.excess.total_cmp(&other.excess))
    }
}

impl Figures {
    /// The criterion that is nearest to its limit or furthest beyond, by name; one that was not measured comes first.
    pub(crate) fn most_critical(&self) -> Option<(LimitUsage, &str)> {
        let all = self.criteria.iter();
        let all = all.filter_map(|criterion| Some((LimitUsage::of(criterion)?, criterion.name.as_str())));
        all.max_by(|a, b| a.0.cmp_severity(&b.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::{Outcome, PointResult};

    #[test]
    fn figures_round_trip_through_json_with_gaps_and_shared_names() {
        let number = |key: &str, value| Number::of_key(key.to_owned(), value);
        let figures = |value| {
            let numbers = vec![
                number("miss_m", value),
                number("late_s", None),
                number("list[1]", Some(-0.0)),
            ];
            Figures::new(numbers, Vec::new())
        };
        let one = figures(Some(0.1));
        let text = serde_json::to_string(&one).unwrap();
        let back: Figures = serde_json::from_str(&text).unwrap();
        assert_eq!(back, one);
        assert_ne!(back, figures(Some(0.2)));
        assert_eq!((back.value("miss_m"), back.value("late_s")), (Some(0.1), None));
        assert!(Arc::ptr_eq(&back.names, &one.names), "the names are there once");
        assert_eq!(
            back.numbers().map(|number| number.unit).collect::<Vec<_>>(),
            ["m", "s", ""]
        );
    }

    /// A figure is compared with the one of its key, whatever stands before it.
    #[test]
    fn difference_names_the_same_figure_on_both_sides() {
        let of = |numbers: &[(&str, f64)]| {
            let numbers = numbers.iter().map(|(key, value)| Number {
                key: (*key).into(),
                name: (*key).into(),
                unit: "m".into(),
                value: Some(*value),
            });
            Figures::new(numbers.collect(), Vec::new())
        };
        let text = |own: &str, its: &str| Some((own.to_owned(), its.to_owned()));
        let both = of(&[("ma", 1.0), ("mb", 2.0), ("mc", 3.0)]);
        let without = of(&[("ma", 1.0), ("mc", 3.0)]);
        assert_eq!(without.difference(&both), text("no mb", "mb = 2 m"));
        assert_eq!(both.difference(&without), text("mb = 2 m", "no mb"));
        let other = of(&[("mc", 3.0), ("ma", 1.0), ("mb", 2.5)]);
        assert_eq!(both.difference(&other), text("mb = 2 m", "mb = 2.5 m"));
        assert_eq!(both.difference(&both), None);
        // The tape may be the same where a figure is not.
        let result = |figures: &Figures| PointResult {
            figures: Some(figures.clone()),
            tape: Some("00".into()),
            ..PointResult::without(Outcome::Met, "")
        };
        assert_eq!(
            result(&both).difference(&result(&other)),
            text("mb = 2 m", "mb = 2.5 m")
        );
    }
}
