//! A position loop at three rates: a mass on a spring with a damper, its PID controller, and where it shall be. The same in C and C++
//! stands in `examples/c` and `examples/cpp`.

pub mod controller;
mod messages;
pub mod plant;
pub mod reference;

pub use messages::{Motion, Push, Target};

plugin::export! {
    "plant" => plant::make,
    "pid" => controller::make,
    "reference" => reference::make,
}
