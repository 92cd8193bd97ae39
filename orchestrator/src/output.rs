//! What the program says. A reader that has left (`| head -1`, a closed terminal) has heard enough: what would still be said is
//! dropped, and the work goes on to its own end with its own exit code. The standard library's `println!` and its siblings panic
//! there, in the middle of a run; the macros of the same names below take their places in this crate.
//!
//! SIGPIPE stays ignored, as the standard library has it, so that a write to a participant that has died is an error to be
//! handled; processes that are started get the default back, as every program expects.

use std::fmt::Arguments;
use std::io::{self, ErrorKind, StderrLock, StdoutLock, Write};

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

/// A stream whose reader may leave.
pub struct Heard<W>(W);

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
        Self::unless_gone(self.0.write(bytes), bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Self::unless_gone(self.0.flush(), ())
    }
}

/// Standard output.
pub fn stdout() -> Heard<StdoutLock<'static>> {
    Heard(io::stdout().lock())
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
