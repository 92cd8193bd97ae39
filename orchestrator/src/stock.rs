//! The stock program: the participants of the capture, its assessment, its failures, and what is to be said of its gains.

use crate::Program;

/// Escapement's own program.
pub fn program() -> Program {
    Program::new("escapement")
        .participant("plant", plant_proc::factory)
        .participant("controller", controller_proc::factory)
        .participant("guidance", guidance_proc::factory)
        .assessment("capture", capture::assessment::from_table)
        .remark(capture::provenance::remarks)
        .remark(capture::velocity_loop::remarks)
        .finding(capture::velocity_loop::findings)
        .failures(capture::actuators::every_actuator)
}
