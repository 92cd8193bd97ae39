//! `[record]`: which samples are recorded. Streams that are not named are recorded whole.

use lockstep::plan::Plan;
use lockstep::time::{Rational, Timebase};
use tape::StreamSpec;

use super::error::{Mistake, ScenarioError};
use super::names::{Names, unknown};
use super::source::SourceContext;
use super::spec::{Entries, RecordPart, RecordSpec, SEEN, ScenarioSpec, Time};
use crate::run::RecordedPart;

/// The entry of a scenario for a stream, or for all streams of a participant.
#[derive(Debug, Clone)]
pub(super) struct RecordRequest {
    /// The key below `record`.
    key: String,
    participant: String,
    /// All streams of the participant if not given.
    port: Option<String>,
    part: RecordSpec,
}

/// Reads the entries, as far as possible without the ports of the participants. The entry for a participant comes before those for
/// its streams.
pub(super) fn read(
    source: &SourceContext,
    participants: &Names,
    record: &Entries<RecordSpec>,
) -> Result<Vec<RecordRequest>, Vec<Mistake>> {
    let (mut requests, mut mistakes) = (Vec::new(), Vec::new());
    for (key, part) in record {
        let (participant, port) = match key.split_once('.') {
            Some((participant, port)) => (participant, Some(port)),
            None => (key.as_str(), None),
        };
        let refused = if !participants.contains(participant) {
            let reason = participants.unknown("participant", participant);
            Err(source.mistake(&format!("record.{participant}"), reason))
        } else if port.is_some() && record.contains_key(participant) {
            let reason = format!(
                "says what is recorded of one stream, and `{participant}` of all of them: leave one of them out"
            );
            Err(source.mistake(&format!("record.{key}"), reason))
        } else if let (None, RecordSpec::Part(_)) = (port, part) {
            let reason =
                format!("a part is one of a stream: name it, such as `{participant}.OUTPUT`, or keep all or nothing");
            Err(source.mistake(&format!("record.{key}"), reason))
        } else {
            check(source, &format!("record.{key}"), part)
        };
        match refused {
            Ok(()) => requests.push(RecordRequest {
                key: key.clone(),
                participant: participant.to_owned(),
                port: port.map(str::to_owned),
                part: part.clone(),
            }),
            Err(mistake) if mistakes.contains(&mistake) => {}
            Err(mistake) => mistakes.push(mistake),
        }
    }
    if mistakes.is_empty() {
        Ok(requests)
    } else {
        Err(mistakes)
    }
}

fn check(source: &SourceContext, key: &str, part: &RecordSpec) -> Result<(), Mistake> {
    let RecordSpec::Part(part) = part else { return Ok(()) };
    if let Some(every) = time(&part.every).filter(|every| !every.is_positive()) {
        return Err(source.mistake(&format!("{key}.every"), format!("{every} must be above zero")));
    }
    match (time(&part.from), time(&part.to)) {
        (Some(from), Some(to)) if to < from => {
            let reason = format!("{to} is before `from`, {from}: nothing would be recorded; write false for that");
            Err(source.mistake(&format!("{key}.to"), reason))
        }
        _ => Ok(()),
    }
}

fn time(time: &Option<Time>) -> Option<Rational> {
    time.as_ref().map(Time::checked)
}

/// The samples of `spec` that `entry` asks for.
fn kept_part(spec: &StreamSpec, part: &RecordPart) -> Result<RecordedPart, (&'static str, String)> {
    let (every, from, to) = (time(&part.every), time(&part.from), time(&part.to));
    let times = [spec.offset, spec.period].into_iter();
    let own = times.chain([every, from, to].into_iter().flatten());
    let base = Timebase::from_times(own).map_err(|error| ("", error.to_string()))?;
    let ticks = |key: &'static str, time: Rational| base.ceil(time).map_err(|error| (key, error.to_string()));
    let (offset, period) = (ticks("", spec.offset)?, ticks("", spec.period)?);
    let every = match every {
        None => 1,
        Some(every) => {
            let every_ticks = ticks("every", every)?;
            if every_ticks % period != 0 {
                let reason = format!(
                    "{every} is not a whole multiple of the period of `{}`, {}",
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
    let first = match from {
        Some(from) => (ticks("from", from)? - offset).max(0).div_euclid(stride) as u64,
        None => 0,
    };
    let exact = from.map(|from| ticks("from", from)).transpose()?;
    let early = exact.is_some_and(|from| offset.saturating_add(stride.saturating_mul(first as i64)) < from);
    let end = match to {
        Some(to) => (ticks("to", to)? - offset).div_euclid(stride).saturating_add(1).max(0) as u64,
        None => u64::MAX,
    };
    Ok(RecordedPart::part(every, first + u64::from(early), end))
}

/// Whether `record` leaves samples of a stream out; `path` is the name of the stream, or of a field of it, without the participant.
pub(super) fn leaves_out(record: &Entries<RecordSpec>, participant: &str, path: &str) -> bool {
    let mut names = path.split('.');
    let stream = match names.next().unwrap_or_default() {
        SEEN => format!("{participant}.{SEEN}.{}", names.next().unwrap_or_default()),
        port => format!("{participant}.{port}"),
    };
    let entry = record.get(participant).or_else(|| record.get(&stream));
    entry.is_some_and(|entry| *entry != RecordSpec::Whole)
}

impl ScenarioSpec {
    /// Whether `[record]` leaves samples of an output out.
    pub(crate) fn leaves_out(&self, participant: &str, port: &str) -> bool {
        leaves_out(&self.record, participant, port)
    }
}

impl RecordRequest {
    /// The key and the time of a window that begins after `end`.
    pub(super) fn window_after_end(&self, end: Rational) -> Option<(String, Rational)> {
        let RecordSpec::Part(part) = &self.part else {
            return None;
        };
        let from = time(&part.from).filter(|from| *from > end)?;
        Some((format!("record.{}.from", self.key), from))
    }

    /// Whether the entry keeps every sample of the streams that it names.
    pub(super) fn is_whole(&self) -> bool {
        self.part == RecordSpec::Whole
    }
}

/// Which samples of each of `streams`, those of `plan`, are recorded; entries for participants whose ports are not `certain` are left
/// out.
pub(super) fn kept_samples(
    requests: &[RecordRequest],
    source: &SourceContext,
    plan: &Plan,
    streams: &[StreamSpec],
    certain: impl Fn(usize) -> bool,
) -> Result<Vec<RecordedPart>, ScenarioError> {
    let (mut all, mut mistakes) = (vec![RecordedPart::WHOLE; streams.len()], Vec::new());
    let (whole_participants, single_streams): (Vec<&RecordRequest>, Vec<&RecordRequest>) =
        requests.iter().partition(|request| request.port.is_none());
    for request in whole_participants.into_iter().chain(single_streams) {
        if !plan.participant(&request.participant).is_some_and(&certain) {
            continue;
        }
        let own = streams
            .iter()
            .enumerate()
            .filter(|(_, spec)| spec.participant == request.participant);
        let matching = own
            .clone()
            .filter(|(_, spec)| request.port.as_ref().is_none_or(|port| *port == spec.port));
        let matching: Vec<(usize, &StreamSpec)> = matching.collect();
        if let (true, Some(port)) = (matching.is_empty(), &request.port) {
            let known: Vec<&String> = own.map(|(_, spec)| &spec.port).collect();
            let reason = unknown("output", port, known.into_iter());
            mistakes.push(source.mistake(&format!("record.{}", request.key), reason));
        }
        for (number, spec) in matching {
            let part = match &request.part {
                RecordSpec::Whole => Ok(RecordedPart::WHOLE),
                RecordSpec::Nothing => Ok(RecordedPart::NOTHING),
                RecordSpec::Part(part) => kept_part(spec, part),
            };
            match part {
                Ok(part) => all[number] = part,
                Err((below, reason)) => {
                    let dot = if below.is_empty() { "" } else { "." };
                    let key = format!("record.{}{dot}{below}", request.key);
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

/// The error that `what` needs samples and `requests` leaves some of them out.
pub(super) fn missing_samples_error(requests: &[RecordRequest], source: &SourceContext, what: &str) -> ScenarioError {
    let first = requests.iter().find(|request| !request.is_whole());
    let named = first
        .map(|request| format!("record.{}", request.key))
        .unwrap_or_default();
    let reason = format!("leaves out samples that {what} needs; keep them, or do without");
    source.error(vec![source.mistake(&named, reason)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn record_table_names_streams_with_samples_left_out() {
        let record = [
            ("a", RecordSpec::Nothing),
            ("b.x", RecordSpec::Whole),
            ("b.y", RecordSpec::every("1 s")),
            ("b.seen.u", RecordSpec::Nothing),
            ("b.seen.v", RecordSpec::Whole),
        ];
        let record: Entries<RecordSpec> = record.map(|(key, part)| (key.to_owned(), part)).into_iter().collect();
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
