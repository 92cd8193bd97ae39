//! `[record]`: what is kept of the samples. Everything that is not named is kept whole.

use lockstep::plan::Plan;
use lockstep::time::{Rational, Timebase};
use serde::{Deserialize, Serialize};
use tape::StreamSpec;
use toml::{Table, Value};

use super::error::{Mistake, ScenarioError};
use super::names::{Names, unknown};
use super::source::{Source, typed};
use crate::run::Kept;

/// What stands before an input in the name of the stream that has what a participant saw there.
const SEEN: &str = "seen";

/// What a scenario says of a stream, or of all of a participant's.
#[derive(Debug, Clone)]
pub(super) struct Wish {
    /// The key below `record`.
    key: String,
    participant: String,
    /// All streams of the participant when not given.
    port: Option<String>,
    part: Part,
}

#[derive(Debug, Clone)]
enum Part {
    Whole,
    Nothing,
    Some(PartEntry),
}

/// A part of a stream as it is written.
#[derive(Debug, Clone, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct PartEntry {
    every: Option<Rational>,
    from: Option<Rational>,
    to: Option<Rational>,
}

/// Reads the table, as far as that goes without the ports of the participants. What is said of a participant comes before what is said
/// of its streams.
pub(super) fn read(source: &Source, participants: &Names, table: Option<Table>) -> Result<Vec<Wish>, Vec<Mistake>> {
    let (mut wishes, mut mistakes) = (Vec::new(), Vec::new());
    for (participant, value) in table.into_iter().flatten() {
        if !participants.contains(&participant) {
            let reason = participants.unknown("participant", &participant);
            mistakes.push(source.mistake(&format!("record.{participant}"), reason));
            continue;
        }
        let mut wish = |port: Option<String>, part: Result<Part, Mistake>| {
            let key = port
                .iter()
                .fold(participant.clone(), |key, port| format!("{key}.{port}"));
            let participant = participant.clone();
            match part {
                Ok(part) => wishes.push(Wish {
                    key,
                    participant,
                    port,
                    part,
                }),
                Err(mistake) => mistakes.push(mistake),
            }
        };
        let Value::Table(ports) = value else {
            wish(None, part(source, &format!("record.{participant}"), value));
            continue;
        };
        for (port, value) in ports {
            match value {
                Value::Table(inputs) if port == SEEN => {
                    for (input, value) in inputs {
                        let port = format!("{SEEN}.{input}");
                        let part = part(source, &format!("record.{participant}.{port}"), value);
                        wish(Some(port), part);
                    }
                }
                value => {
                    let part = part(source, &format!("record.{participant}.{port}"), value);
                    wish(Some(port), part);
                }
            }
        }
    }
    if mistakes.is_empty() { Ok(wishes) } else { Err(mistakes) }
}

fn part(source: &Source, key: &str, value: Value) -> Result<Part, Mistake> {
    match value {
        Value::Boolean(true) => Ok(Part::Whole),
        Value::Boolean(false) => Ok(Part::Nothing),
        Value::Table(_) => {
            let entry: PartEntry = typed(source, key, value)?;
            if let Some(every) = entry.every.filter(|every| !every.is_positive()) {
                return Err(source.mistake(&format!("{key}.every"), format!("{every} must be above zero")));
            }
            match (entry.from, entry.to) {
                (Some(from), Some(to)) if to < from => {
                    let reason = format!("{to} is before `from`, {from}: nothing would be kept; write false for that");
                    Err(source.mistake(&format!("{key}.to"), reason))
                }
                _ => Ok(Part::Some(entry)),
            }
        }
        other => {
            let reason = format!(
                "{other} says nothing of what is kept: write false, true, or a table such as {{ every = \"10 ms\", from = \"2 s\", to = \"5 s\" }}"
            );
            Err(source.mistake(key, reason))
        }
    }
}

/// The part of `spec` that `entry` asks for.
fn kept(spec: &StreamSpec, entry: &PartEntry) -> Result<Kept, (&'static str, String)> {
    let times = [spec.offset, spec.period].into_iter();
    let own = times.chain([entry.every, entry.from, entry.to].into_iter().flatten());
    let base = Timebase::measuring(own).map_err(|error| ("", error.to_string()))?;
    let ticks = |key: &'static str, time: Rational| base.ceil(time).map_err(|error| (key, error.to_string()));
    let (offset, period) = (ticks("", spec.offset)?, ticks("", spec.period)?);
    let every = match entry.every {
        None => 1,
        Some(every) => {
            let every_ticks = ticks("every", every)?;
            if every_ticks % period != 0 {
                let reason = format!(
                    "{every} is no whole multiple of the period of `{}`, {}",
                    spec.name(),
                    spec.period
                );
                return Err(("every", reason));
            }
            (every_ticks / period) as u64
        }
    };
    let stride = period.saturating_mul(every as i64);
    // All of these are whole ticks.
    let first = match entry.from {
        Some(from) => (ticks("from", from)? - offset).max(0).div_euclid(stride) as u64,
        None => 0,
    };
    let exact = entry.from.map(|from| ticks("from", from)).transpose()?;
    let early = exact.is_some_and(|from| offset.saturating_add(stride.saturating_mul(first as i64)) < from);
    let end = match entry.to {
        Some(to) => (ticks("to", to)? - offset).div_euclid(stride).saturating_add(1).max(0) as u64,
        None => u64::MAX,
    };
    Ok(Kept::part(every, first + u64::from(early), end))
}

/// Whether the table `record` leaves samples of a stream out; `path` is the name of the stream or of a field of it, below `participant`.
pub(super) fn leaves_out(record: &Table, participant: &str, path: &str) -> bool {
    let said = match record.get(participant) {
        Some(Value::Table(ports)) => {
            let mut names = path.split('.');
            let port = names.next().unwrap_or_default();
            match ports.get(port) {
                Some(Value::Table(inputs)) if port == SEEN => inputs.get(names.next().unwrap_or_default()),
                said => said,
            }
        }
        said => said,
    };
    said.is_some_and(|said| *said != Value::Boolean(true))
}

impl Wish {
    /// Whether every sample of what it names is kept.
    pub(super) fn is_whole(&self) -> bool {
        matches!(self.part, Part::Whole)
    }
}

/// What is kept of each of `streams`, those of `plan`; what concerns participants whose ports are not `certain` is left out.
pub(super) fn of_streams(
    wishes: &[Wish],
    source: &Source,
    plan: &Plan,
    streams: &[StreamSpec],
    certain: impl Fn(usize) -> bool,
) -> Result<Vec<Kept>, ScenarioError> {
    let (mut all, mut mistakes) = (vec![Kept::WHOLE; streams.len()], Vec::new());
    let (general, single): (Vec<&Wish>, Vec<&Wish>) = wishes.iter().partition(|wish| wish.port.is_none());
    for wish in general.into_iter().chain(single) {
        if !plan.participant(&wish.participant).is_some_and(&certain) {
            continue;
        }
        let own = streams
            .iter()
            .enumerate()
            .filter(|(_, spec)| spec.participant == wish.participant);
        let meant = own
            .clone()
            .filter(|(_, spec)| wish.port.as_ref().is_none_or(|port| *port == spec.port));
        let meant: Vec<(usize, &StreamSpec)> = meant.collect();
        if let (true, Some(port)) = (meant.is_empty(), &wish.port) {
            let known: Vec<&String> = own.map(|(_, spec)| &spec.port).collect();
            let reason = unknown("output", port, known.into_iter());
            mistakes.push(source.mistake(&format!("record.{}", wish.key), reason));
        }
        for (number, spec) in meant {
            let part = match &wish.part {
                Part::Whole => Ok(Kept::WHOLE),
                Part::Nothing => Ok(Kept::NOTHING),
                Part::Some(entry) => kept(spec, entry),
            };
            match part {
                Ok(part) => all[number] = part,
                Err((below, reason)) => {
                    let dot = if below.is_empty() { "" } else { "." };
                    let key = format!("record.{}{dot}{below}", wish.key);
                    mistakes.push(source.mistake(&key, reason));
                }
            }
        }
    }
    if mistakes.is_empty() {
        Ok(all)
    } else {
        Err(source.error(mistakes))
    }
}

/// That `what` needs samples of which `wishes` leave some out.
pub(super) fn needed(wishes: &[Wish], source: &Source, what: &str) -> ScenarioError {
    let first = wishes.iter().find(|wish| !wish.is_whole());
    let named = first.map(|wish| format!("record.{}", wish.key)).unwrap_or_default();
    let reason = format!("leaves out samples that {what} needs; keep them, or do without");
    source.error(vec![source.mistake(&named, reason)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn table_says_which_streams_are_not_whole() {
        let record = "a = false\nb.x = true\nb.y = { every = '1 s' }\nb.seen.u = false\nb.seen.v = true";
        let record: Table = record.parse().unwrap();
        let left_out = |path: &str| {
            let (participant, rest) = path.split_once('.').unwrap();
            leaves_out(&record, participant, rest)
        };
        for path in ["a.x", "a.x.p", "b.y", "b.y.every", "b.seen.u.p"] {
            assert!(left_out(path), "{path}");
        }
        for path in ["b.x.p", "b.z", "b.seen.v", "b.seen.w.p", "c.x"] {
            assert!(!left_out(path), "{path}");
        }
    }
}
