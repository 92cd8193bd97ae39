//! The output of `new` runs outside the project's source tree.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};

use escapement_tests::fmus::TestFmu;
use escapement_tests::program::{Folder, ProgramOutput, built, orchestrator, root, run_orchestrator, text};

/// A folder outside of the workspace.
struct ExternalFolder(PathBuf);

impl ExternalFolder {
    fn new() -> ExternalFolder {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let number = COUNT.fetch_add(1, Ordering::Relaxed);
        let name = format!("escapement-new-{}-{number}", std::process::id());
        let folder = std::env::temp_dir().join(name);
        std::fs::create_dir_all(&folder).expect("the folder for temporary files can be written");
        assert!(!folder.starts_with(root()), "{}", folder.display());
        ExternalFolder(folder)
    }

    /// Puts the workspace's profiles where Cargo finds them for every project in this folder, so that nothing already compiled for the
    /// workspace is compiled again. A user's project has Cargo's profiles.
    fn compile_as_the_workspace_does(&self) {
        let manifest = std::fs::read_to_string(root().join("Cargo.toml")).expect("the workspace has a manifest");
        let manifest: toml::Table = manifest.parse().expect("Cargo has read it");
        let profiles = toml::Table::from_iter([("profile".to_owned(), manifest["profile"].clone())]);
        let folder = self.0.join(".cargo");
        std::fs::create_dir(&folder).expect("the folder can be written");
        std::fs::write(folder.join("config.toml"), profiles.to_string()).expect("the folder can be written");
    }

    /// Runs the program with `arguments` in this folder.
    fn escapement(&self, arguments: &[&str]) -> ProgramOutput {
        let mut command = Command::new(orchestrator());
        command.args(arguments);
        self.finish(command)
    }

    /// Runs the user's command line in this folder.
    fn shell(&self, script: &str) -> ProgramOutput {
        let mut command = Command::new("sh");
        let path = format!("{}:{}", built().display(), std::env::var("PATH").unwrap_or_default());
        command
            .args(["-ec", script])
            .env("PATH", path)
            // A separate folder `target` would compile everything that is ready here.
            .env("CARGO_TARGET_DIR", root().join("target"))
            .env("CARGO_NET_OFFLINE", "true");
        self.finish(command)
    }

    fn finish(&self, mut command: Command) -> ProgramOutput {
        let output = command.current_dir(&self.0).stdin(Stdio::null()).output();
        output.expect("the program can be started").into()
    }
}

impl Drop for ExternalFolder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// The commands that `new` printed.
fn printed_commands(output: &ProgramOutput) -> String {
    let (_, next) = output.out.split_once("What to do next:").expect("commands are printed");
    let lines: Vec<&str> = next.lines().filter_map(|line| line.strip_prefix("    ")).collect();
    assert!(lines.len() > 2 && lines[0].starts_with("cd "), "{output:?}");
    lines.join("\n")
}

/// The files below `folder`, relative to it.
fn files(folder: &Path) -> Vec<String> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(one) = folders.pop() {
        for entry in std::fs::read_dir(&one).expect("a folder").flatten() {
            let path = entry.path();
            match path.is_dir() {
                true => folders.push(path),
                false => found.push(path.strip_prefix(folder).expect("it lies there").display().to_string()),
            }
        }
    }
    found.sort();
    found
}

/// Writes `template` into a folder of that name, from `given` files, and runs the printed commands.
fn create_and_run(outside: &ExternalFolder, template: &str, folder: &str, given: &[&str]) -> ProgramOutput {
    let output = outside.escapement(&[&["new", folder, "--template", template], given].concat());
    assert_eq!(output.code, Some(0), "{output:?}");
    let listed = output.out.lines().take_while(|line| !line.is_empty());
    let mut listed: Vec<&str> = listed
        .filter_map(|line| line.strip_prefix(&format!("{folder}/")))
        .collect();
    listed.sort_unstable();
    assert_eq!(
        listed,
        files(&outside.0.join(folder)),
        "what is listed is what is there"
    );
    let script = printed_commands(&output);
    let done = outside.shell(&script);
    assert_eq!(done.code, Some(0), "{script}\n{done:?}");
    done
}

fn same_tape(a: &Path, b: &Path) {
    let output = run_orchestrator(&["compare", text(a), text(b)]);
    assert_eq!(output.code, Some(0), "{output:?}");
}

#[test]
fn capture_template_runs_from_its_own_folder() {
    let outside = ExternalFolder::new();
    create_and_run(&outside, "capture", "a capture", &[]);
    let project = outside.0.join("a capture");
    for folder in ["scenarios", "campaigns", "models", "gains"] {
        assert_eq!(
            files(&project.join(folder)),
            files(&root().join(folder)),
            "{folder}: the template has every file"
        );
    }
    let here = outside.0.join("here");
    let output = run_orchestrator(&[
        "run",
        "scenarios/close.toml",
        "--out",
        text(&here),
        "--quiet",
        "--in-process",
    ]);
    assert_eq!(output.code, Some(0), "{output:?}");
    same_tape(&here, &project.join("runs/close"));
    // Every scenario finds its files, also from another folder.
    for name in files(&project.join("scenarios")) {
        let path = format!("a capture/scenarios/{name}");
        let output = outside.escapement(&["check", &path, "--json"]);
        assert_eq!(output.code, Some(0), "{path}: {output:?}");
    }
    // Gains find their specification, and the specification finds the robot.
    let margins = "cd 'a capture'; escapement margins gains/pi-diagonal.toml --models 0 --no-closed-loop";
    let output = outside.shell(margins);
    assert!(output.out.contains("gamma"), "{output:?}");
}

#[test]
fn spring_template_has_the_tape_of_the_example() {
    let outside = ExternalFolder::new();
    create_and_run(&outside, "spring", "spring", &[]);
    let example = outside.0.join("example");
    let scenario = std::fs::read_to_string(root().join("examples/spring/spring.toml")).expect("the example is there");
    let program = text(&built().join("spring")).to_owned();
    let file = outside.0.join("example.toml");
    std::fs::write(&file, scenario.replace("../../target/release/spring", &program))
        .expect("the folder can be written");
    let output = run_orchestrator(&["run", text(&file), "--out", text(&example), "--quiet"]);
    assert_eq!(output.code, Some(0), "{output:?}");
    same_tape(&example, &outside.0.join("spring/runs/first"));
    // The run can be resumed, and mistakes in its parameters are reported.
    let output = outside.escapement(&[
        "run",
        "spring/spring.toml",
        "--checkpoint-at",
        "3s",
        "--out",
        "cut",
        "--quiet",
    ]);
    assert_eq!(output.code, Some(0), "{output:?}");
    let output = outside.escapement(&["resume", "cut", "--out", "again", "--quiet", "--in-process"]);
    assert_eq!(output.code, Some(0), "{output:?}");
    same_tape(&example, &outside.0.join("again"));
    for (set, reason) in [
        ("participants.left.parameters.mass=0 kg", "mass"),
        ("participants.left.parameters.coupling=-1 N/m", "coupling"),
        ("participants.left.parameters.stiffness=9000 kN/m", "shorten the period"),
    ] {
        let output = outside.escapement(&["check", "spring/spring.toml", "--set", set]);
        assert!(
            output.code == Some(2) && output.err.contains(reason),
            "{set}: {output:?}"
        );
    }
}

#[test]
fn fmus_are_connected_where_names_and_units_fit() {
    let outside = ExternalFolder::new();
    let built = Folder::new("fmu-template");
    let damper = TestFmu {
        damper: true,
        ..TestFmu::new(3)
    };
    let (spring, damper) = (TestFmu::new(2).build(&built, "mass"), damper.build(&built, "brake.v2"));
    create_and_run(&outside, "fmu", "coupled", &[text(&spring), text(&damper)]);
    // The files are in the project: it does not depend on where they came from.
    let by_hand = outside.0.join("coupled/by-hand.toml");
    let scenario = "duration = \"10 s\"\n[participants.mass]\nperiod = \"10 ms\"\nrun.fmu = \"fmus/mass.fmu\"\n\
                    [participants.brake-v2]\nperiod = \"10 ms\"\nrun.fmu = \"fmus/brake-v2.fmu\"\n\
                    [connections.v]\nfrom = \"mass.outputs.v\"\nto = \"brake-v2.inputs.v\"\n\
                    [connections.f]\nfrom = \"brake-v2.outputs.f\"\nto = \"mass.inputs.f\"\n";
    std::fs::write(&by_hand, scenario).expect("the project can be written");
    let expected = outside.0.join("expected");
    let output = run_orchestrator(&["run", text(&by_hand), "--out", text(&expected), "--quiet"]);
    assert_eq!(output.code, Some(0), "{output:?}");
    same_tape(&expected, &outside.0.join("coupled/runs/first"));
    // Two masses: no output has the name of the input, but the damper has a force output, which is suggested.
    let reference = root().join("tests/fmus/reference/fmi3/Feedthrough.fmu");
    let given = [text(&damper), text(&damper), text(&spring), text(&reference)];
    create_and_run(&outside, "fmu", "apart", &given);
    let scenario = std::fs::read_to_string(outside.0.join("apart/scenario.toml")).expect("it was written");
    for words in [
        "[participants.brake-v2-2]",
        "[connections.mass-to-brake-v2-2.map]\nv = \"v\"",
        "\"damping\" = \"0.5 N.s/m\"",
        "#   from = \"brake-v2.outputs\"\n#   to = \"mass.inputs\"\n#   map = { f = \"f\" }",
        "no source for \"Boolean_input\": no output of another FMU has its name, or its unit",
    ] {
        let found = scenario.contains(words) || scenario.contains(&words.replace("\"damping\"", "damping"));
        assert!(found, "{words} in\n{scenario}");
    }
    // The suggestion works once it is uncommented.
    let uncommented =
        scenario
            .replacen("# ports", "ports", 1)
            .replacen("ports = { inputs = [] }", "ports = { inputs = [\"f\"] }", 1);
    let at = uncommented
        .find("#   [connections.feed-1-0]")
        .expect("the suggestion is there");
    let lines: Vec<&str> = uncommented[at..]
        .lines()
        .take(4)
        .map(|line| line.trim_start_matches("#   "))
        .collect();
    let chosen = outside.0.join("apart/chosen.toml");
    std::fs::write(&chosen, format!("{uncommented}\n{}\n", lines.join("\n"))).expect("the project can be written");
    let output = run_orchestrator(&["check", text(&chosen)]);
    assert_eq!(output.code, Some(0), "{output:?}");
    assert!(output.out.contains("feed-1-0"), "{output:?}");
}

#[test]
fn own_program_template_builds_and_runs() {
    let outside = ExternalFolder::new();
    outside.compile_as_the_workspace_does();
    let done = create_and_run(&outside, "rust", "own-lander", &[]);
    assert!(done.out.contains("run folder: runs/lander"), "{done:?}");
    assert!(!done.err.contains(" generated "), "{done:?}");
    let version = outside.shell("cd own-lander; cargo run --release --quiet -- --version");
    assert!(
        version.out.starts_with("own-lander 0.1.0, built on escapement"),
        "{version:?}"
    );
    let refused = outside.shell("cd own-lander; cargo run --release --quiet -- new more");
    assert_eq!(refused.code, Some(2), "{refused:?}");
    assert!(refused.err.contains("own-lander has no templates"), "{refused:?}");
}

#[test]
fn unwritable_project_is_refused_with_remedy() {
    let outside = ExternalFolder::new();
    let refuse = |arguments: &[&str], words: &[&str]| {
        let output = outside.escapement(arguments);
        assert_eq!(output.code, Some(2), "{output:?}");
        assert!(words.iter().all(|word| output.err.contains(word)), "{output:?}");
    };
    std::fs::create_dir(outside.0.join("full")).expect("a folder");
    std::fs::write(outside.0.join("full/x"), "x").expect("a file");
    refuse(&["new", "full"], &["full: the folder is not empty", "name a new one"]);
    refuse(&["new", "full/x"], &["full/x: it is a file"]);
    refuse(
        &["new", "it", "--template", "boat"],
        &["boat", "`capture`, `spring`, `fmu`, `rust`"],
    );
    refuse(&["new", "it", "--escapement", "."], &["--escapement", "`capture`"]);
    refuse(
        &["new", "it", "--template", "rust", "--escapement", "full"],
        &["--escapement full", "crates/escapement/Cargo.toml"],
    );
    refuse(&["new"], &["FOLDER"]);
    refuse(&["new", "it", "--template", "fmu"], &["--template fmu: name the FMUs"]);
    refuse(
        &["new", "it", "--template", "fmu", "full/x"],
        &["full/x", "not a ZIP archive"],
    );
    refuse(
        &["new", "it", "--template", "spring", "full/x"],
        &["full/x", "takes no files"],
    );
    assert_eq!(files(&outside.0), ["full/x"], "a refusal leaves nothing");
    let output = outside.escapement(&["new", "--list"]);
    let names: Vec<&str> = output.out.lines().filter_map(|line| line.split(' ').next()).collect();
    assert_eq!(
        (output.code, names),
        (Some(0), vec!["capture", "spring", "fmu", "rust"])
    );
    // In the working directory, with the address of a repository instead of a path.
    std::fs::create_dir(outside.0.join("here")).expect("a folder");
    let output = outside.shell("cd here; escapement new . --template rust --escapement https://host/escapement.git");
    assert_eq!(output.code, Some(0), "{output:?}");
    assert!(!output.out.contains("    cd "), "{output:?}");
    let manifest = std::fs::read_to_string(outside.0.join("here/Cargo.toml")).expect("a manifest");
    assert!(manifest.contains("name = \"here\""), "{manifest}");
    assert!(
        manifest.contains("escapement = { git = \"https://host/escapement.git\" }"),
        "{manifest}"
    );
}
