//! `[measures.NAME]`: figures that the scenario declares, and their limits.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use lockstep::fault::Slot;
use lockstep::port::Field;
use lockstep::time::Rational;
use lockstep::units;
use report::page::split_unit;
use serde::{Deserialize, Serialize};
use tape::StreamSpec;
use toml::{Table, Value};

use super::error::{Mistake, ScenarioError};
use super::faults::values;
use super::resolve::Scenario;
use super::source::{Source, typed};
use crate::Catalogue;
use crate::assessment::Assessment;
use crate::measures::{Compute, Definition, Limits, Measures, Reading, Through, Together};

/// What is computed, as it is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
enum Word {
    Min,
    Max,
    MaxAbs,
    Mean,
    Rms,
    Final,
    At,
    Range,
    Integral,
    IntegralAbs,
    Rate,
    TimeAbove,
    TimeBelow,
    FirstCrossing,
    SettlingTime,
    Changes,
    Percentile,
}

/// What becomes of the elements, as it is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
enum ThroughWord {
    Norm,
    Angle,
}

/// One section as it is written.
#[derive(Debug, Clone, Deserialize, Serialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
struct MeasureEntry {
    of: String,
    minus: Option<String>,
    through: Option<ThroughWord>,
    compute: Word,
    from: Option<Rational>,
    to: Option<Rational>,
    at: Option<Rational>,
    threshold: Option<Value>,
    band: Option<Value>,
    percent: Option<f64>,
    unit: Option<String>,
    at_most: Option<Value>,
    at_least: Option<Value>,
    within: Option<Value>,
}

/// The key below the measure that is wrong, and why.
pub type Refusal = (String, String);

fn refusal<T>(key: &str, reason: impl Into<String>) -> Result<T, Refusal> {
    Err((key.to_owned(), reason.into()))
}

/// A measure that has been understood as far as that goes without the streams.
#[derive(Debug, Clone)]
pub struct DeclaredMeasure {
    name: String,
    entry: MeasureEntry,
}

/// Names of columns that every table of a campaign has.
const TAKEN: [&str; 6] = ["point", "outcome", "reason", "tape", "seed", "case"];

impl DeclaredMeasure {
    /// The measure `name` that `table` declares.
    ///
    /// # Errors
    /// The key that is wrong, and why.
    pub fn of_table(name: &str, table: Table) -> Result<DeclaredMeasure, Refusal> {
        let entry: MeasureEntry = serde_path_to_error::deserialize(Value::Table(table)).map_err(|error| {
            let path = error.path().to_string();
            let key = if path == "." { String::new() } else { path };
            (key, error.into_inner().message().to_owned())
        })?;
        DeclaredMeasure::new(name, entry)
    }

    fn new(name: &str, entry: MeasureEntry) -> Result<DeclaredMeasure, Refusal> {
        let plain = |b: u8| b.is_ascii_alphanumeric() || b == b'_' || b == b'-';
        if name.is_empty() || !name.bytes().all(plain) {
            return refusal("", "a measure is named with letters, digits, `_` and `-`");
        }
        if TAKEN.contains(&name) {
            return refusal(
                "",
                "every table of a campaign has a column of that name: choose another one",
            );
        }
        entry.check()?;
        Ok(DeclaredMeasure {
            name: name.to_owned(),
            entry,
        })
    }

    /// The measure over `streams`.
    ///
    /// # Errors
    /// The key that does not fit them, and why.
    pub fn resolve(&self, streams: &[StreamSpec]) -> Result<Definition, Refusal> {
        let entry = &self.entry;
        let of = Chosen::find(streams, "of", &entry.of)?;
        let minus = match &entry.minus {
            Some(path) => Some(Chosen::find(streams, "minus", path)?),
            None => None,
        };
        let factor = match &minus {
            Some(minus) => minus.beside(&of)?,
            None => 1.0,
        };
        let signal = match entry.through {
            Some(ThroughWord::Angle) => {
                of.is_attitude("of")?;
                minus.iter().try_for_each(|minus| minus.is_attitude("minus"))?;
                "rad"
            }
            Some(ThroughWord::Norm) if of.slots.len() < 2 => {
                return refusal("through", format!("`{}` is one number: leave `through` out", entry.of));
            }
            _ => of.field.unit.as_str(),
        };
        let own = entry.compute.unit(signal);
        let (unit, scale) = match &entry.unit {
            Some(unit) => (
                unit.clone(),
                converted(&own, unit).map_err(|reason| ("unit".to_owned(), reason))?,
            ),
            None => (own.clone(), 1.0),
        };
        Ok(Definition {
            name: self.name.clone(),
            listed: of.whole && entry.through.is_none() && !of.field.shape.is_empty(),
            through: match entry.through {
                None => Through::Elements,
                Some(ThroughWord::Norm) => Through::Norm,
                Some(ThroughWord::Angle) => Through::Angle,
            },
            compute: entry.computed(signal)?,
            from: entry.from,
            to: entry.to,
            at: entry.at,
            limits: entry.limits(&unit)?,
            of: of.reading(),
            minus: minus.map(|minus| (minus.reading(), factor)),
            unit,
            factor: scale,
        })
    }

    /// The participants whose streams it reads, as far as that can be told.
    fn participants(&self) -> impl Iterator<Item = &str> {
        let paths = std::iter::once(&self.entry.of).chain(&self.entry.minus);
        paths.map(|path| path.split('.').next().unwrap_or_default())
    }

    fn key(&self, (key, reason): Refusal, source: &Source) -> Mistake {
        let dot = if key.is_empty() { "" } else { "." };
        source.mistake(&format!("measures.{}{dot}{key}", self.name), reason)
    }
}

/// What `text` is one of, in the unit `unit`.
fn converted(text: &str, unit: &str) -> Result<f64, String> {
    if text == unit {
        return Ok(1.0);
    }
    let (numbers, _) = units::convert(&format!("1 {text}"), unit).map_err(|error| error.to_string())?;
    Ok(numbers[0])
}

/// One or several elements that a user has named.
struct Chosen<'a> {
    path: &'a str,
    stream: usize,
    field: &'a Field,
    slots: Vec<Slot>,
    /// Whether it is the whole field, not an element of it.
    whole: bool,
}

impl<'a> Chosen<'a> {
    /// `path` is `PARTICIPANT.OUTPUT.FIELD`, or an element of it.
    fn find(streams: &'a [StreamSpec], key: &str, path: &'a str) -> Result<Chosen<'a>, Refusal> {
        let names = || streams.iter().map(StreamSpec::name);
        let rest = |name: &String| path.strip_prefix(name.as_str()).and_then(|rest| rest.strip_prefix('.'));
        let Some(stream) = names().position(|name| rest(&name).is_some()) else {
            let listed: Vec<String> = names().map(|name| format!("`{name}`")).collect();
            let reason = format!(
                "`{path}` is not a field of a stream: write \"PARTICIPANT.OUTPUT.FIELD\", or an element such as \
                 \"PARTICIPANT.OUTPUT.FIELD[2]\"; the streams are {}",
                listed.join(", ")
            );
            return refusal(key, reason);
        };
        let spec = &streams[stream];
        let name = &path[spec.name().len() + 1..];
        let Some((field, slots)) = Slot::named(&spec.descriptor, name) else {
            let known: Vec<String> = spec
                .descriptor
                .fields
                .iter()
                .map(|field| format!("`{field}`"))
                .collect();
            let reason = format!(
                "`{}` has no field or element `{name}`; it has {}",
                spec.name(),
                known.join("; ")
            );
            return refusal(key, reason);
        };
        Ok(Chosen {
            path,
            stream,
            whole: field.name == name,
            field,
            slots,
        })
    }

    fn shape(&self) -> &[u32] {
        if self.whole { &self.field.shape } else { &[] }
    }

    /// What one of this is in the unit of `of`, from which it is taken.
    fn beside(&self, of: &Chosen<'_>) -> Result<f64, Refusal> {
        if self.shape() != of.shape() {
            let reason = format!(
                "`{}` has the shape {:?}, `{}` has {:?}: both must have the same",
                self.path,
                self.shape(),
                of.path,
                of.shape()
            );
            return refusal("minus", reason);
        }
        let (own, other) = (&self.field.frame, &of.field.frame);
        if own != other && !own.is_empty() && !other.is_empty() {
            let reason = format!(
                "`{}` is given in the frame `{own}`, `{}` in `{other}`: what is taken from it must be in the same",
                self.path, of.path
            );
            return refusal("minus", reason);
        }
        converted(&self.field.unit, &of.field.unit).map_err(|_| {
            let reason = format!(
                "`{}` is in {}, `{}` in {}: the units do not fit",
                self.path, self.field.unit, of.path, of.field.unit
            );
            ("minus".to_owned(), reason)
        })
    }

    fn is_attitude(&self, key: &str) -> Result<(), Refusal> {
        if self.slots.len() == 4 && self.field.unit == "1" {
            return Ok(());
        }
        let reason = format!(
            "`{}` is {} numbers in {}; an angle is one of attitudes, each a quaternion of four numbers in 1, the scalar first",
            self.path,
            self.slots.len(),
            self.field.unit
        );
        refusal(key, reason)
    }

    fn reading(&self) -> Reading {
        Reading {
            stream: self.stream,
            slots: self.slots.clone(),
        }
    }
}

impl Word {
    /// The unit of the figure of a signal in `unit`.
    fn unit(self, unit: &str) -> String {
        match self {
            Word::TimeAbove | Word::TimeBelow | Word::FirstCrossing | Word::SettlingTime => "s".to_owned(),
            Word::Changes => "1".to_owned(),
            Word::Integral | Word::IntegralAbs if unit == "1" => "s".to_owned(),
            Word::Integral | Word::IntegralAbs => match unit.strip_suffix("/s") {
                Some(rate) => rate.to_owned(),
                None => format!("{unit} s"),
            },
            Word::Rate => match unit.strip_suffix(" s") {
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

impl MeasureEntry {
    /// That everything is there that the computation needs, and nothing that it does not know.
    fn check(&self) -> Result<(), Refusal> {
        let threshold = matches!(self.compute, Word::TimeAbove | Word::TimeBelow | Word::FirstCrossing);
        for (key, given, needed, example) in [
            ("at", self.at.is_some(), self.compute == Word::At, "\"3 s\""),
            ("threshold", self.threshold.is_some(), threshold, "\"5 mm\""),
            (
                "band",
                self.band.is_some(),
                self.compute == Word::SettlingTime,
                "\"[-2, 2] mm\"",
            ),
            (
                "percent",
                self.percent.is_some(),
                self.compute == Word::Percentile,
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
        if let (Some(from), Some(to)) = (self.from, self.to)
            && from > to
        {
            return refusal("to", format!("{to} is before `from`, {from}: the window is empty"));
        }
        if let Some(percent) = self.percent.filter(|percent| !(0.0..=100.0).contains(percent)) {
            return refusal("percent", format!("{percent} is not between 0 and 100"));
        }
        if self.within.is_some() && (self.at_most.is_some() || self.at_least.is_some()) {
            return refusal("within", "stands for `at-least` and `at-most`: leave those out, or it");
        }
        Ok(())
    }

    /// What is computed of a signal in `unit`.
    fn computed(&self, unit: &str) -> Result<Compute, Refusal> {
        let threshold = || single("threshold", self.threshold.as_ref(), unit);
        Ok(match self.compute {
            Word::Min => Compute::Min,
            Word::Max => Compute::Max,
            Word::MaxAbs => Compute::MaxAbs,
            Word::Mean => Compute::Mean,
            Word::Rms => Compute::Rms,
            Word::Final => Compute::Final,
            Word::At => Compute::At,
            Word::Range => Compute::Range,
            Word::Integral => Compute::Integral,
            Word::IntegralAbs => Compute::IntegralAbs,
            Word::Rate => Compute::Rate,
            Word::TimeAbove => Compute::TimeAbove(threshold()?),
            Word::TimeBelow => Compute::TimeBelow(threshold()?),
            Word::FirstCrossing => Compute::FirstCrossing(threshold()?),
            Word::SettlingTime => {
                let (low, high) = pair("band", self.band.as_ref(), unit)?;
                Compute::SettlingTime(low, high)
            }
            Word::Changes => Compute::Changes,
            Word::Percentile => Compute::Percentile(self.percent.unwrap_or_default()),
        })
    }

    /// The limits of a figure in `unit`.
    fn limits(&self, unit: &str) -> Result<Limits, Refusal> {
        let (mut at_least, mut at_most) = (None, None);
        if self.within.is_some() {
            let (low, high) = pair("within", self.within.as_ref(), unit)?;
            (at_least, at_most) = (Some(low), Some(high));
        }
        if self.at_least.is_some() {
            at_least = Some(single("at-least", self.at_least.as_ref(), unit)?);
        }
        if self.at_most.is_some() {
            at_most = Some(single("at-most", self.at_most.as_ref(), unit)?);
        }
        let given = [&self.within, &self.at_most, &self.at_least];
        let stated = given.into_iter().flatten().find_map(Value::as_str);
        let stated = stated.and_then(units::unit_in).unwrap_or(unit);
        Ok(Limits {
            at_most,
            at_least,
            scale: converted(stated, unit).unwrap_or(1.0),
            unit: stated.to_owned(),
        })
    }
}

fn single(key: &str, value: Option<&Value>, unit: &str) -> Result<f64, Refusal> {
    let value = value.ok_or_else(|| (key.to_owned(), "is missing".to_owned()))?;
    let numbers = values(value, unit, 1).map_err(|reason| (key.to_owned(), reason))?;
    Ok(numbers[0])
}

fn pair(key: &str, value: Option<&Value>, unit: &str) -> Result<(f64, f64), Refusal> {
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

/// Reads all sections, as far as that goes without the streams.
pub(super) fn read(source: &Source, sections: BTreeMap<String, Value>) -> Result<Vec<DeclaredMeasure>, Vec<Mistake>> {
    let (mut measures, mut mistakes) = (Vec::new(), Vec::new());
    for (name, value) in sections {
        let key = format!("measures.{name}");
        let read = typed::<MeasureEntry>(source, &key, value).and_then(|entry| {
            DeclaredMeasure::new(&name, entry).map_err(|(below, reason)| {
                let dot = if below.is_empty() { "" } else { "." };
                source.mistake(&format!("{key}{dot}{below}"), reason)
            })
        });
        match read {
            Ok(measure) => measures.push(measure),
            Err(mistake) => mistakes.push(mistake),
        }
    }
    if mistakes.is_empty() {
        Ok(measures)
    } else {
        Err(mistakes)
    }
}

fn definitions(
    source: &Source,
    declared: &[DeclaredMeasure],
    streams: &[StreamSpec],
    certain: impl Fn(&str) -> bool,
) -> Result<Vec<Definition>, ScenarioError> {
    let (mut definitions, mut mistakes) = (Vec::new(), Vec::new());
    for measure in declared {
        if !measure.participants().all(&certain) {
            continue;
        }
        match measure.resolve(streams) {
            Ok(definition) => definitions.push(definition),
            Err(wrong) => mistakes.push(measure.key(wrong, source)),
        }
    }
    if mistakes.is_empty() {
        Ok(definitions)
    } else {
        Err(source.error(mistakes))
    }
}

/// The measures that the table `measures` of `file` declares, over `streams`. The rest of the file does not matter.
///
/// # Errors
/// Names the lines and keys that are wrong, or do not fit the streams.
pub fn measures_of_file(
    catalogue: &Arc<Catalogue>,
    file: &Path,
    streams: &[StreamSpec],
) -> Result<Vec<Definition>, ScenarioError> {
    let source = Source::read(catalogue, file, &[])?;
    let sections = match source.table.get("measures") {
        Some(Value::Table(sections)) if !sections.is_empty() => sections.clone(),
        _ => {
            let reason = "there is no table [measures.NAME] in it";
            return Err(source.error(vec![source.mistake("measures", reason)]));
        }
    };
    let declared = read(&source, sections.into_iter().collect()).map_err(|mistakes| source.error(mistakes))?;
    definitions(&source, &declared, streams, |_| true)
}

impl Scenario {
    /// The measures over `streams`; those of participants whose ports are not `certain` are left out.
    ///
    /// # Errors
    /// Every measure that does not fit the streams.
    pub fn measures(
        &self,
        streams: &[StreamSpec],
        certain: impl Fn(&str) -> bool,
    ) -> Result<Vec<Definition>, ScenarioError> {
        let known = |name: &str| self.participants.iter().all(|entry| entry.setup.name != name) || certain(name);
        definitions(&self.source, &self.measures, streams, known)
    }

    /// What the run is judged by: the table `assessment` and the measures; `None` where there is neither.
    ///
    /// # Errors
    /// Names the key that is refused.
    pub fn assess(&self, streams: &[StreamSpec]) -> Result<Option<Box<dyn Assessment>>, ScenarioError> {
        let own = || {
            let made = self
                .assessment
                .as_ref()
                .map(|table| self.catalogue().assess(table, streams));
            made.transpose()
                .map_err(|error| self.assessment_refusal(&error.key, &error.reason))
        };
        if self.measures.is_empty() {
            return own();
        }
        let definitions = self.measures(streams, |_| true)?;
        if let Some(mut own) = own()? {
            let figures = own.finish();
            let named = |name: &str| {
                figures
                    .values
                    .keys()
                    .any(|key| key == name || split_unit(key).0 == name)
            };
            if let Some(double) = definitions.iter().find(|definition| named(&definition.name)) {
                let reason = "the assessment has a figure of that name: choose another one";
                let mistake = self.source.mistake(&format!("measures.{}", double.name), reason);
                return Err(self.source.error(vec![mistake]));
            }
        }
        let measures = Measures::new(definitions, streams).map_err(|(name, error)| {
            let mistake = self.source.mistake(&format!("measures.{name}"), error.to_string());
            self.source.error(vec![mistake])
        })?;
        Ok(Some(Box::new(Together::new(own()?, measures))))
    }

    /// Windows that no sample can lie in: key and instant.
    pub(super) fn late_measures(&self) -> impl Iterator<Item = (String, Rational)> {
        self.measures.iter().filter_map(|measure| {
            let (key, time) = match (measure.entry.from, measure.entry.at) {
                (Some(from), _) => ("from", from),
                (_, at) => ("at", at?),
            };
            (time > self.duration).then(|| (format!("measures.{}.{key}", measure.name), time))
        })
    }
}
