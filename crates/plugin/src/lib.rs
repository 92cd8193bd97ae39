//! Participants in any language: a table of C functions makes one, and a library that gives such a table is a plug-in.
//!
//! - [`table`]: the types of the C ABI, as `escapement.h` has them;
//! - [`Foreign`]: a participant that is such a table, so that whoever runs participants runs it as well;
//! - [`Library`]: a plug-in: a shared library that gives tables;
//! - [`export!`]: makes a plug-in of participants in Rust;
//! - [`host`] and [`host_library`]: the `main` of a program whose participant is a table, or stands in a library.
//!
//! A participant that breaks the rules of the ABI where that can be seen (a table of another version, a function that is missing, an
//! output written past its end, a call of `exit`) is named, with the remedy. What cannot be seen, such as a stray pointer, ends the
//! process: that is why a participant has one of its own unless its user says otherwise.

mod elf;
mod exit;
mod export;
mod foreign;
mod guarded;
mod library;
mod load_error;
mod message;
mod parameters;
mod seat;
pub mod table;

use std::path::Path;
use std::process::ExitCode;

pub use elf::look;
#[doc(hidden)]
pub use export::__private;
pub use foreign::Foreign;
pub use library::Library;
pub use load_error::LoadError;
pub use parameters::{Found, NO_PARTICIPANT, Parameters};

/// The `main` of a program whose participant is `table`: takes its place in the run that the environment names, and returns when it
/// is done. A table that cannot be used is refused with the participant's name by whoever started the program.
///
/// # Safety
/// `table` is null, or points to a table whose first two fields can be read, and all of it if they are right; it is there as long as
/// the program.
pub unsafe fn host(table: *const table::Table) -> ExitCode {
    // SAFETY: as the caller says.
    let checked = unsafe { table::check(table) };
    let program = checked
        .as_ref()
        .map_or_else(|_| "a program in C".to_owned(), |table| table.program());
    lockstep::host::run(
        move |setup| match &checked {
            Ok(table) => Foreign::make(table, setup),
            Err(wrong) => Err(lockstep::participant::ParameterError::new(NO_PARTICIPANT, wrong)),
        },
        &program,
    )
}

/// The same with the participant called `name` of the library in `file`, or its only one.
pub fn host_library(file: &Path, name: Option<&str>) -> ExitCode {
    let found = Library::open(file).and_then(|library| library.participant(name));
    let program = found
        .as_ref()
        .map_or_else(|_| format!("the library `{}`", file.display()), |table| table.program());
    lockstep::host::run(
        move |setup| match &found {
            Ok(table) => Foreign::make(table, setup),
            Err(wrong) => Err(lockstep::participant::ParameterError::new(NO_PARTICIPANT, wrong)),
        },
        &program,
    )
}
