//! A position loop at three rates: a mass on a spring with a damper, its PID controller, and a reference. The same loop in C and C++ is in
//! `examples/c` and `examples/cpp`.

pub mod controller;
mod messages;
pub mod plant;
pub mod reference;

use escapement::Catalogue;

pub use messages::{Motion, Push, Target};

/// The contents of the program and of its FMUs.
pub fn contents(catalogue: Catalogue) -> Catalogue {
    catalogue
        .participant("plant", plant::make)
        .participant("pid", controller::make)
        .participant("reference", reference::make)
}

// The library is a plug-in and is packed into FMUs: pid fmu export … --library target/release/libposition_loop.so
escapement::fmu!(contents);
plugin::export! {
    "plant" => plant::make,
    "pid" => controller::make,
    "reference" => reference::make,
}
