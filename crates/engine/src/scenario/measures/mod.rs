//! `[measures.NAME]`: figures declared by the scenario, and their limits.

mod entry;
mod refusal;
mod selected_elements;

use std::path::Path;

use lockstep::time::Rational;
use tape::StreamSpec;
use toml::{Table, Value};

use crate::scenario::error::{Mistake, ScenarioError};
use crate::scenario::recorded::leaves_out;
use crate::scenario::spec::{Entries, MeasureKind, MeasureSpec, Origin, ThroughKind, Time};
use crate::scenario::spec::{MeasureTables, read_measures};
use crate::scenario::value::toml_reason;
pub use refusal::Refusal;
use refusal::{conversion_factor, refusal};
use selected_elements::SelectedElements;

use crate::measures::{Definition, Through};

/// A measure, resolved as far as possible without the streams.
#[derive(Debug, Clone)]
pub struct DeclaredMeasure {
    name: String,
    entry: MeasureSpec,
}

/// Names of columns that every table of a campaign has.
const RESERVED_NAMES: [&str; 6] = ["point", "outcome", "reason", "tape", "seed", "case"];

impl DeclaredMeasure {
    /// The measure `name` that `table` declares.
    ///
    /// # Errors
    /// The key that is wrong, and why.
    pub fn of_table(name: &str, table: Table) -> Result<DeclaredMeasure, Refusal> {
        let entry: MeasureSpec = serde_path_to_error::deserialize(Value::Table(table)).map_err(|error| {
            let path = error.path().to_string();
            let key = if path == "." { String::new() } else { path };
            (key, toml_reason(&error.into_inner()))
        })?;
        DeclaredMeasure::new(name, entry)
    }

    fn new(name: &str, entry: MeasureSpec) -> Result<DeclaredMeasure, Refusal> {
        let plain = |b: u8| b.is_ascii_alphanumeric() || b == b'_' || b == b'-';
        if name.is_empty() || !name.bytes().all(plain) {
            return refusal("", "a measure is named with letters, digits, `_` and `-`");
        }
        if RESERVED_NAMES.contains(&name) {
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

    /// The measure, resolved for `streams`.
    ///
    /// # Errors
    /// The key that does not fit them, and why.
    pub fn resolve(&self, streams: &[StreamSpec]) -> Result<Definition, Refusal> {
        let entry = &self.entry;
        let of = SelectedElements::find(streams, "of", &entry.of)?;
        let minus = match &entry.minus {
            Some(path) => Some(SelectedElements::find(streams, "minus", path)?),
            None => None,
        };
        let is = of.enum_value(entry.is.as_ref())?;
        let content = of.field.element.room().is_some();
        let counted = entry.compute == MeasureKind::Changes
            || !content && matches!(entry.compute, MeasureKind::Final | MeasureKind::At);
        if is.is_none() && (!counted || entry.through.is_some() || minus.is_some()) {
            of.check_number("of")?;
            minus.iter().try_for_each(|minus| minus.check_number("minus"))?;
        }
        let factor = match &minus {
            Some(minus) => minus.factor_into(&of)?,
            None => 1.0,
        };
        let signal = match entry.through {
            Some(ThroughKind::Angle) => {
                of.check_attitude("of")?;
                minus.iter().try_for_each(|minus| minus.check_attitude("minus"))?;
                "rad"
            }
            Some(ThroughKind::Norm) if of.slots.len() < 2 => {
                return refusal("through", format!("`{}` is one number: leave `through` out", entry.of));
            }
            _ => of.field.unit.as_str(),
        };
        let own = entry.compute.unit(signal);
        let (unit, scale) = match &entry.unit {
            Some(unit) => (
                unit.clone(),
                conversion_factor(&own, unit).map_err(|reason| ("unit".to_owned(), reason))?,
            ),
            None => (own.clone(), 1.0),
        };
        Ok(Definition {
            name: self.name.clone(),
            listed: of.whole && entry.through.is_none() && !of.field.shape.is_empty(),
            through: match entry.through {
                None => Through::Elements,
                Some(ThroughKind::Norm) => Through::Norm,
                Some(ThroughKind::Angle) => Through::Angle,
            },
            compute: entry.computation(signal)?,
            from: entry.from.as_ref().map(Time::checked),
            to: entry.to.as_ref().map(Time::checked),
            at: entry.at.as_ref().map(Time::checked),
            limits: entry.limits(&unit)?,
            of: of.reading(is),
            minus: minus.map(|minus| (minus.reading(None), factor)),
            unit,
            factor: scale,
        })
    }

    /// The participants whose streams it reads, as far as that can be determined.
    fn participants(&self) -> impl Iterator<Item = &str> {
        let paths = std::iter::once(&self.entry.of).chain(&self.entry.minus);
        paths.map(|path| path.split('.').next().unwrap_or_default())
    }

    /// The key and the instant of a window that cannot contain any sample when the run ends at `end`.
    pub(in crate::scenario) fn window_after_end(&self, end: Rational) -> Option<(String, Rational)> {
        let time = |time: &Option<Time>| time.as_ref().map(Time::checked);
        let (key, time) = match (time(&self.entry.from), time(&self.entry.at)) {
            (Some(from), _) => ("from", from),
            (_, at) => ("at", at?),
        };
        (time > end).then(|| (format!("measures.{}.{key}", self.name), time))
    }

    fn mistake(&self, (key, reason): Refusal, origin: &Origin) -> Mistake {
        let dot = if key.is_empty() { "" } else { "." };
        origin.mistake(&format!("measures.{}{dot}{key}", self.name), reason)
    }
}

/// Reads all sections, as far as possible without the streams.
pub(in crate::scenario) fn read(
    origin: &Origin,
    sections: &Entries<MeasureSpec>,
) -> Result<Vec<DeclaredMeasure>, Vec<Mistake>> {
    let (mut measures, mut mistakes) = (Vec::new(), Vec::new());
    for (name, entry) in sections {
        let read = DeclaredMeasure::new(name, entry.clone()).map_err(|(below, reason)| {
            let dot = if below.is_empty() { "" } else { "." };
            origin.mistake(&format!("measures.{name}{dot}{below}"), reason)
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

/// The measures, resolved for `streams`; those that read a participant whose ports are not `certain` are left out.
pub(in crate::scenario) fn definitions(
    origin: &Origin,
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
            Err(wrong) => mistakes.push(measure.mistake(wrong, origin)),
        }
    }
    if mistakes.is_empty() {
        Ok(definitions)
    } else {
        Err(origin.error(mistakes))
    }
}

/// The measures that the table `measures` of `file` declares, resolved for `streams`. The rest of the file does not matter.
///
/// # Errors
/// Reports the lines and keys that are wrong, or that do not fit the streams.
pub fn measures_of_file(file: &Path, streams: &[StreamSpec]) -> Result<Vec<Definition>, ScenarioError> {
    let (declared, MeasureTables { origin, .. }) = declared(file)?;
    definitions(&origin, &declared, streams, |_| true)
}

/// The measures of the run whose `plan.toml` is `file`, resolved for the `streams` of its tape.
///
/// # Errors
/// As [`measures_of_file`], and if the tape does not have the samples that the run measured.
pub fn measures_of_plan(file: &Path, streams: &[StreamSpec]) -> Result<Vec<Definition>, ScenarioError> {
    let (declared, MeasureTables { origin, record, .. }) = declared(file)?;
    let mistakes = declared.iter().filter_map(|measure| {
        let mut paths = std::iter::once(&measure.entry.of).chain(&measure.entry.minus);
        let part = paths.find(|path| {
            let mut names = path.splitn(2, '.');
            let (participant, rest) = (names.next().unwrap_or_default(), names.next().unwrap_or_default());
            leaves_out(&record, participant, rest)
        })?;
        let reason = format!(
            "the tape does not have all of `{part}`, because [record] leaves samples out: summary.json has the figure of the run, and \
             --of measures what the tape has"
        );
        Some(origin.mistake(&format!("measures.{}", measure.name), reason))
    });
    let mistakes: Vec<Mistake> = mistakes.collect();
    if !mistakes.is_empty() {
        return Err(origin.error(mistakes));
    }
    definitions(&origin, &declared, streams, |_| true)
}

/// The measures that `file` declares; there must be at least one.
fn declared(file: &Path) -> Result<(Vec<DeclaredMeasure>, MeasureTables), ScenarioError> {
    let found = read_measures(file)?;
    if found.measures.is_empty() {
        let reason = "there is no table [measures.NAME] in it";
        return Err(found.origin.error(vec![found.origin.mistake("measures", reason)]));
    }
    let declared = read(&found.origin, &found.measures).map_err(|mistakes| found.origin.error(mistakes))?;
    Ok((declared, found))
}
