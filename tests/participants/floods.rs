//! Writes to standard error without end: in its steps, or before the handshake (`floods at-once`).

use std::process::ExitCode;

use escapement_tests::faulty;

fn main() -> ExitCode {
    let words = || eprintln!("{}", "word ".repeat(200_000));
    if std::env::args().any(|argument| argument == "at-once") {
        loop {
            words();
        }
    }
    faulty::run_before_step("floods", move |_| eprintln!("{}", "word ".repeat(200_000)))
}
