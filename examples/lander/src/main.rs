//! A lander and its autopilot in a separate program, which has every command of `escapement`:
//!
//! ```text
//! cargo run --release -p lander -- run examples/lander/lander.toml
//! cargo run --release -p lander -- run examples/lander/lander.toml --in-process
//! cargo run --release -p lander -- sweep examples/lander/lander.toml --vary connections.motion.delay=0ms..400ms:100ms
//! ```

mod autopilot;
mod lander;
mod messages;

use std::process::ExitCode;

fn main() -> ExitCode {
    escapement::Program::new("lander")
        .version(env!("CARGO_PKG_VERSION"))
        .participant("lander", lander::make)
        .participant("autopilot", autopilot::make)
        .main()
}
