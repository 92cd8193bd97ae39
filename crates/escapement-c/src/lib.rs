//! The library that a program in C or C++ links: `escapement.h` declares and documents these functions.
//!
//! All types, and the host of a function table, are those of the package `plugin`. A plug-in needs no library.

use std::ffi::{c_char, c_int};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::ExitCode;

use plugin::table::{ABI, Table};

/// The ABI version of this library. A program may compare it with `ESCAPEMENT_ABI` of the header it was compiled with.
#[unsafe(no_mangle)]
pub extern "C" fn escapement_abi() -> u32 {
    ABI
}

/// The `main` of a program whose participant is `table`: joins the run named by the environment, and returns the exit code when the
/// participant has ended. `argc` and `argv` are those of `main`; the library ignores all arguments.
///
/// # Safety
/// `table` is NULL, or points to a table that begins with its size and its version and stays valid to the end.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn escapement_participant_main(
    argc: c_int,
    argv: *const *const c_char,
    table: *const Table,
) -> c_int {
    let _ = (argc, argv);
    // SAFETY: the caller guarantees what `plugin::host` requires of the table.
    let ended = catch_unwind(AssertUnwindSafe(|| unsafe { plugin::host(table) }));
    let code = ended.unwrap_or(ExitCode::FAILURE);
    // An `ExitCode` does not expose its number.
    (0..=u8::MAX)
        .find(|number| ExitCode::from(*number) == code)
        .map_or(1, c_int::from)
}
