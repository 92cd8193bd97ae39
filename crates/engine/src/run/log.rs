//! A participant's log: standard output and standard error, bounded.
//!
//! The participant writes into a pipe, and a thread of this program copies the pipe into the file, up to [`LOG_MAX`] bytes. After
//! that the thread stops reading, and the participant blocks in its next write until the supervisor ends it. So the bound holds
//! whatever the supervisor waits for, and however fast the participant writes.

use std::fs::File;
use std::io::{self, PipeReader, PipeWriter, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::time::Duration;

use crate::text::quoted;

/// A participant that writes more than this to its standard error is stopped.
pub const LOG_MAX: u64 = 64 << 20;
/// The longest wait for the end of a log: a process that the participant has started may keep the pipe open indefinitely.
const ENDS: Duration = Duration::from_millis(100);
/// Bytes per copy.
const PIECE: usize = 1 << 16;

/// The log of one participant.
#[derive(Clone)]
pub(crate) struct Log {
    path: PathBuf,
    flow: Arc<Flow>,
}

/// The state of the copying thread.
#[derive(Default)]
struct Flow {
    full: AtomicBool,
    /// The thread has stopped: at the end of the pipe, or at the bound.
    over: Mutex<bool>,
    is_over: Condvar,
    /// The pipe of a full log. As long as it is open the participant blocks; if it were closed, SIGPIPE would end the participant.
    kept: Mutex<Option<PipeReader>>,
}

impl Log {
    /// Creates the file `path`; returns the log and the pipe to write into.
    pub(crate) fn create(path: &Path) -> io::Result<(Log, PipeWriter)> {
        let file = File::create(path)?;
        let (reader, writer) = io::pipe()?;
        let flow = Arc::new(Flow::default());
        let log = Log {
            path: path.to_owned(),
            flow: flow.clone(),
        };
        std::thread::Builder::new()
            .name("log".into())
            .spawn(move || flow.run(reader, file, LOG_MAX))?;
        Ok((log, writer))
    }

    /// Whether the participant wrote more than [`LOG_MAX`].
    pub(crate) fn is_full(&self) -> bool {
        self.flow.full.load(Ordering::Relaxed)
    }

    /// Waits until the file has everything that was written. To be called after the process has ended.
    pub(crate) fn settle(&self) {
        let over = self.flow.over.lock().unwrap_or_else(PoisonError::into_inner);
        drop(self.flow.is_over.wait_timeout_while(over, ENDS, |over| !*over));
    }

    /// The last lines of the log.
    pub(crate) fn last_lines(&self) -> Vec<String> {
        const TAIL: u64 = 4096;
        let read = || -> io::Result<Vec<u8>> {
            let mut file = File::open(&self.path)?;
            let length = file.metadata()?.len();
            file.seek(SeekFrom::Start(length.saturating_sub(TAIL)))?;
            let mut tail = Vec::new();
            file.take(TAIL).read_to_end(&mut tail)?;
            Ok(tail)
        };
        let text = String::from_utf8_lossy(&read().unwrap_or_default()).into_owned();
        last_of(&text)
    }
}

/// The last non-empty lines of a text.
fn last_of(text: &str) -> Vec<String> {
    let lines: Vec<&str> = text.lines().filter(|line| !line.trim().is_empty()).collect();
    let last = &lines[lines.len().saturating_sub(5)..];
    last.iter().map(|line| (*line).to_owned()).collect()
}

/// The last of `lines` of a participant's log, formatted as the end of a message; empty if there are none.
pub(crate) fn last_lines(lines: &str) -> String {
    match &last_of(lines)[..] {
        [] => String::new(),
        last => format!("; its last lines:\n  | {}", quoted(&last.join("\n"))),
    }
}

impl Flow {
    fn run(&self, reader: PipeReader, file: impl Write, most: u64) {
        if let Some(reader) = self.move_to(reader, file, most) {
            *self.kept.lock().unwrap_or_else(PoisonError::into_inner) = Some(reader);
        }
        *self.over.lock().unwrap_or_else(PoisonError::into_inner) = true;
        self.is_over.notify_all();
    }

    /// Copies the pipe into `file`; returns the pipe if more than `most` bytes came.
    fn move_to(&self, mut reader: PipeReader, mut file: impl Write, most: u64) -> Option<PipeReader> {
        let mut left = most;
        let mut piece = vec![0; PIECE];
        loop {
            let count = match reader.read(&mut piece) {
                Ok(0) => return None,
                Ok(count) => count,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
                Err(_) => return None,
            };
            let fits = left.min(count as u64) as usize;
            // A full disk loses the log; the tape on that disk fails too and ends the run with the reason.
            let _ = file.write_all(&piece[..fits]);
            left -= fits as u64;
            if fits < count {
                self.full.store(true, Ordering::Relaxed);
                return Some(reader);
            }
        }
    }
}

/// The last lines of a log, formatted as the end of a message.
pub(crate) fn words(log: &Log) -> String {
    let lines = log.last_lines();
    if lines.is_empty() {
        "; it wrote nothing".into()
    } else {
        format!("; its last lines:\n  | {}", quoted(&lines.join("\n")))
    }
}

/// The reason of a failure by a full log.
pub(crate) fn flood() -> String {
    format!("wrote more than {} MiB to its standard error", LOG_MAX >> 20)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn log_is_cut_at_its_bound_to_the_byte() {
        for (written, most) in [(0, 5), (4, 5), (5, 5), (6, 5), (3 * PIECE, PIECE + 1), (PIECE, PIECE)] {
            let (reader, mut writer) = io::pipe().unwrap();
            let flow = Flow::default();
            let mut file = Vec::new();
            std::thread::scope(|scope| {
                scope.spawn(|| flow.run(reader, &mut file, most as u64));
                writer.write_all(&vec![7; written.min(most + 1)]).unwrap();
                drop(writer);
            });
            assert_eq!(file.len(), written.min(most), "{written} of {most}");
            assert_eq!(flow.full.load(Ordering::Relaxed), written > most, "{written} of {most}");
        }
    }
}
