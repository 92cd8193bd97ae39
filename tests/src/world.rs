//! The smallest scenario with a loop in it: an oscillator and its damper, each a program of its own.

use std::path::{Path, PathBuf};

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

/// Whether the tape in `run` is a prefix of the one in `undisturbed`: how many samples its shortest stream has.
///
/// # Panics
/// When it is not.
pub fn prefix(undisturbed: &Path, run: &Path) -> u64 {
    let lengths = ["plant.motion.bin", "damper.push.bin"].map(|stream| {
        let whole = std::fs::read(undisturbed.join("tape").join(stream)).expect("the undisturbed run has a tape");
        let part = std::fs::read(run.join("tape").join(stream)).expect("the run has a tape");
        assert!(
            whole.starts_with(&part),
            "{stream} is not a prefix in {}",
            run.display()
        );
        // What a killed orchestrator was writing may end in the middle of a sample; readers leave that out.
        part.len() as u64 / 24
    });
    lengths[0].min(lengths[1])
}
