//! `[measures.NAME]`: figures that the scenario declares, and their limits.

mod chosen;
mod entry;
mod refusal;

use std::collections::BTreeMap;
use std::path::Path;

use lockstep::time::Rational;
use tape::StreamSpec;
use toml::{Table, Value};

use crate::scenario::error::{Mistake, ScenarioError};
use crate::scenario::recorded::leaves_out;
use crate::scenario::source::{Source, typed};
use chosen::Chosen;
use entry::{MeasureEntry, ThroughWord, Word};
pub use refusal::Refusal;
use refusal::{converted, refusal};

use crate::builtins::HasBuiltins;
use crate::measures::{Definition, Through};

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
        let is = of.is(entry.is.as_ref())?;
        let counted = matches!(entry.compute, Word::Changes | Word::Final | Word::At);
        if is.is_none() && (!counted || entry.through.is_some() || minus.is_some()) {
            of.is_number("of")?;
            minus.iter().try_for_each(|minus| minus.is_number("minus"))?;
        }
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
            of: of.reading(is),
            minus: minus.map(|minus| (minus.reading(None), factor)),
            unit,
            factor: scale,
        })
    }

    /// The participants whose streams it reads, as far as that can be told.
    fn participants(&self) -> impl Iterator<Item = &str> {
        let paths = std::iter::once(&self.entry.of).chain(&self.entry.minus);
        paths.map(|path| path.split('.').next().unwrap_or_default())
    }

    /// The key and the instant of a window that no sample can lie in when the run ends at `end`.
    pub(in crate::scenario) fn late(&self, end: Rational) -> Option<(String, Rational)> {
        let (key, time) = match (self.entry.from, self.entry.at) {
            (Some(from), _) => ("from", from),
            (_, at) => ("at", at?),
        };
        (time > end).then(|| (format!("measures.{}.{key}", self.name), time))
    }

    fn key(&self, (key, reason): Refusal, source: &Source) -> Mistake {
        let dot = if key.is_empty() { "" } else { "." };
        source.mistake(&format!("measures.{}{dot}{key}", self.name), reason)
    }
}

/// Reads all sections, as far as that goes without the streams.
pub(in crate::scenario) fn read(
    source: &Source,
    sections: BTreeMap<String, Value>,
) -> Result<Vec<DeclaredMeasure>, Vec<Mistake>> {
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

/// The measures over `streams`; those that read a participant whose ports are not `certain` are left out.
pub(in crate::scenario) fn definitions(
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
    catalogue: &impl HasBuiltins,
    file: &Path,
    streams: &[StreamSpec],
) -> Result<Vec<Definition>, ScenarioError> {
    let source = Source::read(catalogue.builtins(), file, &[])?;
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

/// The measures of the run whose `plan.toml` is `file`, over the `streams` of its tape.
///
/// # Errors
/// As [`measures_of_file`], and where the tape does not have what the run measured.
pub fn measures_of_plan(
    catalogue: &impl HasBuiltins,
    file: &Path,
    streams: &[StreamSpec],
) -> Result<Vec<Definition>, ScenarioError> {
    let source = Source::read(catalogue.builtins(), file, &[])?;
    if let (Some(Value::Table(record)), Some(Value::Table(sections))) =
        (source.table.get("record"), source.table.get("measures"))
    {
        let declared =
            read(&source, sections.clone().into_iter().collect()).map_err(|mistakes| source.error(mistakes))?;
        let mistakes = declared.iter().filter_map(|measure| {
            let mut paths = std::iter::once(&measure.entry.of).chain(&measure.entry.minus);
            let part = paths.find(|path| {
                let mut names = path.splitn(2, '.');
                let (participant, rest) = (names.next().unwrap_or_default(), names.next().unwrap_or_default());
                leaves_out(record, participant, rest)
            })?;
            let reason = format!(
                "the tape does not have all of `{part}`, because [record] leaves samples out: summary.json has the figure of the run, and \
                 --of measures what the tape has"
            );
            Some(source.mistake(&format!("measures.{}", measure.name), reason))
        });
        let mistakes: Vec<Mistake> = mistakes.collect();
        if !mistakes.is_empty() {
            return Err(source.error(mistakes));
        }
    }
    measures_of_file(catalogue, file, streams)
}
