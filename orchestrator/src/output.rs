//! What the program says. A reader that has left (`| head -1`, a closed terminal) has heard enough: what would still be said is
//! dropped, and the work goes on to its own end with its own exit code. The standard library's `println!` and its siblings panic
//! there, in the middle of a run; the macros of the same names below take their places in this crate.
//!
//! Messages contain text of other programs: reasons, last lines of logs, names. The engine makes it harmless where it enters a message,
//! and [`Heard`] replaces the control characters in everything that leaves this program.
//!
//! SIGPIPE stays ignored, as the standard library has it, so that a write to a participant that has died is an error to be
//! handled; processes that are started get the default back, as every program expects.

use std::borrow::Cow;
use std::fmt::Arguments;
use std::io::{self, BufWriter, ErrorKind, StderrLock, StdoutLock, Write};

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
pub struct Heard<W>(W);

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
    fn unless_gone<T>(result: io::Result<T>, otherwise: T) -> io::Result<T> {
        match result {
            Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(otherwise),
            result => result,
        }
    }
}

impl<W: Write> Write for Heard<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.0.write_all(&plain(bytes)).map(|()| bytes.len());
        Self::unless_gone(written, bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Self::unless_gone(self.0.flush(), ())
    }
}

/// Standard output.
pub fn stdout() -> Heard<StdoutLock<'static>> {
    Heard(io::stdout().lock())
}

/// Standard output for a page of many lines, which are written when it is dropped or has become large.
pub fn page() -> BufWriter<impl Write> {
    BufWriter::with_capacity(1 << 16, stdout())
}

/// Standard error.
pub fn stderr() -> Heard<StderrLock<'static>> {
    Heard(io::stderr().lock())
}

/// Says `text` and ends the line. What cannot be said (a full disk behind a redirection) is no reason to stop what is done.
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
        let mut heard = Heard(&mut out);
        heard
            .write_all("\rt = 1 s\n\tä\u{1b}[31m\0\u{7f}\u{9b}31m".as_bytes())
            .unwrap();
        assert_eq!(
            String::from_utf8(out).unwrap(),
            "\rt = 1 s\n\tä\\u{1b}[31m\\u{0}\\u{7f}\\u{9b}31m"
        );
    }
}
