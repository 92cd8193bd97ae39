//! What a program in C or C++ links: `escapement.h` declares these functions and says everything about them.
//!
//! All types, and what runs a table of functions, are those of the package `plugin`. A plug-in needs no library at all.

use std::ffi::{c_char, c_int};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::ExitCode;

use plugin::table::{ABI, Table};

/// The version of the ABI that this library has. A program may compare it with `ESCAPEMENT_ABI` of the header it was compiled with.
#[unsafe(no_mangle)]
pub extern "C" fn escapement_abi() -> u32 {
    ABI
}

/// The `main` of a program whose participant is `table`: takes its place in the run that the environment names, and returns the exit
/// code when it is done. `argc` and `argv` are those of `main`; none of the arguments means anything to the library.
///
/// # Safety
/// `table` is NULL, or points to a table that begins with its size and its version and stays to the end.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn escapement_participant_main(
    argc: c_int,
    argv: *const *const c_char,
    table: *const Table,
) -> c_int {
    let _ = (argc, argv);
    // SAFETY: as the caller says.
    let ended = catch_unwind(AssertUnwindSafe(|| unsafe { plugin::host(table) }));
    let code = ended.unwrap_or(ExitCode::FAILURE);
    // An exit code does not tell its number.
    (0..=u8::MAX)
        .find(|number| ExitCode::from(*number) == code)
        .map_or(1, c_int::from)
}
