//! An error is reported once, with the option that caused it and the place to correct it; its consequences are not reported as errors.

use std::path::Path;

use escapement_tests::fixture;
use escapement_tests::program::{Folder, ProgramOutput, assert_refused, orchestrator, root, run_orchestrator, text};

#[test]
fn refused_connection_is_the_only_error() {
    let folder = Folder::new("one-mistake");
    let file = fixture::write_two_masses(&folder);
    for (set, key, part) in [
        ("delay=-1ms", "connections.to-right.delay", "must not be negative"),
        ("drop=1.5", "connections.to-right.drop", "between 0 and 1"),
        ("delay=\"1000 s\"", "connections.to-right.delay", "in flight"),
    ] {
        let set = format!("connections.to-right.{set}");
        let output = run_orchestrator(&["check", text(&file), "--set", &set]);
        // With its own key, and not with a line of the file, which is correct.
        let expected = format!("m.toml: {key}: ");
        assert_refused(&output, &[&expected, part, "(given with --set)"], &["not connected"]);
        assert_eq!(output.err.lines().count(), 1, "{}", output.err);
    }
    // A mistake in a whole connection reports which of its keys are not from the file.
    let output = run_orchestrator(&["check", text(&file), "--set", "connections.to-right.from=left.movement"]);
    assert_refused(
        &output,
        &["`movement`", "(`from` given with --set)"],
        &["not connected"],
    );
}

#[test]
fn value_of_wrong_type_is_refused_with_the_remedy() {
    let folder = Folder::new("wrong-types");
    let file = fixture::write_two_masses(&folder);
    for (set, parts) in [
        ("duration=10", ["duration: `10` is not a time", "a number and a unit"]),
        ("duration=nan", ["duration: `NaN` is not a time", "a number and a unit"]),
        ("duration=true", ["duration: ", "expected a time: a number and a unit"]),
        (
            "duration=1e300 s",
            ["duration: `1e300 s` needs a fraction", "fewer digits"],
        ),
        (
            "participants.left.run=3",
            ["participants.left.run: ", "{ exe = \"FILE\""],
        ),
        (
            "participants.left=3",
            ["participants.left: ", "the keys of a participant, such as"],
        ),
        (
            "connections.to-right=3",
            ["connections.to-right: ", "the keys of a connection, such as"],
        ),
        ("guards.x=3", ["guards.x: ", "the keys of a guard, such as"]),
        ("measures.x=3", ["measures.x: ", "the keys of a measure, such as"]),
        (
            "connections.to-right.initial={ position = 1e400 }",
            [
                "connections.to-right.initial: `{ position = 1e400 }` is not TOML",
                "in quotes",
            ],
        ),
    ] {
        let output = run_orchestrator(&["check", text(&file), "--set", set]);
        assert_refused(&output, &parts, &["struct", "Spec"]);
        assert!(output.err.contains("(given with --set)"), "{}", output.err);
    }
}

#[test]
fn participant_with_an_invalid_name_is_refused_at_its_line() {
    let folder = Folder::new("bad-names");
    let whole = std::fs::read_to_string(fixture::write_two_masses(&folder)).expect("it was written");
    assert!(whole.contains("[participants.left]"), "{whole}");
    for name in ["a.b", "a b", "1a", ""] {
        let wrong = whole
            .replace("[participants.left]", &format!("[participants.\"{name}\"]"))
            .replace("[participants.left.", &format!("[participants.\"{name}\"."))
            .replace("\"left.", &format!("\"{name}."));
        let line = wrong
            .lines()
            .position(|line| line.starts_with("[participants.\""))
            .expect("it is there")
            + 1;
        let output = run_orchestrator(&["check", text(&folder.write("names.toml", &wrong))]);
        let expected = format!("participants.{name}: `{name}` is not a name: use up to 64 letters");
        assert_refused(&output, &[&expected, "starting with a letter"], &["connections"]);
        assert!(
            name.is_empty() || output.err.contains(&format!("names.toml:{line}: ")),
            "{}",
            output.err
        );
    }
}

#[test]
fn missing_folder_is_reported() {
    let folder = Folder::new("no-folder");
    let whole = std::fs::read_to_string(fixture::write_two_masses(&folder)).expect("it was written");
    let file = folder.write("elsewhere.toml", &format!("folder = \"/nonexistent\"\n{whole}"));
    // Builtins need no folder; a program is started in it.
    let output = run_orchestrator(&["check", text(&file)]);
    assert_eq!(output.code, Some(0), "{output:?}");
    let expected = "elsewhere.toml:1: folder: there is no folder `/nonexistent`";
    assert!(format!("{}{}", output.out, output.err).contains(expected), "{output:?}");
    let output = run_orchestrator(&[
        "check",
        text(&file),
        "--set",
        "participants.left.run={ exe = \"true\" }",
    ]);
    assert_refused(
        &output,
        &[
            "folder: there is no folder `/nonexistent",
            "in which programs are started",
        ],
        &[],
    );
}

#[test]
fn titles_with_control_characters_are_refused_and_escaped() {
    let folder = Folder::new("titles");
    let file = fixture::write_two_masses(&folder);
    let out = folder.path().join("out");
    let list = folder.write("cases.toml", "title = \"\\u001b[2J\"\n[[case]]\nname = \"healthy\"\n");
    let cases = run_orchestrator(&["faults", text(&file), "--cases", text(&list), "--out", text(&out)]);
    let stock = std::fs::read_to_string(root().join("gains/p-diagonal.spec.toml")).expect("it is there");
    let title = stock
        .lines()
        .find(|line| line.starts_with("title = "))
        .expect("it has a title");
    let spec = folder.write("p.spec.toml", &stock.replace(title, "title = \"\\u001b[2J\""));
    let tuned = run_orchestrator(&["tune", text(&spec), "--out", text(&out)]);
    for (output, name) in [(cases, "cases.toml"), (tuned, "p.spec.toml")] {
        let expected = "title: \"\\u{1b}[2J\" has the control character";
        assert_refused(
            &output,
            &[name, expected, "write one line without control characters"],
            &["\u{1b}"],
        );
    }
    assert!(!out.exists(), "nothing is written");
}

#[test]
fn error_in_an_override_names_its_origin() {
    let folder = Folder::new("where-from");
    let file = fixture::write_two_masses(&folder);
    let out = folder.path().join("out");
    let shadow = ["--shadow", "left=builtin:spring", "--shadow-set", "massx=1"];
    let output = run_orchestrator(&[&["run", text(&file), "--out", text(&out)], &shadow[..]].concat());
    assert_refused(&output, &["massx", "given with --shadow-set"], &["given with --set"]);
    let vary = ["--vary", "connections.to-right.dellay=0ms"];
    let output = run_orchestrator(&[&["sweep", text(&file), "--out", text(&out)], &vary[..]].concat());
    assert_refused(&output, &["dellay", "varied by the campaign"], &["--set"]);
    let campaign = "scenario = \"m.toml\"\npoints = 4\n[vary.k]\nkey = \"participants.left.parameters.stiffness\"\n\
                    distribution = \"uniform\"\nfrom = \"-9 N/m\"\nto = \"-5 N/m\"\n";
    let campaign = folder.write("campaign.toml", campaign);
    let output = run_orchestrator(&["sweep", text(&campaign), "--out", text(&out)]);
    assert_refused(&output, &["vary.k", "varied by the campaign"], &["--set"]);
    assert!(!out.exists(), "nothing is written");
}

#[test]
fn program_in_an_option_is_relative_to_the_working_directory() {
    let folder = Folder::new("given-here");
    let file = fixture::write_two_masses(&folder);
    for option in ["--substitute", "--shadow"] {
        for name in ["./nothere", "nothere.so"] {
            let out = folder.path().join("out");
            let given = format!("left={name}");
            let output = run_orchestrator(&["run", text(&file), "--out", text(&out), option, &given]);
            let here = root().join("nothere");
            assert_refused(&output, &[text(&here), option], &["scenario's folder"]);
            assert!(!out.exists(), "nothing is written");
        }
    }
    let output = run_orchestrator(&[
        "check",
        text(&file),
        "--set",
        "participants.left.run={ exe = \"./nothere\" }",
    ]);
    assert_refused(&output, &["one from the scenario's folder", "given with --set"], &[]);
}

#[test]
fn parameters_refused_by_a_substitute_name_the_substitute() {
    let folder = Folder::new("taken-over");
    let file = fixture::write_two_masses(&folder);
    let refuses = "the builtin `controller` refuses `participants.left.parameters";
    for option in ["--substitute", "--shadow"] {
        let given = format!("given with {option}");
        let out = folder.path().join("out");
        let output = run_orchestrator(&[
            "run",
            text(&file),
            "--out",
            text(&out),
            option,
            "left=builtin:controller",
        ]);
        assert_refused(
            &output,
            &["m.toml: participants.left.run: ", refuses, "(line ", &given],
            &[],
        );
        assert!(!out.exists(), "nothing is written");
    }
    let spring = std::fs::read_to_string(&file).expect("the scenario is there");
    let policy = "on-failure = { substitute = { builtin = \"controller\" } }";
    let part = "period = \"1 ms\"";
    assert!(spring.contains(part), "{spring}");
    let policy = folder.write("policy.toml", &spring.replacen(part, &format!("{part}\n{policy}"), 1));
    let output = run_orchestrator(&["check", text(&policy)]);
    assert_refused(
        &output,
        &[
            "policy.toml:",
            "participants.left.on-failure.substitute: ",
            refuses,
            "(line ",
        ],
        &[],
    );
    let fault =
        "[[faults]]\nat = \"0.1 s\"\nsubstitute = \"left\"\nstate = \"cold\"\nrun = { builtin = \"controller\" }\n";
    let fault = folder.write("fault.toml", &format!("{spring}\n{fault}"));
    let output = run_orchestrator(&["check", text(&fault)]);
    assert_refused(
        &output,
        &["fault.toml:", "faults.fault-1.run: ", refuses, "(line "],
        &[],
    );
}

#[test]
fn external_program_is_refused_in_process_before_any_run() {
    let folder = Folder::new("of-its-own");
    let file = fixture::write_two_masses(&folder);
    let out = folder.path().join("out");
    let mut run = vec!["run", text(&file), "--out", text(&out), "--in-process"];
    run.extend(["--set", "participants.left.run={ exe = \"true\" }"]);
    let parts = [
        "participants.left.run: participant `left` is a program of its own, `true`",
        "leave out --in-process",
        "given with --set",
    ];
    assert_refused(&run_orchestrator(&run), &parts, &[]);
    assert!(!out.exists(), "nothing is written");
}

#[test]
fn patience_without_effect_is_warned_of() {
    let folder = Folder::new("no-patience");
    let file = fixture::write_two_masses(&folder);
    let warning = "warning: --patience 5 s has no effect on a run in one process";
    for (number, (more, warned)) in [
        (&["--patience", "5 s", "--in-process"][..], true),
        (&["--patience", "5 s"], false),
        (&["--in-process"], false),
    ]
    .into_iter()
    .enumerate()
    {
        let out = folder.path().join(number.to_string());
        let output = run_orchestrator(&[&["run", text(&file), "--out", text(&out)], more].concat());
        assert_eq!(output.code, Some(0), "{output:?}");
        assert_eq!(output.err.contains(warning), warned, "{output:?}");
    }
}

#[test]
fn unreadable_file_is_refused_and_reported_once() {
    let nothing = Folder::new("read-once").path().join("nothere");
    let nothing = |ending: &str| nothing.with_extension(ending);
    for (command, file, part) in [
        (&["fmu", "inspect"][..], nothing("fmu"), "No such file"),
        (&["fmu", "inspect"], "/etc/passwd".into(), "/etc/passwd"),
        (&["model"], nothing("urdf"), "No such file"),
        (&["model"], root().join("scenarios/close.toml"), "close.toml"),
    ] {
        let output = run_orchestrator(&[command, &[text(&file)]].concat());
        assert_refused(&output, &[part], &[]);
        let line = output.err.lines().next().unwrap().trim_start_matches("error: ");
        let said_twice = line
            .split(": ")
            .any(|words| words.len() > 12 && line.matches(words).count() > 1);
        assert!(!said_twice, "{}", output.err);
    }
}

#[test]
fn participant_exit_before_the_handshake_is_reported() {
    let folder = Folder::new("ends-early");
    let file = fixture::write_two_masses(&folder);
    let out = folder.path().join("out");
    let killed = folder.write("killed", "#!/bin/sh\nkill -9 $$\n");
    let mode = std::os::unix::fs::PermissionsExt::from_mode(0o755);
    std::fs::set_permissions(&killed, mode).unwrap();
    for (program, how) in [
        (Path::new("/bin/true"), "exited with status 0"),
        (&killed, "was ended by signal 9 (killed)"),
    ] {
        let given = format!("left={}", text(program));
        let output = run_orchestrator(&[
            "run",
            text(&file),
            "--substitute",
            &given,
            "--out",
            text(&out),
            "--force",
        ]);
        assert_eq!(output.code, Some(1), "{output:?}");
        let words = format!("participant `left`: {how} before it had entered the run; it wrote nothing");
        assert!(output.err.contains(&words), "{output:?}");
    }
}

#[test]
fn export_of_a_window_without_samples_is_refused() {
    let folder = Folder::new("empty-export");
    let file = fixture::write_two_masses(&folder);
    let (run, out) = (folder.path().join("run"), folder.path().join("out"));
    let output = run_orchestrator(&["run", text(&file), "--in-process", "--out", text(&run)]);
    assert_eq!(output.code, Some(0), "{output:?}");
    for format in ["csv", "parquet", "mat", "mcap"] {
        let windows: [(&[&str], &[&str]); 2] = [
            (
                &["--from", "50ms", "--until", "30ms"],
                &["--until: ", "30 ms", "50 ms", "the window is empty"],
            ),
            (
                &["--from", "1000 h"],
                &["--from: ", "no sample lies at or after", "have samples from 0.0 s to"],
            ),
        ];
        for (window, expected) in windows {
            let output =
                run_orchestrator(&[&["export", text(&run), "--to", format, "--out", text(&out)], window].concat());
            assert_refused(&output, expected, &[]);
            assert!(!out.exists(), "nothing is written");
        }
    }
}

/// The same command, with its standard output on a disk that is full.
fn run_on_full_disk(arguments: &[&str]) -> ProgramOutput {
    let mut command = std::process::Command::new("/bin/sh");
    command
        .args(["-c", "exec \"$0\" \"$@\" >/dev/full"])
        .arg(orchestrator());
    let child = command
        .args(arguments)
        .current_dir(root())
        .stdin(std::process::Stdio::null());
    let output = child.output().expect("a shell can be started");
    output.into()
}

#[test]
fn output_that_cannot_be_written_is_an_error() {
    let folder = Folder::new("full");
    let file = fixture::write_two_masses(&folder);
    let run = folder.path().join("run");
    let (file, run) = (text(&file), text(&run));
    let whole: &[&[&str]] = &[
        &["run", file, "--in-process", "--out", run],
        &["check", file],
        &["check", file, "--json"],
        &["graph", file],
        &["export", run, "--to", "csv"],
        &["compare", run, run],
        &["measure", run, "--of", "left.motion.position", "--compute", "max"],
        &["report", run],
        &["completions", "bash"],
        &["man"],
        &["model", "models/servicer.urdf"],
        &["--help"],
        &["check", "--help"],
        &["--version"],
    ];
    for arguments in whole {
        let output = run_on_full_disk(arguments);
        assert_eq!(output.code, Some(1), "{arguments:?}: {output:?}");
        let expected = "error: standard output cannot be written: No space left on device";
        assert_eq!(output.err.matches(expected).count(), 1, "{arguments:?}: {output:?}");
        assert_eq!(output.err.matches("No space").count(), 1, "{arguments:?}: {output:?}");
    }
    // The work that was done remains done.
    assert!(Path::new(run).join("summary.json").exists() && Path::new(run).join("report.html").exists());
    // Where there is no output, none is missing.
    assert_eq!(
        run_on_full_disk(&["run", file, "--quiet", "--force", "--out", run]).code,
        Some(0)
    );
}
