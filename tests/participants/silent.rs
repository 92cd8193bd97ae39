//! Starts and never answers the handshake.

use std::process::ExitCode;
use std::time::Duration;

fn main() -> ExitCode {
    loop {
        std::thread::sleep(Duration::from_secs(60));
    }
}
