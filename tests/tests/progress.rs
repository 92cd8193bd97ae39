//! The progress of a long run without a terminal.

use std::process::{Child, Command, Stdio};

use escapement_tests::program::{Folder, ProgramOutput, built, root, text, wait_for_output};

/// A minute at five times the wall clock's pace: twelve seconds, whatever the machine.
fn long_run(out: &str, more: &[&str]) -> Child {
    let mut command = Command::new(built().join("lander"));
    command
        .args(["run", "examples/lander/lander.toml", "--real-time=5"])
        .args(["--in-process", "--out", out])
        .args(more)
        .current_dir(root())
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    command.spawn().expect("the program can be started")
}

#[test]
fn long_run_without_a_terminal_reports_on_stderr_alone() {
    let folder = Folder::new("progress");
    let out = |name: &str| text(&folder.path().join(name)).to_owned();
    let runs = [
        long_run(&out("plain"), &[]),
        long_run(&out("json"), &["--json"]),
        long_run(&out("quiet"), &["--quiet"]),
    ];
    let [plain, json, quiet]: [ProgramOutput; 3] = runs.map(wait_for_output);
    for output in [&plain, &json] {
        assert_eq!(output.code, Some(0), "{output:?}");
        assert!(!output.out.contains("times real time,"), "{output:?}");
        let line = output.err.lines().find(|line| line.starts_with("t = "));
        let line = line.unwrap_or_else(|| panic!("no line after ten seconds: {output:?}"));
        for part in [" s of 60 s (", " %), ", " times real time, ", " s left"] {
            assert!(line.contains(part), "{line}");
        }
        assert!(!output.err.contains('\r'), "nothing moves in a file: {output:?}");
    }
    assert_eq!(json.json()["simulated_time_s"], 60.0);
    assert_eq!((quiet.code, quiet.out.as_str(), quiet.err.as_str()), (Some(0), "", ""));
}
