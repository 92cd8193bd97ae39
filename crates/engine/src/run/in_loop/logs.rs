//! Logs of the participants in one process: one for each, as a separate process has, and bounded in the same way.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Write;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use lockstep::participant::{Line, Sink};
use tape::folder::RunFolder;

use crate::observer::{Event, Progress};
use crate::run::log::LOG_MAX;

/// Bytes that are kept of each log in memory: the newest ones.
const KEPT: usize = 64 << 10;

/// The logs of a run in one process.
#[derive(Clone)]
pub(crate) struct Said(Arc<Mutex<Logs>>);

struct Logs {
    folder: Option<RunFolder>,
    most: u64,
    of: BTreeMap<String, One>,
    /// Participant and line, until the run's thread reports them: only that thread calls the observer.
    untold: Vec<(String, String)>,
    /// The first participant whose log is full.
    full: Option<String>,
}

#[derive(Default)]
struct One {
    file: Option<File>,
    written: u64,
    newest: String,
}

impl Said {
    /// Logs in `folder`, or in memory.
    pub(crate) fn new(folder: Option<&RunFolder>) -> Said {
        Said::bounded(folder, LOG_MAX)
    }

    fn bounded(folder: Option<&RunFolder>, most: u64) -> Said {
        Said(Arc::new(Mutex::new(Logs {
            folder: folder.cloned(),
            most,
            of: BTreeMap::new(),
            untold: Vec::new(),
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
    pub(crate) fn tell(&self, progress: &Progress) {
        let untold = std::mem::take(&mut self.logs().untold);
        for (participant, line) in &untold {
            progress.report(Event::Said { participant, line });
        }
    }

    /// The participant whose log is full, if there is one.
    pub(crate) fn full(&self) -> Option<String> {
        self.logs().full.clone()
    }

    /// The logs that are kept in memory, by participant; none of participants whose log is a file.
    pub(crate) fn kept(&self) -> BTreeMap<String, String> {
        let logs = self.logs();
        let some = logs.of.iter().filter(|(_, one)| one.file.is_none());
        some.map(|(name, one)| (name.clone(), one.newest.clone())).collect()
    }

    /// The newest lines that a participant has logged.
    pub(crate) fn newest(&self, participant: &str) -> String {
        self.logs()
            .of
            .get(participant)
            .map(|one| one.newest.clone())
            .unwrap_or_default()
    }
}

impl Sink for Said {
    fn say(&self, line: &Line<'_>) {
        let mut logs = self.logs();
        let Logs {
            folder,
            most,
            of,
            untold,
            full,
        } = &mut *logs;
        if !of.contains_key(line.participant) {
            let path = folder.as_ref().map(|folder| folder.stderr(line.participant));
            // If the file cannot be made, the newest lines are kept in memory: the tape in the same folder reports a full disk.
            let file = path.and_then(|path| {
                std::fs::create_dir_all(path.parent()?).ok()?;
                File::options().create(true).append(true).open(path).ok()
            });
            let one = One { file, ..One::default() };
            of.insert(line.participant.to_owned(), one);
        }
        let Some(one) = of.get_mut(line.participant) else {
            return;
        };
        let text = format!("{line}\n");
        let left = usize::try_from(*most - one.written).unwrap_or(usize::MAX);
        let fits = &text.as_bytes()[..text.len().min(left)];
        one.written += fits.len() as u64;
        if !fits.is_empty() {
            untold.push((line.participant.to_owned(), line.to_string()));
        }
        if fits.len() < text.len() && full.is_none() {
            *full = Some(line.participant.to_owned());
        }
        if let Some(file) = &mut one.file {
            let _ = file.write_all(fits);
        }
        one.newest.push_str(&String::from_utf8_lossy(fits));
        if one.newest.len() > 2 * KEPT {
            let from = one.newest.len() - KEPT;
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

    fn say(said: &Said, text: &str) {
        let (participant, t) = ("a", Some(0.5));
        said.say(&Line {
            participant,
            t,
            text: format_args!("{text}"),
        });
    }

    #[test]
    fn log_is_cut_at_its_bound_to_the_byte() {
        for most in [0, 10, 22, 23, 40] {
            let said = Said::bounded(None, most);
            say(&said, "four");
            let whole = "a at t = 0.5 s: four\n";
            let cut = &whole[..whole.len().min(most as usize)];
            assert_eq!(said.kept()["a"], cut);
            assert_eq!(said.full().is_some(), whole.len() > most as usize, "{most}");
        }
    }

    #[test]
    fn newest_lines_are_kept_whole_where_there_is_no_folder() {
        let said = Said::bounded(None, u64::MAX);
        for number in 0..20_000 {
            say(&said, &format!("line {number} ä"));
        }
        let kept = &said.kept()["a"];
        assert!(kept.len() <= 2 * KEPT + 64 && kept.len() >= KEPT / 2, "{}", kept.len());
        assert!(kept.starts_with("a at t = 0.5 s: line ") && kept.ends_with("line 19999 ä\n"));
    }
}
