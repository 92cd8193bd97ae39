//! The stock program: the participants of the capture, its assessment, its failures, and the checks of its gains; a spring
//! for a first scenario; and the templates of `new`.

use engine::Catalogue;

use crate::{Program, spring, templates, version};

/// Escapement's own program.
pub fn program() -> Program {
    Program::new("escapement")
        .contents(contents)
        .templates(&templates::STOCK)
}

/// The contents of the program, for a process that uses it as a library.
pub fn catalogue() -> Catalogue {
    contents(Catalogue::new(version::ESCAPEMENT))
}

/// The same, added to another catalogue.
pub fn contents(catalogue: Catalogue) -> Catalogue {
    catalogue
        .participant("plant", plant_proc::factory)
        .participant("controller", controller_proc::factory)
        .participant("guidance", guidance_proc::factory)
        .participant("spring", spring::make)
        .assessment("capture", capture::assessment::from_setup)
        .warning(capture::provenance::warnings)
        .warning(capture::late_events::warnings)
        .change_warning(capture::start_values::warnings)
        .finding(capture::velocity_loop::findings)
        .view(capture::report_view::view)
        .failures(capture::actuators::single_failure_cases)
}
