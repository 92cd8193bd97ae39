//! The smallest scenario with a loop in it: an oscillator and its damper, each a separate program.

use std::path::{Path, PathBuf};

use crate::machine::processes_of;
use crate::program::{Folder, ProgramOutput, participant, root, run_orchestrator, text};

/// Writes the scenario with `damper` as the damper's program.
pub fn write_oscillator(folder: &Folder, damper: &str) -> PathBuf {
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

/// Checks that the tape in `run` is a prefix of the one in `undisturbed`; returns the number of samples of its shortest stream.
///
/// # Panics
/// When it is not.
pub fn assert_prefix(undisturbed: &Path, run: &Path) -> u64 {
    let lengths = ["plant.motion.bin", "damper.push.bin"].map(|stream| {
        let whole = std::fs::read(undisturbed.join("tape").join(stream)).expect("the undisturbed run has a tape");
        let part = std::fs::read(run.join("tape").join(stream)).expect("the run has a tape");
        assert!(
            whole.starts_with(&part),
            "{stream} is not a prefix in {}",
            run.display()
        );
        // The last sample written by a killed orchestrator may be incomplete; readers leave it out.
        part.len() as u64 / 24
    });
    lengths[0].min(lengths[1])
}

/// A folder with a scenario and an undisturbed run of it.
pub struct RunFixture {
    /// All files of the test.
    pub folder: Folder,
    /// The scenario of the run.
    pub scenario: PathBuf,
}

impl RunFixture {
    /// An undisturbed run, and the scenario with `damper` as the damper's program.
    pub fn new(name: &str, damper: &str) -> RunFixture {
        let folder = Folder::new(name);
        let healthy = write_oscillator(&folder, "damper");
        let out = folder.path().join("undisturbed");
        let output = run_orchestrator(&["run", text(&healthy), "--out", text(&out), "--quiet"]);
        assert_eq!(output.code, Some(0), "{output:?}");
        let scenario = write_oscillator(&folder, damper);
        RunFixture { folder, scenario }
    }

    /// A file or folder of the fixture.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Runs the scenario, and checks that no process is left.
    pub fn run(&self, name: &str, more: &[&str]) -> ProgramOutput {
        let out = self.path(name);
        let mut arguments = vec!["run", text(&self.scenario), "--out", text(&out)];
        arguments.extend(more);
        let output = run_orchestrator(&arguments);
        assert_eq!(
            processes_of(self.folder.path()),
            Vec::<String>::new(),
            "processes are left"
        );
        output
    }

    /// Resumes the run `from`.
    pub fn resume(&self, from: &str, name: &str, more: &[&str]) -> ProgramOutput {
        let (run, out) = (self.path(from), self.path(name));
        let mut arguments = vec!["resume", text(&run), "--out", text(&out)];
        arguments.extend(more);
        run_orchestrator(&arguments)
    }

    /// Checks that the run `name` has the tape of the undisturbed one.
    pub fn assert_same_as_undisturbed(&self, name: &str) {
        let output = run_orchestrator(&["compare", text(&self.path("undisturbed")), text(&self.path(name))]);
        assert_eq!(output.code, Some(0), "{output:?}");
    }

    /// Checks that the tape of `name` is a prefix of the undisturbed one; returns the number of samples of its shortest stream.
    pub fn assert_prefix(&self, name: &str) -> u64 {
        assert_prefix(&self.path("undisturbed"), &self.path(name))
    }

    /// The events on the tape of `name`.
    pub fn events(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name).join("tape/events.jsonl")).expect("a tape has events")
    }

    /// The damper's count of its own steps at its sample `index`.
    pub fn count(&self, name: &str, index: usize) -> u64 {
        let bytes = std::fs::read(self.path(name).join("tape/damper.push.bin")).expect("the damper is on the tape");
        let record = &bytes[24 * index..24 * (index + 1)];
        u64::from_le_bytes(record[16..].try_into().expect("eight bytes"))
    }

    /// A fixture whose scenario has `more` appended.
    pub fn with_appended(name: &str, damper: &str, more: &str) -> RunFixture {
        let fixture = RunFixture::new(name, damper);
        let scenario = std::fs::read_to_string(&fixture.scenario).expect("it was just written") + more;
        std::fs::write(&fixture.scenario, scenario).expect("the folder can be written");
        fixture
    }
}

/// `[[faults]]` with one substitution of the damper.
pub fn substitution(at: &str, program: &str, state: &str) -> String {
    let exe = participant(program);
    format!(
        "\n[[faults]]\nat = \"{at}\"\nsubstitute = \"damper\"\nrun = {{ exe = \"{}\" }}\nstate = \"{state}\"\n",
        exe.display()
    )
}

/// Writes the scenario of two masses from the project's template, 200 ms of it; returns the file.
pub fn write_two_masses(folder: &Folder) -> PathBuf {
    let scenario = std::fs::read_to_string(root().join("orchestrator/src/templates/spring.toml")).unwrap();
    folder.write("m.toml", &scenario.replace("10 s\"", "200 ms\""))
}

/// Writes the scenario of two masses from the project's template, in one program, with a measure and a fault; returns the file's name.
pub fn write_springs(folder: &Folder) -> String {
    let scenario = std::fs::read_to_string(root().join("orchestrator/src/templates/spring.toml")).unwrap();
    let scenario = scenario
        .replace("10 s\"", "200 ms\"")
        .replace("duration = \"10 ms\"", "duration = \"200 ms\"");
    let measures = "\n[measures.swing]\nof = \"right.motion.position\"\ncompute = \"max-abs\"\nat-most = \"0.9 mm\"\n\
                    \n[[faults]]\nname = \"push\"\nat = \"50 ms\"\ninput = \"right.neighbour\"\nfield = \"position\"\nkind = \"bias\"\nvalue = \"1 mm\"\n";
    folder.write("springs.toml", &(scenario + measures));
    "springs.toml".to_owned()
}
