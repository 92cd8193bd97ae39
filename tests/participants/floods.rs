//! Writes to its standard error without end.

use std::process::ExitCode;

use escapement_tests::faulty;

fn main() -> ExitCode {
    faulty::damper("floods", |_| eprintln!("{}", "word ".repeat(200_000)))
}
