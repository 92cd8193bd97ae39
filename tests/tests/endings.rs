//! All ways in which a run may end: the right exit code, a message that names the culprit, no process, nothing in shared memory, and a
//! tape that is a prefix of the undisturbed one.

use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use escapement_tests::fixture::write_oscillator;
use escapement_tests::machine::{leftovers, orphans, processes_of, send_signal, wait_for_bytes, writer_of};
use escapement_tests::program::{
    Folder, ProgramOutput, orchestrator, participant, root, run_orchestrator, start_orchestrator, text, wait_for_output,
};

/// Runs the oscillator with `damper` and checks what is left behind.
fn run_with_damper(damper: &str, more: &[&str]) -> (Folder, ProgramOutput) {
    let folder = Folder::new(damper);
    let scenario = write_oscillator(&folder, damper);
    let out = folder.path().join("run");
    let mut arguments = vec!["run", text(&scenario), "--out", text(&out)];
    arguments.extend(more);
    let output = run_orchestrator(&arguments);
    assert_nothing_left(&folder);
    (folder, output)
}

fn assert_nothing_left(folder: &Folder) {
    assert_eq!(processes_of(folder.path()), Vec::<String>::new(), "processes are left");
    assert_eq!(orphans(), Vec::<String>::new(), "shared memory is left");
}

/// Checks that the tape in `folder` is a prefix of the undisturbed one.
fn assert_prefix(folder: &Folder) -> u64 {
    let undisturbed = Folder::new("undisturbed");
    let scenario = write_oscillator(&undisturbed, "damper");
    let out = undisturbed.path().join("run");
    assert_eq!(
        run_orchestrator(&["run", text(&scenario), "--out", text(&out), "--quiet"]).code,
        Some(0)
    );
    let mut shortest = u64::MAX;
    for stream in ["plant.motion.bin", "damper.push.bin"] {
        let whole = std::fs::read(out.join("tape").join(stream)).unwrap();
        let part = std::fs::read(folder.path().join("run/tape").join(stream)).unwrap();
        assert!(whole.starts_with(&part), "{stream} is not a prefix");
        assert_eq!(part.len() % 24, 0, "{stream} ends in the middle of a sample");
        shortest = shortest.min(part.len() as u64 / 24);
    }
    shortest
}

#[test]
fn healthy_run_leaves_only_its_folder() {
    let (folder, output) = run_with_damper("damper", &["--json"]);
    assert_eq!(output.code, Some(0), "{output:?}");
    assert_eq!(output.json()["simulated_time_s"], 10.0);
    assert_eq!(assert_prefix(&folder), 1000);
    for file in [
        "plan.toml",
        "run.json",
        "summary.json",
        "tape/index.json",
        "log/plant.stderr",
    ] {
        assert!(folder.path().join("run").join(file).exists(), "{file}");
    }
}

#[test]
fn run_allocates_nothing_between_its_second_and_last_step() {
    for wait in ["spin", "yield", "sleep"] {
        let (folder, output) = run_with_damper("counting", &["--wait", wait]);
        assert_eq!(output.code, Some(0), "{output:?}");
        assert_eq!(assert_prefix(&folder), 1000);
    }
}

#[test]
fn abort_is_named_with_its_signal_and_time() {
    let (folder, output) = run_with_damper("crash_at", &[]);
    assert_eq!(output.code, Some(1), "{output:?}");
    assert!(
        output.err.contains("`damper`") && output.err.contains("signal 6") && output.err.contains("t = 2 s"),
        "{output:?}"
    );
    assert_eq!(assert_prefix(&folder), 200);
}

#[test]
fn failed_run_has_no_verdict() {
    let measure = "measures.peak={ of = \"plant.motion.position\", compute = \"max-abs\", at-most = \"1 km\" }";
    let (folder, output) = run_with_damper("crash_at", &["--set", measure]);
    assert_eq!(output.code, Some(1), "{output:?}");
    assert!(
        output.out.contains("no verdict: the run did not complete"),
        "{output:?}"
    );
    assert!(output.out.contains("ok   peak"), "{output:?}");
    assert!(!output.out.lines().any(|line| line == "met"), "{output:?}");
    let summary = std::fs::read_to_string(folder.path().join("run/summary.json")).expect("a run has a summary");
    let summary: serde_json::Value = serde_json::from_str(&summary).expect("it is JSON");
    assert!(summary.get("verdict").is_none(), "{summary}");
}

#[test]
fn early_exit_is_not_a_success() {
    let (folder, output) = run_with_damper("exit_at", &[]);
    assert_eq!(output.code, Some(1), "{output:?}");
    assert!(
        output.err.contains("`damper`") && output.err.contains("exited with status 0"),
        "{output:?}"
    );
    assert_eq!(assert_prefix(&folder), 200);
}

#[test]
fn panic_is_reported_with_its_message() {
    let (folder, output) = run_with_damper("panics", &[]);
    assert_eq!(output.code, Some(1), "{output:?}");
    assert!(
        output.err.contains("`damper`") && output.err.contains("the valve is stuck at t = 2 s"),
        "{output:?}"
    );
    assert_eq!(assert_prefix(&folder), 200);
}

#[test]
fn nan_is_named_with_port_and_field() {
    let (folder, output) = run_with_damper("nan", &[]);
    assert_eq!(output.code, Some(1), "{output:?}");
    assert!(
        output.err.contains("`push`") && output.err.contains("force = NaN") && output.err.contains("t = 2 s"),
        "{output:?}"
    );
    assert_eq!(assert_prefix(&folder), 200);
}

#[test]
fn hang_is_diagnosed_and_ended() {
    let (folder, output) = run_with_damper("hangs", &["--patience", "3 s"]);
    assert_eq!(output.code, Some(1), "{output:?}");
    for part in [
        "damper (pid ",
        ", alive, computing for 3.",
        "has not published push #200; plant waits for it at t = 2 s; recorder idle",
    ] {
        assert!(output.err.contains(part), "`{part}` is not in: {}", output.err);
    }
    assert!(
        output.err.contains("waiting for sample #200 of damper.push"),
        "{output:?}"
    );
    assert_eq!(assert_prefix(&folder), 200);
}

#[test]
fn participant_that_ignores_terminate_is_killed() {
    let folder = Folder::new("ignores_terminate");
    let scenario = write_oscillator(&folder, "ignores_terminate");
    let out = folder.path().join("run");
    let mut child = start_orchestrator(&["run", text(&scenario), "--out", text(&out)]);
    // The plant cannot continue without the outstanding sample of the damper.
    wait_for_bytes(&mut child, &out.join("tape/plant.motion.bin"), 24 * 501);
    send_signal(child.id(), rustix::process::Signal::TERM);
    let output = wait_for_output(child);
    assert_eq!(output.code, Some(1), "{output:?}");
    assert!(output.err.contains("interrupted at t = 0.5"), "{output:?}");
    assert_nothing_left(&folder);
    assert_eq!(assert_prefix(&folder), 50);
}

#[test]
fn slow_participant_is_waited_for() {
    let (folder, output) = run_with_damper("slow", &["--duration", "2 s", "--patience", "1 s", "--json"]);
    assert_eq!(output.code, Some(0), "{output:?}");
    assert_eq!(assert_prefix(&folder), 200);
    // The damper's own CPU time, at least 3 ms in each step, is not reported as waiting for others.
    let timing = &output.json()["timing"]["damper"];
    let waits = timing["inputs_ns"].as_object().expect("waits by input").values();
    let waited: u64 = waits.map(|wait| wait.as_u64().expect("a number")).sum();
    let total = timing["total_ns"].as_u64().expect("a number");
    assert!(total >= waited + 200 * 3_000_000, "{timing}");
}

#[test]
fn flood_of_log_lines_is_limited() {
    let at_once = format!(
        "participants.damper.run={{ exe = '{}', args = ['at-once'] }}",
        participant("floods").display()
    );
    for more in [&[][..], &["--set", &at_once]] {
        let (folder, output) = run_with_damper("floods", more);
        assert_eq!(output.code, Some(1), "{output:?}");
        assert!(
            output
                .err
                .contains("`damper`: wrote more than 64 MiB to standard error"),
            "{}",
            &output.err[..200]
        );
        let log = std::fs::metadata(folder.path().join("run/log/damper.stderr")).unwrap();
        assert_eq!(log.len(), 64 << 20);
    }
}

#[test]
fn death_is_reported_while_another_participant_starts() {
    let silent = format!(
        "participants.plant.run={{ exe = '{}' }}",
        participant("silent").display()
    );
    let (_, output) = run_with_damper("early_exit", &["--set", &silent]);
    assert_eq!(output.code, Some(1), "{output:?}");
    assert!(output.err.contains("`damper`: exited with status 7"), "{output:?}");
}

#[test]
fn death_during_a_pause_ends_the_run() {
    let folder = Folder::new("paused");
    let scenario = write_oscillator(&folder, "damper");
    let out = folder.path().join("run");
    let mut command = Command::new(orchestrator());
    command
        .args(["run", text(&scenario), "--out", text(&out), "--pause-at", "1 s"])
        .current_dir(root())
        // No key is pressed, and the input does not end.
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    wait_for_bytes(&mut child, &out.join("tape/plant.motion.bin"), 24 * 1001);
    send_signal(pid_of(&folder, "damper"), rustix::process::Signal::KILL);
    let output = wait_for_output(child);
    assert_eq!(output.code, Some(1), "{output:?}");
    assert!(
        output.err.contains("`damper`") && output.err.contains("signal 9"),
        "{output:?}"
    );
    assert_nothing_left(&folder);
    assert_eq!(assert_prefix(&folder), 100);
}

#[test]
fn participant_that_never_connects_is_reported_with_its_log() {
    let (_, output) = run_with_damper("early_exit", &[]);
    assert_eq!(output.code, Some(1), "{output:?}");
    assert!(output.err.contains("exited with status 7"), "{output:?}");
    assert!(output.err.contains("the licence server does not answer"), "{output:?}");
}

#[test]
fn port_in_other_units_is_refused_with_the_difference() {
    let (_, output) = run_with_damper("wrong_descriptor", &[]);
    assert_eq!(output.code, Some(2), "{output:?}");
    assert!(
        output.err.contains("in kN") && output.err.contains("in N") && output.err.contains("connections.push"),
        "{output:?}"
    );
}

/// A run that takes long enough to be disturbed: paced to the wall clock.
fn start_paced_run(name: &str) -> (Folder, std::process::Child) {
    let folder = Folder::new(name);
    let scenario = write_oscillator(&folder, "damper");
    let out = folder.path().join("run");
    let mut child = start_orchestrator(&["run", text(&scenario), "--out", text(&out), "--real-time=2"]);
    // In progress: both participants have logged a line.
    for stream in ["plant.motion.bin", "damper.push.bin"] {
        wait_for_bytes(&mut child, &out.join("tape").join(stream), 24 * 20);
    }
    (folder, child)
}

fn pid_of(folder: &Folder, participant: &str) -> u32 {
    let log = folder.path().join("run/log").join(format!("{participant}.stderr"));
    writer_of(&log).expect("the participant runs")
}

#[test]
fn interrupt_ends_a_run_in_an_orderly_way() {
    for which in [
        rustix::process::Signal::INT,
        rustix::process::Signal::TERM,
        rustix::process::Signal::HUP,
    ] {
        let (folder, child) = start_paced_run("interrupted");
        send_signal(child.id(), which);
        let output = wait_for_output(child);
        assert_eq!(output.code, Some(1), "{output:?}");
        assert!(output.err.contains("interrupted at t = "), "{output:?}");
        assert_nothing_left(&folder);
        assert!(assert_prefix(&folder) > 10);
    }
}

#[test]
fn second_interrupt_ends_a_run_at_once_without_leftovers() {
    let folder = Folder::new("impatient");
    let scenario = write_oscillator(&folder, "ignores_terminate");
    let out = folder.path().join("run");
    let mut child = start_orchestrator(&[
        "run",
        text(&scenario),
        "--out",
        text(&out),
        "--real-time",
        "--duration",
        "1 h",
    ]);
    wait_for_bytes(&mut child, &out.join("tape/plant.motion.bin"), 24);
    // An orderly end takes two seconds for the participant that ignores it: the second signal arrives in between. Two signals of one kind
    // might be merged into one.
    send_signal(child.id(), rustix::process::Signal::INT);
    send_signal(child.id(), rustix::process::Signal::TERM);
    let output = wait_for_output(child);
    assert_eq!(output.code, Some(1), "{output:?}");
    assert!(
        !output.err.contains("interrupted at t"),
        "there was no time for words: {output:?}"
    );
    let started = Instant::now();
    while !processes_of(folder.path()).is_empty() {
        assert!(started.elapsed() < Duration::from_secs(60), "children outlive it");
        std::thread::sleep(Duration::from_millis(2));
    }
    assert_eq!(run_orchestrator(&["doctor", "--remove"]).code, Some(0));
    assert_eq!(leftovers(), Vec::<String>::new());
}

#[test]
fn killed_participant_is_reported() {
    for participant_name in ["plant", "damper"] {
        let (folder, child) = start_paced_run("killed");
        send_signal(pid_of(&folder, participant_name), rustix::process::Signal::KILL);
        let output = wait_for_output(child);
        assert_eq!(output.code, Some(1), "{output:?}");
        assert!(
            output.err.contains(&format!("`{participant_name}`")) && output.err.contains("signal 9"),
            "{output:?}"
        );
        assert_nothing_left(&folder);
        assert!(assert_prefix(&folder) > 10);
    }
}

#[test]
fn killed_orchestrator_ends_its_children_without_leftovers() {
    let (folder, child) = start_paced_run("beheaded");
    let children = [pid_of(&folder, "plant"), pid_of(&folder, "damper")];
    send_signal(child.id(), rustix::process::Signal::KILL);
    let output = wait_for_output(child);
    assert_eq!(output.code, None, "{output:?}");
    let started = Instant::now();
    while children.iter().any(|pid| is_alive(*pid)) {
        assert!(
            started.elapsed() < Duration::from_secs(20),
            "the children outlive the orchestrator"
        );
        std::thread::sleep(Duration::from_millis(5));
    }
    assert!(assert_prefix(&folder) > 10);
    assert_eq!(run_orchestrator(&["doctor", "--remove"]).code, Some(0));
    assert_eq!(leftovers(), Vec::<String>::new());
}

/// Whether the process exists and is not a zombie that waits for its new parent.
fn is_alive(pid: u32) -> bool {
    std::fs::read_to_string(format!("/proc/{pid}/stat")).is_ok_and(|stat| {
        !stat
            .rsplit(')')
            .next()
            .unwrap_or_default()
            .trim_start()
            .starts_with('Z')
    })
}

#[test]
fn simultaneous_runs_are_isolated() {
    let folder = Folder::new("twins");
    let scenario = write_oscillator(&folder, "damper");
    let outs = ["one", "two", "three"].map(|name| folder.path().join(name));
    let children = outs
        .clone()
        .map(|out| start_orchestrator(&["run", text(&scenario), "--out", text(&out), "--quiet"]));
    for child in children {
        let output = wait_for_output(child);
        assert_eq!(output.code, Some(0), "{output:?}");
    }
    for other in &outs[1..] {
        assert_eq!(
            run_orchestrator(&["compare", text(&outs[0]), text(other)]).code,
            Some(0)
        );
    }
    assert_nothing_left(&folder);
}

/// Runs the oscillator under a limit of the shell. `-f KIB` limits the size of its files, including shared memory: equivalent to a full
/// disk, and needs no privileges.
fn run_under_limit(limit: &str, duration: &str) -> (Folder, ProgramOutput) {
    let folder = Folder::new("limited");
    let scenario = write_oscillator(&folder, "damper");
    let shell = format!(
        "ulimit {limit}; exec '{}' run '{}' --out '{}' --duration '{duration}'",
        orchestrator().display(),
        scenario.display(),
        folder.path().join("run").display()
    );
    let mut command = Command::new("bash");
    command
        .args(["-c", &shell])
        .current_dir(root())
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    let output = wait_for_output(command.spawn().unwrap());
    assert_nothing_left(&folder);
    (folder, output)
}

#[test]
fn full_disk_ends_the_run_and_names_the_file() {
    // 64 MiB are enough for shared memory and too little for 3,600,000 samples of 24 bytes.
    let (folder, output) = run_under_limit("-f 65536", "3600 s");
    assert_eq!(output.code, Some(1), "{output:?}");
    assert!(output.err.contains("plant.motion.bin"), "{output:?}");
    assert!(folder.path().join("run/summary.json").exists(), "{output:?}");
    let sound = tape::Reader::open(&folder.path().join("run/tape"));
    assert!(sound.is_ok(), "{:?}", sound.err());
}

#[test]
fn memory_that_a_limit_forbids_is_named_before_the_start() {
    // 400 KiB is less than the largest object in shared memory.
    let (folder, output) = run_under_limit("-f 400", "10 s");
    assert_eq!(output.code, Some(1), "{output:?}");
    for part in [
        "shared memory: the run needs an object of",
        "files may have 400 KiB",
        "ulimit -f",
    ] {
        assert!(output.err.contains(part), "`{part}` is not in: {output:?}");
    }
    assert!(!folder.path().join("run").exists(), "nothing was to start");
    assert_eq!(leftovers(), Vec::<String>::new());
}

#[test]
fn too_few_open_files_are_named_before_the_start() {
    let (folder, output) = run_under_limit("-n 60", "10 s");
    assert_eq!(output.code, Some(1), "{output:?}");
    for part in ["open files: the run needs about", "a process may open 60", "ulimit -n"] {
        assert!(output.err.contains(part), "`{part}` is not in: {output:?}");
    }
    assert!(!folder.path().join("run").exists(), "nothing was to start");
}

#[test]
fn file_beyond_the_size_limit_is_named_by_export_and_report() {
    let (folder, output) = run_with_damper("damper", &["--quiet"]);
    assert_eq!(output.code, Some(0), "{output:?}");
    let run = folder.path().join("run");
    let page = folder.path().join("run/report.html");
    std::fs::write(&page, "the page of before").expect("the folder can be written");
    for command in ["export --to csv", "export --to mcap", "report"] {
        let program = orchestrator().display();
        let shell = format!("ulimit -f 8; exec '{program}' {command} '{}'", run.display());
        let mut command = Command::new("bash");
        command.args(["-c", &shell]).current_dir(root());
        let output: ProgramOutput = command.output().expect("a shell can be started").into();
        assert_eq!(output.code, Some(1), "{output:?}");
        assert!(output.err.contains(text(folder.path())), "{output:?}");
    }
    let kept = std::fs::read_to_string(&page).expect("the page is there");
    assert_eq!(kept, "the page of before");
    assert!(!folder.path().join("run/report.html.part").exists());
}

#[test]
fn as_many_files_are_opened_as_the_system_grants() {
    // The soft limit is for programs that react to it by stopping; the hard limit stays unchanged.
    let (folder, output) = run_under_limit("-S -n 48", "1 s");
    assert_eq!(output.code, Some(0), "{output:?}");
    assert_eq!(assert_prefix(&folder), 100);
}

#[test]
fn pause_stops_all_participants_before_the_instant() {
    let folder = Folder::new("pause");
    let scenario = write_oscillator(&folder, "damper");
    let out = folder.path().join("run");
    // The end of the input ends the run at the pause.
    let output = run_orchestrator(&["run", text(&scenario), "--out", text(&out), "--pause-at", "1.2345 s"]);
    assert!(output.err.contains("paused at t = 1.235 s"), "{output:?}");
    let samples = |stream: &str| std::fs::metadata(out.join("tape").join(stream)).unwrap().len() / 24;
    // Steps at 0 … 1.234 s: 1235 of the plant and one initial sample; 124 of the damper.
    assert_eq!((samples("plant.motion.bin"), samples("damper.push.bin")), (1236, 124));
    assert_prefix(&folder);
}
