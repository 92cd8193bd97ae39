//! The participants that this program contains.

use lockstep::participant::Factory;

/// Their names.
pub const NAMES: [&str; 3] = ["plant", "controller", "guidance"];

/// How the participant called `name` is made.
pub fn factory(name: &str) -> Option<Factory> {
    match name {
        "plant" => Some(plant_proc::factory),
        "controller" => Some(controller_proc::factory),
        "guidance" => Some(guidance_proc::factory),
        crate::replay::player::NAME => Some(crate::replay::player::factory),
        other => crate::bench::factory(other),
    }
}
