//! FMUs that misbehave, and files that are not FMUs: the run names each with its fault, and leaves nothing behind.

use std::path::Path;
use std::process::{Command, Stdio};

use escapement_tests::fmus::{TestFmu, unpacked_folders, zip_archive};
use escapement_tests::program::{Folder, ProgramOutput, orchestrator, root, run_orchestrator, text, wait_for_output};

/// A run of the FMU `file` alone, with a separate folder for temporary files, which is empty afterwards.
fn run(folder: &Folder, file: &Path, keys: &str, arguments: &[&str]) -> ProgramOutput {
    let output = run_and_wait(folder, file, keys, arguments);
    let temporary = folder.path().join("temporary");
    assert_eq!(
        unpacked_folders(&temporary),
        Vec::<std::path::PathBuf>::new(),
        "{output:?}"
    );
    output
}

/// As [`run`], without the check of the temporary folder.
fn run_and_wait(folder: &Folder, file: &Path, keys: &str, arguments: &[&str]) -> ProgramOutput {
    let scenario = folder.write(
        "bad.toml",
        &format!(
            "duration = \"1 s\"\n[participants.it]\nperiod = \"1 ms\"\nrun.fmu = \"{}\"\n{keys}\n",
            text(file)
        ),
    );
    let (out, temporary) = (folder.path().join("run"), folder.path().join("temporary"));
    let _ = std::fs::remove_dir_all(&out);
    std::fs::create_dir_all(&temporary).expect("the folder can be written");
    let mut command = Command::new(orchestrator());
    command
        .args(["run", text(&scenario), "--out", text(&out), "--quiet"])
        .args(arguments);
    command.current_dir(folder.path()).env("TMPDIR", &temporary);
    command
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    wait_for_output(command.spawn().expect("the program can be started"))
}

#[test]
fn failing_fmu_is_named_with_its_message() {
    for (fault, words) in [
        ("SEGFAULT", &["segmentation fault", "`it`"][..]),
        ("EXIT", &["exited with status 7", "`it`"]),
        ("NOT_A_NUMBER", &["outputs", "x", "NaN"]),
        ("ERROR", &["returned Error", "its log: the spring broke", "t = 0.5 s"]),
        (
            "DISCARD",
            &["returned Discard", "came to t =", "its log: the spring broke"],
        ),
        (
            "FATAL",
            &["returned Fatal", "no instance of this FMU", "its log: the spring broke"],
        ),
    ] {
        for version in [2, 3] {
            let folder = Folder::new("failing");
            let file = TestFmu {
                fault,
                ..TestFmu::new(version)
            }
            .build(&folder, "bad");
            let output = run(&folder, &file, "run.ports.inputs = []", &[]);
            assert_eq!(output.code, Some(1), "{output:?}");
            for word in words {
                assert!(output.err.contains(word), "{fault}: `{word}`: {output:?}");
            }
        }
    }
}

#[test]
fn exit_in_the_program_is_a_failure_that_names_the_fmu() {
    for version in [2, 3] {
        let folder = Folder::new("exits");
        let file = TestFmu {
            fault: "EXIT",
            ..TestFmu::new(version)
        }
        .build(&folder, "bad");
        let output = run_and_wait(&folder, &file, "run.ports.inputs = []", &["--in-process"]);
        assert_eq!(output.code, Some(1), "{output:?}");
        assert!(output.err.contains("it: the FMU called exit() in DoStep"), "{output:?}");
    }
}

#[test]
fn next_run_removes_unpacked_fmu_of_a_dead_process() {
    let folder = Folder::new("unpacked");
    let file = TestFmu {
        fault: "EXIT",
        ..TestFmu::new(2)
    }
    .build(&folder, "bad");
    let temporary = folder.path().join("temporary");
    run_and_wait(&folder, &file, "run.ports.inputs = []", &["--in-process"]);
    assert_eq!(unpacked_folders(&temporary).len(), 1);
    let there = |arguments: &[&str]| {
        let mut command = Command::new(orchestrator());
        command
            .args(arguments)
            .current_dir(folder.path())
            .env("TMPDIR", &temporary);
        command
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        let output = wait_for_output(command.spawn().expect("the program can be started"));
        assert_eq!(output.code, Some(0), "{output:?}");
        output
    };
    let output = there(&["doctor"]);
    assert!(output.out.contains("left an unpacked FMU in"), "{output:?}");
    assert!(
        output
            .out
            .contains("so does the next run with participants in processes"),
        "{output:?}"
    );
    let springs = root().join("orchestrator/src/templates/spring.toml");
    there(&[
        "run",
        text(&springs),
        "--duration",
        "50 ms",
        "--out",
        "springs",
        "--quiet",
    ]);
    assert_eq!(unpacked_folders(&temporary), Vec::<std::path::PathBuf>::new());
}

#[test]
fn warnings_are_in_the_participants_log_in_every_way() {
    for version in [2, 3] {
        let folder = Folder::new("warns");
        let file = TestFmu {
            fault: "WARN",
            ..TestFmu::new(version)
        }
        .build(&folder, "warns");
        for more in [&[][..], &["--in-process"]] {
            let output = run(&folder, &file, "run.ports.inputs = []", more);
            assert_eq!(output.code, Some(0), "{output:?}");
            let log = std::fs::read_to_string(folder.path().join("run/log/it.stderr")).expect("it has a log");
            let lines: Vec<&str> = log
                .lines()
                .filter(|line| line.contains("FMU, error: the spring broke"))
                .collect();
            // One in each of the steps of the second half.
            assert_eq!(lines.len(), 500, "{log}");
            assert!(more.is_empty() || lines[7].contains("0.507"), "{}", lines[7]);
        }
    }
}

#[test]
fn failed_termination_is_a_line_in_the_log() {
    for version in [2, 3] {
        let folder = Folder::new("terminate");
        let file = TestFmu {
            fault: "TERMINATE_ERROR",
            ..TestFmu::new(version)
        }
        .build(&folder, "bad");
        for more in [&[][..], &["--in-process"]] {
            let output = run(&folder, &file, "run.ports.inputs = []", more);
            assert_eq!(output.code, Some(0), "{output:?}");
            let log = std::fs::read_to_string(folder.path().join("run/log/it.stderr")).expect("it has a log");
            assert!(
                log.contains("it at t = 1 s: Terminate returned Error"),
                "{more:?}: {log}"
            );
        }
        let file = TestFmu {
            fault: "TERMINATE_ABORT",
            ..TestFmu::new(version)
        }
        .build(&folder, "bad");
        let output = run(&folder, &file, "run.ports.inputs = []", &[]);
        assert_eq!(output.code, Some(0), "{output:?}");
        let log = std::fs::read_to_string(folder.path().join("run/log/it.stderr")).expect("it has a log");
        assert!(
            log.contains("it: its process was ended by signal 6 (abort) in `terminate`"),
            "{log}"
        );
    }
}

#[test]
fn instant_that_is_no_number_is_an_error() {
    let folder = Folder::new("instant");
    let file = TestFmu {
        fault: "NO_INSTANT",
        ..TestFmu::new(3)
    }
    .build(&folder, "bad");
    let output = run(&folder, &file, "run.ports.inputs = []", &[]);
    assert_eq!(output.code, Some(1), "{output:?}");
    assert!(output.err.contains("came to t = NaN s"), "{output:?}");
}

#[test]
fn endless_step_is_ended_by_patience() {
    let folder = Folder::new("endless");
    let file = TestFmu {
        fault: "LOOP",
        ..TestFmu::new(3)
    }
    .build(&folder, "bad");
    let output = run(&folder, &file, "run.ports.inputs = []", &["--patience", "1s"]);
    assert_eq!(output.code, Some(1), "{output:?}");
    assert!(output.err.contains("`it`"), "{output:?}");
}

/// Runs with a checkpoint of an FMU with this fault, in both versions, in processes and in one: each fails with these words.
fn refused_checkpoints(fault: &'static str, words: &[&str]) -> Vec<ProgramOutput> {
    let mut outputs = Vec::new();
    for version in [2, 3] {
        let folder = Folder::new("unsaved");
        let file = TestFmu {
            fault,
            ..TestFmu::new(version)
        }
        .build(&folder, "bad");
        for more in [&[][..], &["--in-process"]] {
            let arguments = [&["--checkpoint-at", "0.7 s"], more].concat();
            let output = run(&folder, &file, "run.ports.inputs = []", &arguments);
            assert_eq!(output.code, Some(1), "{output:?}");
            for part in words {
                assert!(output.err.contains(part), "`{part}`: {output:?}");
            }
            outputs.push(output);
        }
    }
    outputs
}

#[test]
fn fmu_that_cannot_be_saved_is_refused_with_fmu_remedy() {
    let words = [
        "`it`: cannot save its state",
        "its `save` failed: fmi",
        "canSerializeFMU",
    ];
    for output in refused_checkpoints("UNSAVED", &words) {
        assert!(!output.err.contains("implement"), "{output:?}");
    }
}

#[test]
fn state_of_an_unbelievable_size_is_refused() {
    refused_checkpoints(
        "HUGE_STATE",
        &["`it`: cannot save its state", "1099511627776 bytes", "63 MiB"],
    );
}

#[test]
fn fmu_that_prints_does_not_spoil_a_result_in_one_process() {
    for version in [2, 3] {
        let folder = Folder::new("prints");
        let file = TestFmu {
            fault: "PRINT",
            ..TestFmu::new(version)
        }
        .build(&folder, "prints");
        let output = run(&folder, &file, "run.ports.inputs = []", &["--in-process", "--json"]);
        assert_eq!(output.code, Some(0), "{output:?}");
        assert_eq!(output.json()["ending"]["status"], "complete", "{output:?}");
        assert!(output.err.contains("{ the spring prints"), "{output:?}");
        // The workers of a campaign answer on their standard output.
        let scenario = folder.path().join("bad.toml");
        let out = folder.path().join("campaign");
        let vary = "participants.it.parameters.mass=1 kg,2 kg";
        let output = run_orchestrator(&["sweep", text(&scenario), "--vary", vary, "--out", text(&out)]);
        assert_eq!(output.code, Some(0), "{output:?}");
    }
}

#[test]
fn file_written_by_an_fmu_is_removed_with_the_run() {
    let folder = Folder::new("leftover");
    let file = TestFmu {
        fault: "LEAVES_FILE",
        ..TestFmu::new(2)
    }
    .build(&folder, "bad");
    let output = run(&folder, &file, "run.ports.inputs = []", &[]);
    assert_eq!(output.code, Some(0), "{output:?}");
    assert!(!folder.path().join("leftover.txt").exists());
}

#[test]
fn library_that_contradicts_its_description_is_an_error() {
    let folder = Folder::new("sizes");
    let file = TestFmu {
        sizes: Some((3, 2)),
        ..TestFmu::new(3)
    }
    .build(&folder, "bad");
    let output = run(&folder, &file, "", &[]);
    assert_eq!(output.code, Some(1), "{output:?}");
    assert!(output.err.contains("the array has another size"), "{output:?}");
    let file = TestFmu {
        sizes: Some((3, 3)),
        ..TestFmu::new(3)
    }
    .build(&folder, "good");
    assert_eq!(run(&folder, &file, "", &[]).code, Some(0));
}

#[test]
fn foreign_platform_is_refused_with_available_platforms() {
    let folder = Folder::new("platform");
    let file = TestFmu {
        platform: Some("win64"),
        ..TestFmu::new(2)
    }
    .build(&folder, "bad");
    let output = run(&folder, &file, "run.ports.inputs = []", &[]);
    assert_eq!(output.code, Some(2), "{output:?}");
    assert!(
        output.err.contains("linux64/model.so") && output.err.contains("made for win64"),
        "{output:?}"
    );
}

#[test]
fn second_instance_of_single_instance_fmu_is_refused() {
    let folder = Folder::new("single");
    let attributes = "canBeInstantiatedOnlyOncePerProcess=\"true\"";
    let file = TestFmu {
        attributes,
        ..TestFmu::new(2)
    }
    .build(&folder, "single");
    let second = format!(
        "run.ports.inputs = []\n[participants.other]\nperiod = \"2 ms\"\nrun.fmu = \"{}\"\nrun.ports.inputs = []",
        text(&file)
    );
    assert_eq!(run(&folder, &file, &second, &[]).code, Some(0));
    let output = run(&folder, &file, &second, &["--in-process"]);
    assert_eq!(output.code, Some(1), "{output:?}");
    assert!(
        output.err.contains("only once in a process") && output.err.contains("leave out --in-process"),
        "{output:?}"
    );
}

#[test]
fn malformed_archive_is_refused() {
    let folder = Folder::new("archives");
    let description = b"<fmiModelDescription fmiVersion=\"2.0\"/>".to_vec();
    let good = zip_archive(&[("modelDescription.xml", description.clone())]);
    let spoil = |change: fn(&mut Vec<u8>)| {
        let mut bad = good.clone();
        change(&mut bad);
        bad
    };
    let find = |bytes: &[u8], mark: &[u8]| bytes.windows(4).position(|part| part == mark).expect("a mark");
    let directory = find(&good, b"PK\x01\x02");
    let mut huge = good.clone();
    huge[directory + 24..directory + 28].copy_from_slice(&0xf000_0000_u32.to_le_bytes());
    let mut link = good.clone();
    link[directory + 5] = 3;
    link[directory + 38..directory + 42].copy_from_slice(&(0o120_777_u32 << 16).to_le_bytes());
    let mut locked = good.clone();
    locked[directory + 8] |= 1;
    for (bytes, words) in [
        (b"no archive at all, whatever its name".to_vec(), "not a ZIP archive"),
        (Vec::new(), "not a ZIP archive"),
        (spoil(|bytes| bytes.truncate(bytes.len() - 30)), "not a ZIP archive"),
        (zip_archive(&[("../../evil", Vec::new())]), "leads out of the archive"),
        (zip_archive(&[("/etc/evil", Vec::new())]), "absolute path"),
        (zip_archive(&[("a\\b", Vec::new())]), "backslash"),
        (zip_archive(&[("a", Vec::new()), ("a", Vec::new())]), "there twice"),
        (zip_archive(&[("readme", Vec::new())]), "no modelDescription.xml"),
        (huge, "at most 2147483648 are unpacked"),
        (link, "symbolic link"),
        (locked, "encrypted"),
        (spoil(|bytes| bytes[60] ^= 1), "checksum"),
        (good.clone(), "no `CoSimulation`"),
        (
            zip_archive(&[("modelDescription.xml", b"<fmiModelDescription".to_vec())]),
            "modelDescription.xml",
        ),
        (
            zip_archive(&[(
                "modelDescription.xml",
                b"<fmiModelDescription fmiVersion=\"1.0\"/>".to_vec(),
            )]),
            "2.0 and 3.0 are supported",
        ),
    ] {
        let file = folder.path().join("bad.fmu");
        std::fs::write(&file, bytes).expect("the folder can be written");
        let output = run_orchestrator(&["fmu", "inspect", text(&file)]);
        assert_eq!(output.code, Some(2), "{output:?}");
        assert!(
            output.err.contains(words) && output.err.contains("bad.fmu"),
            "`{words}`: {output:?}"
        );
        let output = run(&folder, &file, "", &[]);
        assert_eq!(output.code, Some(2), "{output:?}");
        assert!(
            output.err.contains(words) && output.err.contains("bad.toml:4"),
            "`{words}`: {output:?}"
        );
    }
}
