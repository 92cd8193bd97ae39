//! Standard output and standard error of the program. When the reader is gone (`| head -1`, a closed terminal), further
//! output is discarded, and the work continues to its own end with its own exit code. The standard library's `println!` and
//! its siblings would panic there, in the middle of a run; the macros of the same names below replace them in this crate.
//!
//! If standard output cannot be written for another reason (a full disk behind a redirection), the work continues to its
//! end as well, and then the program reports the error and fails ([`stdout_error`]).
//!
//! Messages contain text from other programs: reasons, last lines of logs, names. The engine sanitises it where it enters a
//! message, and [`GuardedStream`] replaces the control characters in all output of this program.
//!
//! Foreign code in this process, an FMU or a plug-in, may print to standard output as well. Where that would spoil what this program
//! writes there ([`separate_stdout`]), the program keeps standard output for itself, and all other code has standard error in its place.
//!
//! SIGPIPE stays ignored, as set by the standard library, so that a write to a dead participant is an error to be handled;
//! child processes get the default back, as every program expects.

use std::borrow::Cow;
use std::fmt::Arguments;
use std::fs::File;
use std::io::{self, BufWriter, ErrorKind, StderrLock, StdoutLock, Write};
use std::os::fd::AsFd;
use std::sync::OnceLock;

/// The first error of writing to standard output.
static STDOUT_ERROR: OnceLock<String> = OnceLock::new();

/// Standard output, once other code of this process no longer has it.
static SEPARATE_STDOUT: OnceLock<File> = OnceLock::new();

macro_rules! println {
    ($($text:tt)*) => { $crate::output::line(&mut $crate::output::stdout(), format_args!($($text)*)) };
}

macro_rules! print {
    ($($text:tt)*) => { $crate::output::text(&mut $crate::output::stdout(), format_args!($($text)*)) };
}

macro_rules! eprintln {
    ($($text:tt)*) => { $crate::output::line(&mut $crate::output::stderr(), format_args!($($text)*)) };
}

macro_rules! eprint {
    ($($text:tt)*) => { $crate::output::text(&mut $crate::output::stderr(), format_args!($($text)*)) };
}

/// Prints a line to a buffered output; `println!` makes a system call for each line.
macro_rules! say {
    ($out:expr, $($text:tt)*) => { $crate::output::line($out, format_args!($($text)*)) };
}

/// An output stream whose reader may be gone. Control characters are replaced by their numbers, except line feed, tab and
/// carriage return.
pub struct GuardedStream<W> {
    to: W,
    /// Records the first write error.
    first_error: Option<&'static OnceLock<String>>,
}

/// `bytes` with control characters replaced by their numbers.
fn escape_control_bytes(bytes: &[u8]) -> Cow<'_, [u8]> {
    let is_control = |at: usize| {
        let before = at.checked_sub(1).map(|before| bytes[before]);
        match bytes[at] {
            b'\n' | b'\t' | b'\r' => false,
            0..0x20 | 0x7f => true,
            // C1 control characters, in UTF-8.
            0x80..=0x9f => before == Some(0xc2),
            _ => false,
        }
    };
    if !(0..bytes.len()).any(is_control) {
        return Cow::Borrowed(bytes);
    }
    let mut shown = Vec::with_capacity(bytes.len() + 16);
    for (at, &byte) in bytes.iter().enumerate() {
        if !is_control(at) {
            shown.push(byte);
            continue;
        }
        if byte >= 0x80 {
            shown.pop();
        }
        shown.extend_from_slice(format!("\\u{{{byte:x}}}").as_bytes());
    }
    Cow::Owned(shown)
}

impl<W: Write> GuardedStream<W> {
    fn ignore_broken_pipe<T>(&self, result: io::Result<T>, otherwise: T) -> io::Result<T> {
        match result {
            Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(otherwise),
            Err(error) => {
                if let Some(first_error) = self.first_error {
                    first_error.get_or_init(|| error.to_string());
                }
                Err(error)
            }
            Ok(done) => Ok(done),
        }
    }
}

impl<W: Write> Write for GuardedStream<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.to.write_all(&escape_control_bytes(bytes)).map(|()| bytes.len());
        self.ignore_broken_pipe(written, bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        let flushed = self.to.flush();
        self.ignore_broken_pipe(flushed, ())
    }
}

/// Standard output of this program.
pub enum StdoutHandle {
    /// The one of the process.
    Shared(StdoutLock<'static>),
    /// Reserved for the program.
    Separate(&'static File),
}

impl Write for StdoutHandle {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self {
            StdoutHandle::Shared(to) => to.write(bytes),
            StdoutHandle::Separate(to) => to.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match self {
            StdoutHandle::Shared(to) => to.flush(),
            StdoutHandle::Separate(to) => to.flush(),
        }
    }
}

/// Reserves standard output for this program until the process ends: the output of foreign code in this process goes to standard
/// error. The redirection is never undone, because the C library flushes its buffers only when the process exits.
pub fn separate_stdout() {
    if SEPARATE_STDOUT.get().is_some() {
        return;
    }
    let _ = io::stdout().flush();
    // Where one of the streams is closed there is nothing to be kept apart.
    if let Ok(own) = io::stdout().as_fd().try_clone_to_owned()
        && rustix::stdio::dup2_stdout(io::stderr().as_fd()).is_ok()
    {
        let _ = SEPARATE_STDOUT.set(own.into());
    }
}

/// Standard output as it is: a reader that is gone is an error.
pub fn raw_stdout() -> StdoutHandle {
    match SEPARATE_STDOUT.get() {
        Some(own) => StdoutHandle::Separate(own),
        None => StdoutHandle::Shared(io::stdout().lock()),
    }
}

/// Standard output.
pub fn stdout() -> GuardedStream<StdoutHandle> {
    GuardedStream {
        to: raw_stdout(),
        first_error: Some(&STDOUT_ERROR),
    }
}

/// The error that kept standard output from being written completely, if any.
pub fn stdout_error() -> Option<&'static str> {
    // Data may still be in the line buffer.
    let _ = stdout().flush();
    STDOUT_ERROR.get().map(String::as_str)
}

/// Buffered standard output for a page of many lines, which is written when it is dropped or the buffer is full.
pub fn buffered_stdout() -> BufWriter<impl Write> {
    BufWriter::with_capacity(1 << 16, stdout())
}

/// Standard error.
pub fn stderr() -> GuardedStream<StderrLock<'static>> {
    GuardedStream {
        to: io::stderr().lock(),
        first_error: None,
    }
}

/// Prints `text` and a newline. Write errors do not stop the program.
pub fn line(out: &mut impl Write, text: Arguments<'_>) {
    let _ = out.write_fmt(text).and_then(|()| out.write_all(b"\n"));
}

/// Prints `text` without a newline.
pub fn text(out: &mut impl Write, text: Arguments<'_>) {
    let _ = out.write_fmt(text);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn output_replaces_control_bytes() {
        let mut out = Vec::new();
        let mut stream = GuardedStream {
            to: &mut out,
            first_error: None,
        };
        stream
            .write_all("\rt = 1 s\n\tä\u{1b}[31m\0\u{7f}\u{9b}31m".as_bytes())
            .unwrap();
        assert_eq!(
            String::from_utf8(out).unwrap(),
            "\rt = 1 s\n\tä\\u{1b}[31m\\u{0}\\u{7f}\\u{9b}31m"
        );
    }

    /// A stream that cannot be written, with the given error.
    struct FailingStream(ErrorKind);

    impl Write for FailingStream {
        fn write(&mut self, _: &[u8]) -> io::Result<usize> {
            Err(self.0.into())
        }

        fn flush(&mut self) -> io::Result<()> {
            Err(self.0.into())
        }
    }

    #[test]
    fn output_ignores_closed_pipe_and_reports_full_disk() {
        static LEFT: OnceLock<String> = OnceLock::new();
        static FULL: OnceLock<String> = OnceLock::new();
        for (kind, first_error) in [(ErrorKind::BrokenPipe, &LEFT), (ErrorKind::StorageFull, &FULL)] {
            let mut stream = GuardedStream {
                to: FailingStream(kind),
                first_error: Some(first_error),
            };
            line(&mut stream, format_args!("text"));
        }
        assert!(LEFT.get().is_none() && FULL.get().is_some(), "{LEFT:?} {FULL:?}");
    }
}
