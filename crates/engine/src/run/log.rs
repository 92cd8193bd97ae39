//! A participant's log: standard output and standard error, bounded.
//!
//! The participant writes into a pipe, and a thread of this program copies the pipe into the file, up to [`LOG_MAX`] bytes. After
//! that the thread stops reading, and the participant blocks in its next write until the supervisor ends it. So the bound holds
//! whatever the supervisor waits for, and however fast the participant writes.

use std::fs::{File, OpenOptions};
use std::io::{self, PipeReader, PipeWriter, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::time::Duration;

use crate::text::quoted;

/// A participant that writes more than this to standard error is stopped.
pub const LOG_MAX: u64 = 64 << 20;
/// The longest wait for the end of a log: a process that the participant has started may keep the pipe open indefinitely.
const COMPLETION_TIMEOUT: Duration = Duration::from_millis(100);
/// Bytes per copy.
const CHUNK_BYTES: usize = 1 << 16;

/// The log of one participant.
#[derive(Clone)]
pub(crate) struct Log {
    path: PathBuf,
    copier: Arc<LogCopier>,
}

/// The state of the copying thread.
#[derive(Default)]
struct LogCopier {
    full: AtomicBool,
    /// The thread has stopped: at the end of the pipe, or at the bound.
    finished: Mutex<bool>,
    finished_signal: Condvar,
    /// The pipe of a full log. As long as it is open the participant blocks; if it were closed, SIGPIPE would end the participant.
    blocked_pipe: Mutex<Option<PipeReader>>,
}

impl Log {
    /// Creates the file `path`; returns the log and the pipe to write into.
    pub(crate) fn create(path: &Path) -> io::Result<(Log, PipeWriter)> {
        let file = File::create(path)?;
        let (reader, writer) = io::pipe()?;
        let copier = Arc::new(LogCopier::default());
        let log = Log {
            path: path.to_owned(),
            copier: copier.clone(),
        };
        std::thread::Builder::new()
            .name("log".into())
            .spawn(move || copier.run(reader, file, LOG_MAX))?;
        Ok((log, writer))
    }

    /// Whether the participant wrote more than [`LOG_MAX`].
    pub(crate) fn is_full(&self) -> bool {
        self.copier.full.load(Ordering::Relaxed)
    }

    /// Waits until the file has everything that was written. To be called after the process has ended.
    pub(crate) fn wait_complete(&self) {
        let finished = self.copier.finished.lock().unwrap_or_else(PoisonError::into_inner);
        drop(
            self.copier
                .finished_signal
                .wait_timeout_while(finished, COMPLETION_TIMEOUT, |finished| !*finished),
        );
    }

    /// Adds a line of this program. To be called when the log is complete; without a file there is none.
    pub(crate) fn append(&self, line: &str) {
        let file = OpenOptions::new().append(true).open(&self.path);
        let _ = file.and_then(|mut file| file.write_all(line.as_bytes()));
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
        tail_lines(&text)
    }
}

/// The last non-empty lines of a text.
fn tail_lines(text: &str) -> Vec<String> {
    let lines: Vec<&str> = text.lines().filter(|line| !line.trim().is_empty()).collect();
    let last = &lines[lines.len().saturating_sub(5)..];
    last.iter().map(|line| (*line).to_owned()).collect()
}

/// The last of `lines` of a participant's log, formatted as the end of a message; empty if there are none.
pub(crate) fn last_lines(lines: &str) -> String {
    match &tail_lines(lines)[..] {
        [] => String::new(),
        last => format!("; its last lines:\n  | {}", quoted(&last.join("\n"))),
    }
}

impl LogCopier {
    fn run(&self, reader: PipeReader, file: impl Write, max_bytes: u64) {
        if let Some(reader) = self.copy_until_full(reader, file, max_bytes) {
            *self.blocked_pipe.lock().unwrap_or_else(PoisonError::into_inner) = Some(reader);
        }
        *self.finished.lock().unwrap_or_else(PoisonError::into_inner) = true;
        self.finished_signal.notify_all();
    }

    /// Copies the pipe into `file`; returns the pipe if more than `max_bytes` bytes came.
    fn copy_until_full(&self, mut reader: PipeReader, mut file: impl Write, max_bytes: u64) -> Option<PipeReader> {
        let mut left = max_bytes;
        let mut chunk = vec![0; CHUNK_BYTES];
        loop {
            let count = match reader.read(&mut chunk) {
                Ok(0) => return None,
                Ok(count) => count,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
                Err(_) => return None,
            };
            let fits = left.min(count as u64) as usize;
            // A full disk loses the log; the tape on that disk fails too and ends the run with the reason.
            let _ = file.write_all(&chunk[..fits]);
            left -= fits as u64;
            if fits < count {
                self.full.store(true, Ordering::Relaxed);
                return Some(reader);
            }
        }
    }
}

/// The last lines of a log, formatted as the end of a message.
pub(crate) fn tail_message(log: &Log) -> String {
    let lines = log.last_lines();
    if lines.is_empty() {
        "; it wrote nothing".into()
    } else {
        format!("; its last lines:\n  | {}", quoted(&lines.join("\n")))
    }
}

/// The reason of a failure by a full log.
pub(crate) fn full_log_reason() -> String {
    format!("wrote more than {} MiB to standard error", LOG_MAX >> 20)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn log_is_cut_at_its_bound_to_the_byte() {
        for (written, max_bytes) in [
            (0, 5),
            (4, 5),
            (5, 5),
            (6, 5),
            (3 * CHUNK_BYTES, CHUNK_BYTES + 1),
            (CHUNK_BYTES, CHUNK_BYTES),
        ] {
            let (reader, mut writer) = io::pipe().unwrap();
            let copier = LogCopier::default();
            let mut file = Vec::new();
            std::thread::scope(|scope| {
                scope.spawn(|| copier.run(reader, &mut file, max_bytes as u64));
                writer.write_all(&vec![7; written.min(max_bytes + 1)]).unwrap();
                drop(writer);
            });
            assert_eq!(file.len(), written.min(max_bytes), "{written} of {max_bytes}");
            assert_eq!(
                copier.full.load(Ordering::Relaxed),
                written > max_bytes,
                "{written} of {max_bytes}"
            );
        }
    }
}
