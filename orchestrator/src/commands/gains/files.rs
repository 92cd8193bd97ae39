//! Files of gains: a specification with its robot, and output files.

use std::path::Path;

use anyhow::{Context, anyhow, bail};
use capture::closed_loop::find_beside_specification;
use engine::check_title;
use synthesis::robot::{Robot, Spec};

use crate::commands::model;
use crate::destination;

/// Reads a specification and the robot it names. The description's path is resolved relative to the working directory, the
/// folder of the specification, or its parent folder, whichever has it.
pub fn load(path: &Path, text: &str, allow_unphysical: bool) -> anyhow::Result<(Spec, Robot, String)> {
    let spec: Spec = toml::from_str(text)?;
    check_title(&spec.title).map_err(|reason| anyhow!("title: {reason}"))?;
    let Some(found) = find_beside_specification(path, &spec.robot.urdf) else {
        bail!(
            "robot.urdf = {:?}: no such file here, beside the specification, or above it",
            spec.robot.urdf
        )
    };
    let urdf = std::fs::read_to_string(&found).with_context(|| found.display().to_string())?;
    let robot = Robot::from_description(model::read(&found, allow_unphysical)?, &spec.robot)?;
    spec.check(robot.channels())?;
    Ok((spec, robot, urdf))
}

/// Writes a file, and creates its folder.
pub fn write(path: &Path, text: &str) -> anyhow::Result<()> {
    if let Some(folder) = path.parent().filter(|f| !f.as_os_str().is_empty()) {
        std::fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    }
    destination::write(path, text).with_context(|| path.display().to_string())
}
