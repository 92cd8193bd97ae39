//! The smallest scenario with a loop in it: an oscillator and its damper, each a program of its own.

use std::path::PathBuf;

use crate::program::{Folder, participant};

/// Writes the scenario with `damper` in the damper's place.
pub fn oscillator(folder: &Folder, damper: &str) -> PathBuf {
    let text = format!(
        r#"title = "A damped oscillator"
duration = "10 s"

[participants.plant]
run = {{ exe = "{}" }}
period = "1 ms"

[participants.damper]
run = {{ exe = "{}" }}
period = "10 ms"

[connections.motion]
from = "plant.motion"
to = "damper.motion"

[connections.push]
from = "damper.push"
to = "plant.push"
"#,
        participant("oscillator").display(),
        participant(damper).display()
    );
    folder.write("oscillator.toml", &text)
}
