//! Machines with insufficient resources: reported before anything starts where that is possible, otherwise an orderly end.

use std::path::Path;
use std::process::{Command, Stdio};

use escapement_tests::fixture::{RunFixture, write_oscillator};
use escapement_tests::machine::{send_signal, wait_for_bytes, writer_of};
use escapement_tests::program::{
    Folder, ProgramOutput, copy_program, orchestrator, participant, root, text, wait_for_output,
};
use rustix::process::Signal;

/// Runs `script` with a private shared memory of `size`; `$1` is the program, `$2` the folder. `None` where the system does not allow
/// that.
fn run_with_small_shared_memory(size: &str, folder: &Folder, script: &str) -> Option<ProgramOutput> {
    // Without privileges a user namespace is needed first.
    let flags = ["-m", "-rm"].into_iter().find(|flags| {
        let mount = "mount -t tmpfs none /dev/shm";
        let tried = Command::new("unshare")
            .args([flags, "sh", "-c", mount])
            .stderr(Stdio::null())
            .status();
        tried.is_ok_and(|status| status.success())
    });
    let Some(flags) = flags else {
        eprintln!("skipped: this system gives no shared memory to a test alone (unshare -m)");
        return None;
    };
    let script = format!("mount -t tmpfs -o size={size} none /dev/shm || exit 99\n{script}");
    let mut command = Command::new("unshare");
    command.args([
        flags,
        "bash",
        "-c",
        &script,
        "script",
        text(orchestrator()),
        text(folder.path()),
    ]);
    command
        .current_dir(root())
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    let output = wait_for_output(command.spawn().expect("unshare can be started"));
    assert_ne!(output.code, Some(99), "{output:?}");
    Some(output)
}

/// A ring of `count` relays for a short time.
fn write_ring(folder: &Folder, count: usize) {
    let mut text = String::from("duration = \"50 ms\"\n");
    for number in 0..count {
        let kind = if number == 0 { "continuous" } else { "sampled" };
        let before = (number + count - 1) % count;
        text += &format!(
            "[participants.r{number:03}]\nrun = {{ builtin = \"bench-{kind}\" }}\nperiod = \"1 ms\"\n\
             [connections.c{number:03}]\nfrom = \"r{before:03}.to\"\nto = \"r{number:03}.from\"\n"
        );
    }
    folder.write("s.toml", &text);
}

#[test]
fn too_little_shared_memory_is_refused_with_the_remedy() {
    let folder = Folder::new("little");
    write_ring(&folder, 40);
    let script = "\"$1\" run \"$2/s.toml\" --out \"$2/run\"; code=$?; ls -A /dev/shm >\"$2/left\"; exit $code";
    let Some(output) = run_with_small_shared_memory("4m", &folder, script) else {
        return;
    };
    assert_eq!(output.code, Some(1), "{output:?}");
    for part in [
        "40 participants with 40 links need",
        "in /dev/shm",
        "are free",
        "docker run --shm-size=",
    ] {
        assert!(output.err.contains(part), "`{part}` is not in: {output:?}");
    }
    assert!(!folder.path().join("run").exists(), "nothing was to start");
    assert_eq!(
        std::fs::read_to_string(folder.path().join("left")).ok().as_deref(),
        Some("")
    );
}

#[test]
fn unusable_shared_memory_is_named_by_doctor_and_by_a_run() {
    let folder = Folder::new("read-only");
    write_ring(&folder, 2);
    let script = "mount -o remount,ro /dev/shm || exit 99\n\
                  \"$1\" doctor; \"$1\" doctor --json >\"$2/doctor.json\"; \"$1\" run \"$2/s.toml\" --out \"$2/run\"";
    let Some(output) = run_with_small_shared_memory("64k", &folder, script) else {
        return;
    };
    assert_eq!(output.code, Some(1), "{output:?}");
    let expected = ["/dev/shm is mounted read-only", "remount,rw", "--in-process"];
    for part in expected {
        assert!(output.out.contains(part), "doctor: `{part}` is not in: {output:?}");
        assert!(output.err.contains(part), "run: `{part}` is not in: {output:?}");
    }
    assert!(output.out.contains("warning: shared memory"), "{output:?}");
    let json = std::fs::read_to_string(folder.path().join("doctor.json")).expect("doctor prints JSON");
    let json: serde_json::Value = serde_json::from_str(&json).expect("it is JSON");
    let warning = json["shared_memory_warning"].as_str().unwrap_or_default();
    assert!(warning.contains("read-only"), "{json}");
    assert!(!folder.path().join("run").exists(), "nothing was to start");
    let small = run_with_small_shared_memory("64k", &folder, "\"$1\" doctor").expect("it was possible before");
    for part in [
        "warning: shared memory is too small",
        "are free",
        "docker run --shm-size",
    ] {
        assert!(small.out.contains(part), "`{part}` is not in: {small:?}");
    }
}

#[test]
fn rings_shrink_where_shared_memory_is_small() {
    let folder = Folder::new("shrunk");
    write_ring(&folder, 24);
    // A longer run, in which each participant would need a mebibyte.
    let script = "\"$1\" run \"$2/s.toml\" --duration \"300 ms\" --quiet --out \"$2/run\"; code=$?; \
                  ls -A /dev/shm >\"$2/left\"; exit $code";
    let Some(output) = run_with_small_shared_memory("8m", &folder, script) else {
        return;
    };
    assert_eq!(output.code, Some(0), "{output:?}");
    assert_eq!(
        std::fs::read_to_string(folder.path().join("left")).ok().as_deref(),
        Some("")
    );
}

#[test]
fn shared_memory_that_is_filled_in_mid_run_ends_it_in_order() {
    let folder = Folder::new("filled");
    write_oscillator(&folder, "damper");
    // The damper is the first of the two in alphabetical order, and is to be restarted.
    let script = r#"
        "$1" run "$2/oscillator.toml" --out "$2/run" --real-time=5 --checkpoint-every "500 ms" --quiet \
            --set participants.damper.on-failure=restart-from-checkpoint &
        run=$!
        until [ "$(stat -c %s "$2/run/tape/damper.push.bin" 2>/dev/null || echo 0)" -ge 3000 ]; do
            kill -0 $run || exit 98
            sleep 0.01
        done
        head -c 1G /dev/zero >/dev/shm/filled 2>/dev/null
        read -r damper _ <"/proc/$run/task/$run/children"
        kill -9 "$damper"
        wait $run
        code=$?
        rm /dev/shm/filled
        ls -A /dev/shm >"$2/left"
        exit $code
    "#;
    let Some(output) = run_with_small_shared_memory("16m", &folder, script) else {
        return;
    };
    assert_eq!(output.code, Some(1), "{output:?}");
    assert!(
        output.err.contains("shared memory") && output.err.contains("/dev/shm"),
        "{output:?}"
    );
    assert!(folder.path().join("run/summary.json").exists(), "{output:?}");
    let sound = tape::Reader::open(&folder.path().join("run/tape"));
    assert!(sound.is_ok(), "{:?}", sound.err());
    assert_eq!(
        std::fs::read_to_string(folder.path().join("left")).ok().as_deref(),
        Some("")
    );
}

#[test]
fn program_that_starts_slowly_is_waited_for() {
    let fixture = RunFixture::new("slow_start", "damper");
    let exe = participant("slow_start").display().to_string();
    let slow_start = format!("participants.damper.run={{ exe = '{exe}', args = ['2'] }}");
    let within = "participants.damper.start-within=1s";
    let output = fixture.run("late", &["--set", &slow_start, "--set", within]);
    assert_eq!(output.code, Some(1), "{output:?}");
    for part in [
        "`damper`",
        "did not enter the run within 1 s of its start",
        "start-within",
    ] {
        assert!(output.err.contains(part), "`{part}` is not in: {output:?}");
    }
    // The command line takes precedence.
    let output = fixture.run(
        "run",
        &["--set", &slow_start, "--set", within, "--start-within", "60 s"],
    );
    assert_eq!(output.code, Some(0), "{output:?}");
    fixture.assert_same_as_undisturbed("run");
    let output = fixture.run("never", &["--set", "participants.damper.start-within=0s"]);
    assert_eq!(output.code, Some(2), "{output:?}");
    assert!(output.err.contains("participants.damper.start-within"), "{output:?}");
}

/// A copy of the program in `folder`, so that another one can take its name.
fn copy(folder: &Path) -> std::path::PathBuf {
    let copy = folder.join("orchestrator");
    copy_program(orchestrator(), &copy);
    copy
}

#[test]
fn builtin_is_restarted_after_its_program_was_rebuilt() {
    let folder = Folder::new("rebuilt");
    let (program, out) = (copy(folder.path()), folder.path().join("run"));
    let mut command = Command::new(&program);
    command.args([
        "run",
        "scenarios/close.toml",
        "--out",
        text(&out),
        "--real-time=2",
        "--duration",
        "3 s",
    ]);
    command.args(["--set", "participants.controller.on-failure=restart-from-checkpoint"]);
    command.args(["--checkpoint-every", "500 ms"]);
    command
        .current_dir(root())
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    let mut run = command.spawn().expect("the copy can be started");
    wait_for_bytes(&mut run, &out.join("tape/plant.measured.bin"), 1000 * 224);
    // As in a build: the old file is unlinked, and a new one gets its name.
    std::fs::remove_file(&program).expect("the copy is there");
    std::fs::write(&program, "not a program").expect("the folder can be written");
    let controller = writer_of(&out.join("log/controller.stderr")).expect("the controller runs");
    assert!(send_signal(controller, Signal::KILL));
    let output = wait_for_output(run);
    // Too short for a capture.
    assert_eq!(output.code, Some(3), "{output:?}");
    let events = std::fs::read_to_string(out.join("tape/events.jsonl")).expect("a tape has events");
    assert!(events.contains("\"restart\""), "{events}");
}
