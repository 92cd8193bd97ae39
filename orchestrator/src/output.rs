//! Standard output and standard error of the program. When the reader is gone (`| head -1`, a closed terminal), further
//! output is discarded, and the work continues to its own end with its own exit code. The standard library's `println!` and
//! its siblings would panic there, in the middle of a run; the macros of the same names below replace them in this crate.
//!
//! If standard output cannot be written for another reason (a full disk behind a redirection), the work continues to its
//! end as well, and then the program reports the error and fails ([`unwritten`]).
//!
//! Messages contain text from other programs: reasons, last lines of logs, names. The engine sanitises it where it enters a
//! message, and [`Heard`] replaces the control characters in all output of this program.
//!
//! Foreign code in this process, an FMU or a plug-in, may print to standard output as well. Where that would spoil what this program
//! says there ([`keep_apart`]), the program keeps standard output for itself, and all other code has standard error in its place.
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
static UNWRITTEN: OnceLock<String> = OnceLock::new();

/// Standard output, once other code of this process no longer has it.
static APART: OnceLock<File> = OnceLock::new();

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

/// A line of a page that is written in one piece: `println!` makes a system call for each.
macro_rules! say {
    ($out:expr, $($text:tt)*) => { $crate::output::line($out, format_args!($($text)*)) };
}

/// An output stream whose reader may be gone. Control characters are replaced by their numbers, except line feed, tab and
/// carriage return.
pub struct Heard<W> {
    to: W,
    /// Records the first write error.
    unwritten: Option<&'static OnceLock<String>>,
}

/// `bytes` with control characters replaced by their numbers.
fn plain(bytes: &[u8]) -> Cow<'_, [u8]> {
    let steers = |at: usize| {
        let before = at.checked_sub(1).map(|before| bytes[before]);
        match bytes[at] {
            b'\n' | b'\t' | b'\r' => false,
            0..0x20 | 0x7f => true,
            // C1 control characters, in UTF-8.
            0x80..=0x9f => before == Some(0xc2),
            _ => false,
        }
    };
    if !(0..bytes.len()).any(steers) {
        return Cow::Borrowed(bytes);
    }
    let mut shown = Vec::with_capacity(bytes.len() + 16);
    for (at, &byte) in bytes.iter().enumerate() {
        if !steers(at) {
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

impl<W: Write> Heard<W> {
    fn unless_gone<T>(&self, result: io::Result<T>, otherwise: T) -> io::Result<T> {
        match result {
            Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(otherwise),
            Err(error) => {
                if let Some(unwritten) = self.unwritten {
                    unwritten.get_or_init(|| error.to_string());
                }
                Err(error)
            }
            Ok(done) => Ok(done),
        }
    }
}

impl<W: Write> Write for Heard<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.to.write_all(&plain(bytes)).map(|()| bytes.len());
        self.unless_gone(written, bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        let flushed = self.to.flush();
        self.unless_gone(flushed, ())
    }
}

/// Standard output of this program.
pub enum Own {
    /// The one of the process.
    Shared(StdoutLock<'static>),
    /// The program's alone.
    Apart(&'static File),
}

impl Write for Own {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self {
            Own::Shared(to) => to.write(bytes),
            Own::Apart(to) => to.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match self {
            Own::Shared(to) => to.flush(),
            Own::Apart(to) => to.flush(),
        }
    }
}

/// From now on, until the process ends, standard output is this program's alone: what foreign code in this process prints goes to
/// standard error. It is never given back, because the C library writes what it has buffered at the very end.
pub fn keep_apart() {
    if APART.get().is_some() {
        return;
    }
    let _ = io::stdout().flush();
    // Where one of the streams is closed there is nothing to be kept apart.
    if let Ok(own) = io::stdout().as_fd().try_clone_to_owned()
        && rustix::stdio::dup2_stdout(io::stderr().as_fd()).is_ok()
    {
        let _ = APART.set(own.into());
    }
}

/// Standard output as it is: a reader that is gone is an error.
pub fn own() -> Own {
    match APART.get() {
        Some(own) => Own::Apart(own),
        None => Own::Shared(io::stdout().lock()),
    }
}

/// Standard output.
pub fn stdout() -> Heard<Own> {
    Heard {
        to: own(),
        unwritten: Some(&UNWRITTEN),
    }
}

/// The error that kept standard output from being written completely, if any.
pub fn unwritten() -> Option<&'static str> {
    // Data may still be in the line buffer.
    let _ = stdout().flush();
    UNWRITTEN.get().map(String::as_str)
}

/// Buffered standard output for a page of many lines, which is written when it is dropped or the buffer is full.
pub fn page() -> BufWriter<impl Write> {
    BufWriter::with_capacity(1 << 16, stdout())
}

/// Standard error.
pub fn stderr() -> Heard<StderrLock<'static>> {
    Heard {
        to: io::stderr().lock(),
        unwritten: None,
    }
}

/// Prints `text` and a newline. Write errors do not stop the program.
pub fn line(out: &mut impl Write, text: Arguments<'_>) {
    let _ = out.write_fmt(text).and_then(|()| out.write_all(b"\n"));
}

/// Prints `said` without a newline.
pub fn text(out: &mut impl Write, said: Arguments<'_>) {
    let _ = out.write_fmt(said);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn output_replaces_control_bytes() {
        let mut out = Vec::new();
        let mut heard = Heard {
            to: &mut out,
            unwritten: None,
        };
        heard
            .write_all("\rt = 1 s\n\tä\u{1b}[31m\0\u{7f}\u{9b}31m".as_bytes())
            .unwrap();
        assert_eq!(
            String::from_utf8(out).unwrap(),
            "\rt = 1 s\n\tä\\u{1b}[31m\\u{0}\\u{7f}\\u{9b}31m"
        );
    }

    /// A stream that cannot be written, with the given error.
    struct Refuses(ErrorKind);

    impl Write for Refuses {
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
        for (kind, noted) in [(ErrorKind::BrokenPipe, &LEFT), (ErrorKind::StorageFull, &FULL)] {
            let mut heard = Heard {
                to: Refuses(kind),
                unwritten: Some(noted),
            };
            line(&mut heard, format_args!("text"));
        }
        assert!(LEFT.get().is_none() && FULL.get().is_some(), "{LEFT:?} {FULL:?}");
    }
}
