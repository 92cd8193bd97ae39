//! Logs of the participants in one process: one for each, as a separate process has, and bounded in the same way.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Write;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use lockstep::participant::{Line, Sink};
use tape::folder::RunFolder;

use crate::observer::{Event, Progress};
use crate::run::log::LOG_MAX;

/// Bytes that are retained of each log in memory: the newest ones.
const KEPT_BYTES: usize = 64 << 10;

/// The logs of a run in one process.
#[derive(Clone)]
pub(crate) struct SharedLogs(Arc<Mutex<Logs>>);

struct Logs {
    folder: Option<RunFolder>,
    max_bytes: u64,
    by_participant: BTreeMap<String, ParticipantLog>,
    /// Participant and line, until the run's thread reports them: only that thread calls the observer.
    unreported: Vec<(String, String)>,
    /// The first participant whose log is full.
    full: Option<String>,
}

#[derive(Default)]
struct ParticipantLog {
    file: Option<File>,
    written: u64,
    newest: String,
}

impl SharedLogs {
    /// Logs in `folder`, or in memory.
    pub(crate) fn new(folder: Option<&RunFolder>) -> SharedLogs {
        SharedLogs::bounded(folder, LOG_MAX)
    }

    fn bounded(folder: Option<&RunFolder>, max_bytes: u64) -> SharedLogs {
        SharedLogs(Arc::new(Mutex::new(Logs {
            folder: folder.cloned(),
            max_bytes,
            by_participant: BTreeMap::new(),
            unreported: Vec::new(),
            full: None,
        })))
    }

    /// The sink into which participants log.
    pub(crate) fn sink(&self) -> Arc<dyn Sink> {
        Arc::new(self.clone())
    }

    fn logs(&self) -> MutexGuard<'_, Logs> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Reports to `progress` the lines that were logged since the last call.
    pub(crate) fn report_to(&self, progress: &Progress) {
        let unreported = std::mem::take(&mut self.logs().unreported);
        for (participant, line) in &unreported {
            progress.report(Event::LogLine { participant, line });
        }
    }

    /// The participant whose log is full, if there is one.
    pub(crate) fn full(&self) -> Option<String> {
        self.logs().full.clone()
    }

    /// The logs that are retained in memory, by participant; none of participants whose log is a file.
    pub(crate) fn in_memory(&self) -> BTreeMap<String, String> {
        let logs = self.logs();
        let some = logs.by_participant.iter().filter(|(_, one)| one.file.is_none());
        some.map(|(name, one)| (name.clone(), one.newest.clone())).collect()
    }

    /// The newest lines that a participant has logged.
    pub(crate) fn newest(&self, participant: &str) -> String {
        self.logs()
            .by_participant
            .get(participant)
            .map(|one| one.newest.clone())
            .unwrap_or_default()
    }
}

impl Sink for SharedLogs {
    fn write_line(&self, line: &Line<'_>) {
        let mut logs = self.logs();
        let Logs {
            folder,
            max_bytes,
            by_participant,
            unreported,
            full,
        } = &mut *logs;
        if !by_participant.contains_key(line.participant) {
            let path = folder.as_ref().map(|folder| folder.stderr(line.participant));
            // If the file cannot be made, the newest lines are kept in memory: the tape in the same folder reports a full disk.
            let file = path.and_then(|path| {
                std::fs::create_dir_all(path.parent()?).ok()?;
                File::options().create(true).append(true).open(path).ok()
            });
            let one = ParticipantLog {
                file,
                ..ParticipantLog::default()
            };
            by_participant.insert(line.participant.to_owned(), one);
        }
        let Some(one) = by_participant.get_mut(line.participant) else {
            return;
        };
        let text = format!("{line}\n");
        let left = usize::try_from(*max_bytes - one.written).unwrap_or(usize::MAX);
        let fits = &text.as_bytes()[..text.len().min(left)];
        one.written += fits.len() as u64;
        if !fits.is_empty() {
            unreported.push((line.participant.to_owned(), line.to_string()));
        }
        if fits.len() < text.len() && full.is_none() {
            *full = Some(line.participant.to_owned());
        }
        if let Some(file) = &mut one.file {
            let _ = file.write_all(fits);
        }
        one.newest.push_str(&String::from_utf8_lossy(fits));
        if one.newest.len() > 2 * KEPT_BYTES {
            let from = one.newest.len() - KEPT_BYTES;
            // Behind a line's end, or in a line that is longer than all that is kept.
            let end = one.newest.bytes().skip(from).position(|byte| byte == b'\n');
            let from = end.map_or(from, |at| from + at + 1);
            let from = (from..).find(|at| one.newest.is_char_boundary(*at)).unwrap_or(from);
            one.newest.drain(..from);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn say(logs: &SharedLogs, text: &str) {
        let (participant, t) = ("a", Some(0.5));
        logs.write_line(&Line {
            participant,
            t,
            text: format_args!("{text}"),
        });
    }

    #[test]
    fn log_is_cut_at_its_bound_to_the_byte() {
        for max_bytes in [0, 10, 22, 23, 40] {
            let logs = SharedLogs::bounded(None, max_bytes);
            say(&logs, "four");
            let whole = "a at t = 0.5 s: four\n";
            let cut = &whole[..whole.len().min(max_bytes as usize)];
            assert_eq!(logs.in_memory()["a"], cut);
            assert_eq!(logs.full().is_some(), whole.len() > max_bytes as usize, "{max_bytes}");
        }
    }

    #[test]
    fn log_without_folder_keeps_newest_lines_whole() {
        let logs = SharedLogs::bounded(None, u64::MAX);
        for number in 0..20_000 {
            say(&logs, &format!("line {number} ä"));
        }
        let in_memory = &logs.in_memory()["a"];
        assert!(
            in_memory.len() <= 2 * KEPT_BYTES + 64 && in_memory.len() >= KEPT_BYTES / 2,
            "{}",
            in_memory.len()
        );
        assert!(in_memory.starts_with("a at t = 0.5 s: line ") && in_memory.ends_with("line 19999 ä\n"));
    }
}
