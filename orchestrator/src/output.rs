//! What the program says. A reader that has left (`| head -1`, a closed terminal) has heard enough: what would still be said is
//! dropped, and the work goes on to its own end with its own exit code. The standard library's `println!` and its siblings panic
//! there, in the middle of a run; the macros of the same names below take their places in this crate.
//!
//! What cannot be written to standard output for another reason (a full disk behind a redirection) is missing from what is read: the
//! work goes on to its end all the same, and then the program says so and fails ([`unwritten`]).
//!
//! Messages contain text of other programs: reasons, last lines of logs, names. The engine makes it harmless where it enters a message,
//! and [`Heard`] replaces the control characters in everything that leaves this program.
//!
//! SIGPIPE stays ignored, as the standard library has it, so that a write to a participant that has died is an error to be
//! handled; processes that are started get the default back, as every program expects.

use std::borrow::Cow;
use std::fmt::Arguments;
use std::io::{self, BufWriter, ErrorKind, StderrLock, StdoutLock, Write};
use std::sync::OnceLock;

/// What kept standard output from being written, the first time.
static UNWRITTEN: OnceLock<String> = OnceLock::new();

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

/// A line of a page that is written at once: `println!` makes a system call for each.
macro_rules! say {
    ($out:expr, $($text:tt)*) => { $crate::output::line($out, format_args!($($text)*)) };
}

/// A stream whose reader may leave. Control characters are replaced by their numbers, except line feed, tab and carriage return.
pub struct Heard<W> {
    to: W,
    /// Where it is noted that something could not be written.
    unwritten: Option<&'static OnceLock<String>>,
}

/// `bytes` with control characters replaced by their numbers.
fn plain(bytes: &[u8]) -> Cow<'_, [u8]> {
    let steers = |at: usize| {
        let before = at.checked_sub(1).map(|before| bytes[before]);
        match bytes[at] {
            b'\n' | b'\t' | b'\r' => false,
            0..0x20 | 0x7f => true,
            // The second set of control characters, in UTF-8.
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

/// Standard output.
pub fn stdout() -> Heard<StdoutLock<'static>> {
    Heard {
        to: io::stdout().lock(),
        unwritten: Some(&UNWRITTEN),
    }
}

/// What kept standard output from being written to its end, if anything did.
pub fn unwritten() -> Option<&'static str> {
    // The end of it may still wait for the end of its line.
    let _ = stdout().flush();
    UNWRITTEN.get().map(String::as_str)
}

/// Standard output for a page of many lines, which are written when it is dropped or has become large.
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

/// Says `text` and ends the line. What cannot be said is no reason to stop what is done.
pub fn line(out: &mut impl Write, text: Arguments<'_>) {
    let _ = out.write_fmt(text).and_then(|()| out.write_all(b"\n"));
}

/// Says `said` and stays in the line.
pub fn text(out: &mut impl Write, said: Arguments<'_>) {
    let _ = out.write_fmt(said);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heard_replaces_control_bytes() {
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

    /// A stream that cannot be written, for one reason or the other.
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
    fn a_reader_that_has_left_has_heard_enough_and_a_full_disk_has_not() {
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
