//! The position loop with the whole command line:
//!
//! ```text
//! cargo run --release -p pid -- run examples/pid/pid.toml
//! ```

use std::process::ExitCode;

fn main() -> ExitCode {
    escapement::Program::new("pid")
        .version(env!("CARGO_PKG_VERSION"))
        .participant("plant", position_loop::plant::make)
        .participant("pid", position_loop::controller::make)
        .participant("reference", position_loop::reference::make)
        .main()
}
