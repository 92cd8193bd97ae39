//! The reader of a program's output may close the pipe at any time (`| head -1`): no panic, the work continues, and the exit code is that
//! of the command.

use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Child, Command, Stdio};

use escapement_tests::machine;
use escapement_tests::program::{Folder, orchestrator, root, run_orchestrator};

/// Starts a command with both of its outputs connected to pipes without a reader.
fn start_with_closed_pipes(arguments: &[&str]) -> Child {
    let (out_reader, out) = std::io::pipe().unwrap();
    let (err_reader, err) = std::io::pipe().unwrap();
    drop((out_reader, err_reader));
    let mut command = Command::new(orchestrator());
    command.args(arguments).current_dir(root());
    command.stdin(Stdio::null()).stdout(out).stderr(err);
    command.spawn().expect("the orchestrator can be started")
}

fn text(path: &Path) -> &str {
    path.to_str().expect("paths of tests are text")
}

#[test]
fn commands_keep_their_exit_code_on_a_closed_pipe() {
    let folder = Folder::new("unheard");
    let (run, other, page) = (
        folder.path().join("run"),
        folder.path().join("other"),
        folder.path().join("page.html"),
    );
    let (run, other, page) = (text(&run), text(&other), text(&page));
    let short = ["scenarios/close.toml", "--duration", "0.2 s"];
    let commands: &[(&[&str], i32)] = &[
        // Too short to capture anything: the criteria are not met.
        (&["run", short[0], short[1], short[2], "--out", run], 3),
        (
            &[
                "run",
                short[0],
                short[1],
                short[2],
                "--in-process",
                "--json",
                "--out",
                other,
            ],
            3,
        ),
        (&["run", "scenarios/close.toml", "--set", "nobody=1"], 2),
        (&["check", "scenarios/close.toml"], 0),
        (&["check", "scenarios/close.toml", "--json"], 0),
        (&["graph", "scenarios/close.toml"], 0),
        (&["compare", run, other], 0),
        (&["replay", run, "--participant", "guidance"], 0),
        (&["replay", run, "--participant", "nobody"], 2),
        (&["report", run, "--out", page], 0),
        (&["export", run, "--to", "csv"], 0),
        (&["export", page, "--to", "csv"], 2),
        (&["doctor"], 0),
        (&["model", "models/servicer.urdf"], 0),
        (&["margins", "gains/start.toml", "--help"], 0),
        (&["--version"], 0),
    ];
    for (arguments, expected) in commands {
        let ended = start_with_closed_pipes(arguments).wait().expect("it can be waited for");
        assert_eq!(ended.code(), Some(*expected), "{arguments:?}: {ended:?}");
    }
    assert!(Path::new(page).exists() && Path::new(run).join("summary.json").exists());
}

#[test]
fn run_is_complete_when_its_reader_closes_the_pipe() {
    let folder = Folder::new("left");
    let (whole, left) = (folder.path().join("whole"), folder.path().join("left"));
    let how = ["run", "scenarios/close.toml", "--duration", "3 s"];
    assert_eq!(
        run_orchestrator(&[&how[..], &["--out", text(&whole)]].concat()).code,
        Some(3)
    );
    let mut command = Command::new(orchestrator());
    command
        .args(how)
        .args(["--live", "--pause-at", "1 s", "--out", text(&left)]);
    command
        .current_dir(root())
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    let mut child = command.spawn().expect("the orchestrator can be started");
    let mut stderr = BufReader::new(child.stderr.take().unwrap());
    let mut line = String::new();
    while !line.contains("paused") {
        line.clear();
        assert!(stderr.read_line(&mut line).unwrap() > 0, "it ended before its stop");
    }
    // Paused in the middle of the run: the pipes have no reader any more, and the run is then resumed.
    drop((stderr, child.stdout.take()));
    std::io::Write::write_all(child.stdin.as_mut().unwrap(), b"\n").unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(3));
    let digest = |run: &Path| {
        let mut text = String::new();
        let mut file = std::fs::File::open(run.join("summary.json")).unwrap();
        file.read_to_string(&mut text).unwrap();
        serde_json::from_str::<serde_json::Value>(&text).unwrap()["tape_digest"].clone()
    };
    assert_eq!(digest(&left), digest(&whole));
    assert_eq!(machine::processes_of(&left), Vec::<String>::new());
    let lost = machine::leftovers();
    assert!(!lost.iter().any(|one| one.contains(text(&left))), "{lost:?}");
}
