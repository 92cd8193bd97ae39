//! The position loop with the whole command line:
//!
//! ```text
//! cargo run --release -p pid -- run examples/pid/pid.toml
//! ```

use std::process::ExitCode;

fn main() -> ExitCode {
    escapement::Program::new("pid")
        .version(env!("CARGO_PKG_VERSION"))
        .contents(position_loop::contents)
        .main()
}
