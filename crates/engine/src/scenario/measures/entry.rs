//! The meaning of the words and quantities of `[measures.NAME]`.

use lockstep::units;
use toml::Value;

use super::refusal::{Refusal, conversion_factor, refusal};
use crate::measures::{Compute, Limits};
use crate::scenario::faults::values;
use crate::scenario::spec::{MeasureKind, MeasureSpec};

impl MeasureKind {
    /// The unit of the figure of a signal in `unit`.
    pub(super) fn unit(self, unit: &str) -> String {
        match self {
            MeasureKind::TimeAbove
            | MeasureKind::TimeBelow
            | MeasureKind::FirstCrossing
            | MeasureKind::SettlingTime => "s".to_owned(),
            MeasureKind::Changes => "1".to_owned(),
            MeasureKind::Integral | MeasureKind::IntegralAbs if unit == "1" => "s".to_owned(),
            MeasureKind::Integral | MeasureKind::IntegralAbs => match unit.strip_suffix("/s") {
                Some(rate) => rate.to_owned(),
                None => format!("{unit} s"),
            },
            MeasureKind::Rate => match unit.strip_suffix(" s") {
                Some(integral) => integral.to_owned(),
                None => match unit.strip_suffix("/s") {
                    Some(moved) => format!("{moved}/s^2"),
                    None => format!("{unit}/s"),
                },
            },
            _ => unit.to_owned(),
        }
    }
}

impl MeasureSpec {
    /// Checks that all keys that the computation needs are given, and none that it does not have.
    pub(super) fn check(&self) -> Result<(), Refusal> {
        let threshold = matches!(
            self.compute,
            MeasureKind::TimeAbove | MeasureKind::TimeBelow | MeasureKind::FirstCrossing
        );
        for (key, given, needed, example) in [
            ("at", self.at.is_some(), self.compute == MeasureKind::At, "\"3 s\""),
            ("threshold", self.threshold.is_some(), threshold, "\"5 mm\""),
            (
                "band",
                self.band.is_some(),
                self.compute == MeasureKind::SettlingTime,
                "\"[-2, 2] mm\"",
            ),
            (
                "percent",
                self.percent.is_some(),
                self.compute == MeasureKind::Percentile,
                "95",
            ),
        ] {
            let word = Value::try_from(self.compute).ok();
            let word = word.as_ref().and_then(Value::as_str).unwrap_or_default();
            if needed && !given {
                return refusal(
                    "",
                    format!("`{key}` is missing: compute = \"{word}\" needs it, such as {key} = {example}"),
                );
            }
            if given && !needed {
                return refusal(key, format!("does not belong to compute = \"{word}\""));
            }
        }
        if self.at.is_some() && (self.from.is_some() || self.to.is_some()) {
            let key = if self.from.is_some() { "from" } else { "to" };
            return refusal(key, "does not belong to a value at one instant");
        }
        if let (Some(from), Some(to)) = (&self.from, &self.to)
            && from.checked() > to.checked()
        {
            return refusal(
                "to",
                format!(
                    "{} is before `from`, {}: the window is empty",
                    to.checked(),
                    from.checked()
                ),
            );
        }
        if let Some(percent) = self.percent.filter(|percent| !(0.0..=100.0).contains(percent)) {
            return refusal("percent", format!("{percent} is not between 0 and 100"));
        }
        if self.is.is_some() && (self.minus.is_some() || self.through.is_some()) {
            let key = if self.minus.is_some() { "minus" } else { "through" };
            return refusal(key, "does not belong to one value of an enumeration");
        }
        if self.within.is_some() && (self.at_most.is_some() || self.at_least.is_some()) {
            return refusal("within", "stands for `at-least` and `at-most`: leave those out, or it");
        }
        Ok(())
    }

    /// The computation on a signal in `unit`.
    pub(super) fn computation(&self, unit: &str) -> Result<Compute, Refusal> {
        let threshold = || parse_single("threshold", self.threshold.as_ref(), unit);
        Ok(match self.compute {
            MeasureKind::Min => Compute::Min,
            MeasureKind::Max => Compute::Max,
            MeasureKind::MaxAbs => Compute::MaxAbs,
            MeasureKind::Mean => Compute::Mean,
            MeasureKind::Rms => Compute::Rms,
            MeasureKind::Final => Compute::Final,
            MeasureKind::At => Compute::At,
            MeasureKind::Range => Compute::Range,
            MeasureKind::Integral => Compute::Integral,
            MeasureKind::IntegralAbs => Compute::IntegralAbs,
            MeasureKind::Rate => Compute::Rate,
            MeasureKind::TimeAbove => Compute::TimeAbove(threshold()?),
            MeasureKind::TimeBelow => Compute::TimeBelow(threshold()?),
            MeasureKind::FirstCrossing => Compute::FirstCrossing(threshold()?),
            MeasureKind::SettlingTime => {
                let (low, high) = parse_bounds("band", self.band.as_ref(), unit)?;
                Compute::SettlingTime(low, high)
            }
            MeasureKind::Changes => Compute::Changes,
            MeasureKind::Percentile => Compute::Percentile(self.percent.unwrap_or_default()),
        })
    }

    /// The limits of a figure in `unit`.
    pub(super) fn limits(&self, unit: &str) -> Result<Limits, Refusal> {
        let (mut at_least, mut at_most) = (None, None);
        if self.within.is_some() {
            let (low, high) = parse_bounds("within", self.within.as_ref(), unit)?;
            (at_least, at_most) = (Some(low), Some(high));
        }
        if self.at_least.is_some() {
            at_least = Some(parse_single("at-least", self.at_least.as_ref(), unit)?);
        }
        if self.at_most.is_some() {
            at_most = Some(parse_single("at-most", self.at_most.as_ref(), unit)?);
        }
        if let (Some(least), Some(most), Some(low), Some(high)) = (&self.at_least, &self.at_most, at_least, at_most)
            && low > high
        {
            return refusal(
                "at-most",
                format!(
                    "{most} is below `at-least`, {least}: no figure meets both; exchange the two, or leave one out"
                ),
            );
        }
        let given = [&self.within, &self.at_most, &self.at_least];
        let stated = given.into_iter().flatten().find_map(Value::as_str);
        let stated = stated.and_then(units::unit_in).unwrap_or(unit);
        Ok(Limits {
            at_most,
            at_least,
            scale: conversion_factor(stated, unit).unwrap_or(1.0),
            unit: stated.to_owned(),
        })
    }
}

fn parse_single(key: &str, value: Option<&Value>, unit: &str) -> Result<f64, Refusal> {
    let value = value.ok_or_else(|| (key.to_owned(), "is missing".to_owned()))?;
    let numbers = values(value, unit, 1).map_err(|reason| (key.to_owned(), reason))?;
    Ok(numbers[0])
}

fn parse_bounds(key: &str, value: Option<&Value>, unit: &str) -> Result<(f64, f64), Refusal> {
    let value = value.ok_or_else(|| (key.to_owned(), "is missing".to_owned()))?;
    let numbers = values(value, unit, 2).map_err(|reason| (key.to_owned(), reason))?;
    match numbers[..] {
        [low, high] if low < high => Ok((low, high)),
        _ => refusal(
            key,
            format!("{value} is not a range: write two bounds, the lower one first, such as \"[-1, 1] {unit}\""),
        ),
    }
}
