//! Participants in any language: a table of C functions implements one, and a library that provides such tables is a plug-in.
//!
//! - [`table`]: the types of the C ABI, as `escapement.h` has them;
//! - [`Foreign`]: a participant implemented by such a table, which runs like any other participant;
//! - [`Library`]: a plug-in: a shared library that provides tables;
//! - [`export!`]: makes a plug-in of participants written in Rust;
//! - [`host`] and [`host_library`]: the `main` of a program whose participant is a table, or is in a library.
//!
//! A participant that detectably violates the rules of the ABI (a table of another version, a missing function, an output written past
//! its end, a call of `exit`) is named, with the remedy. An undetectable violation, such as a stray pointer, ends the process: that is
//! why a participant has a process of its own unless its user configures otherwise.

mod elf;
mod export;
mod foreign;
mod guarded;
mod host_context;
mod library;
mod load_error;
mod message;
mod modes;
mod parameters;
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

/// The `main` of a program whose participant is `table`: joins the run that the environment names, and returns when the run is done. A
/// table that cannot be used is rejected, and the orchestrator that started the program names the participant.
///
/// # Safety
/// `table` must be null, or point to a table whose first two fields can be read, and all of it if they are right; it must exist as long
/// as the program.
pub unsafe fn host(table: *const table::Table) -> ExitCode {
    // SAFETY: the caller guarantees that it is null or that its first two fields can be read, and all of it if they are right.
    let checked = unsafe { table::check(table) };
    let own = foreign_calls::FloatModes::take();
    if let Ok(table) = &checked {
        modes::keep(table, own);
    }
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

/// The same with the participant called `name` of the library in `file`, or with its only one.
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
