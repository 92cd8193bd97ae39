//! FMUs that misbehave, and files that are not FMUs: the run names each with its fault, and leaves nothing behind.

use std::path::Path;
use std::process::{Command, Stdio};

use escapement_tests::fmus::{Recipe, archive, unpacked};
use escapement_tests::program::{Folder, Said, finish, orchestrate, orchestrator, root, text};

/// A run of the FMU `file` alone, with a separate folder for temporary files, which is empty afterwards.
fn run(folder: &Folder, file: &Path, keys: &str, arguments: &[&str]) -> Said {
    let said = ended(folder, file, keys, arguments);
    let temporary = folder.path().join("temporary");
    assert_eq!(unpacked(&temporary), Vec::<std::path::PathBuf>::new(), "{said:?}");
    said
}

/// The same, whatever is left.
fn ended(folder: &Folder, file: &Path, keys: &str, arguments: &[&str]) -> Said {
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
    finish(command.spawn().expect("the program can be started"))
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
            let file = Recipe {
                fault,
                ..Recipe::new(version)
            }
            .build(&folder, "bad");
            let said = run(&folder, &file, "run.ports.inputs = []", &[]);
            assert_eq!(said.code, Some(1), "{said:?}");
            for word in words {
                assert!(said.err.contains(word), "{fault}: `{word}`: {said:?}");
            }
        }
    }
}

#[test]
fn exit_in_the_program_is_a_failure_that_names_the_fmu() {
    for version in [2, 3] {
        let folder = Folder::new("exits");
        let file = Recipe {
            fault: "EXIT",
            ..Recipe::new(version)
        }
        .build(&folder, "bad");
        let said = ended(&folder, &file, "run.ports.inputs = []", &["--in-process"]);
        assert_eq!(said.code, Some(1), "{said:?}");
        assert!(said.err.contains("it: the FMU called exit() in DoStep"), "{said:?}");
    }
}

#[test]
fn next_run_removes_unpacked_fmu_of_a_dead_process() {
    let folder = Folder::new("unpacked");
    let file = Recipe {
        fault: "EXIT",
        ..Recipe::new(2)
    }
    .build(&folder, "bad");
    let temporary = folder.path().join("temporary");
    ended(&folder, &file, "run.ports.inputs = []", &["--in-process"]);
    assert_eq!(unpacked(&temporary).len(), 1);
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
        let said = finish(command.spawn().expect("the program can be started"));
        assert_eq!(said.code, Some(0), "{said:?}");
        said
    };
    let said = there(&["doctor"]);
    assert!(said.out.contains("left an unpacked FMU in"), "{said:?}");
    assert!(
        said.out.contains("so does the next run with participants in processes"),
        "{said:?}"
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
    assert_eq!(unpacked(&temporary), Vec::<std::path::PathBuf>::new());
}

#[test]
fn warnings_are_in_the_participants_log_wherever_it_runs() {
    for version in [2, 3] {
        let folder = Folder::new("warns");
        let file = Recipe {
            fault: "WARN",
            ..Recipe::new(version)
        }
        .build(&folder, "warns");
        for more in [&[][..], &["--in-process"]] {
            let said = run(&folder, &file, "run.ports.inputs = []", more);
            assert_eq!(said.code, Some(0), "{said:?}");
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
fn endless_step_is_ended_by_patience() {
    let folder = Folder::new("endless");
    let file = Recipe {
        fault: "LOOP",
        ..Recipe::new(3)
    }
    .build(&folder, "bad");
    let said = run(&folder, &file, "run.ports.inputs = []", &["--patience", "1s"]);
    assert_eq!(said.code, Some(1), "{said:?}");
    assert!(said.err.contains("`it`"), "{said:?}");
}

#[test]
fn fmu_that_cannot_be_saved_is_refused_with_fmu_remedy() {
    for version in [2, 3] {
        let folder = Folder::new("unsaved");
        let file = Recipe {
            fault: "UNSAVED",
            ..Recipe::new(version)
        }
        .build(&folder, "bad");
        for more in [&[][..], &["--in-process"]] {
            let arguments = [&["--checkpoint-at", "0.7 s"], more].concat();
            let said = run(&folder, &file, "run.ports.inputs = []", &arguments);
            assert_eq!(said.code, Some(1), "{said:?}");
            for part in ["`it`: cannot save its state", "its log says why", "canSerializeFMU"] {
                assert!(said.err.contains(part), "`{part}`: {said:?}");
            }
            assert!(!said.err.contains("implement"), "{said:?}");
            let log = std::fs::read_to_string(folder.path().join("run/log/it.stderr")).expect("it has a log");
            assert!(log.contains("the state of the FMU cannot be saved"), "{log}");
        }
    }
}

#[test]
fn fmu_that_prints_does_not_spoil_a_result_in_one_process() {
    for version in [2, 3] {
        let folder = Folder::new("prints");
        let file = Recipe {
            fault: "PRINT",
            ..Recipe::new(version)
        }
        .build(&folder, "prints");
        let said = run(&folder, &file, "run.ports.inputs = []", &["--in-process", "--json"]);
        assert_eq!(said.code, Some(0), "{said:?}");
        assert_eq!(said.json()["ending"]["status"], "complete", "{said:?}");
        assert!(said.err.contains("{ the spring prints"), "{said:?}");
        // The workers of a campaign answer on their standard output.
        let scenario = folder.path().join("bad.toml");
        let out = folder.path().join("campaign");
        let vary = "participants.it.parameters.mass=1 kg,2 kg";
        let said = orchestrate(&["sweep", text(&scenario), "--vary", vary, "--out", text(&out)]);
        assert_eq!(said.code, Some(0), "{said:?}");
    }
}

#[test]
fn file_written_by_an_fmu_is_removed_with_the_run() {
    let folder = Folder::new("litter");
    let file = Recipe {
        fault: "LITTER",
        ..Recipe::new(2)
    }
    .build(&folder, "bad");
    let said = run(&folder, &file, "run.ports.inputs = []", &[]);
    assert_eq!(said.code, Some(0), "{said:?}");
    assert!(!folder.path().join("litter.txt").exists());
}

#[test]
fn library_that_contradicts_its_description_is_an_error() {
    let folder = Folder::new("sizes");
    let file = Recipe {
        sizes: Some((3, 2)),
        ..Recipe::new(3)
    }
    .build(&folder, "bad");
    let said = run(&folder, &file, "", &[]);
    assert_eq!(said.code, Some(1), "{said:?}");
    assert!(said.err.contains("the array has another size"), "{said:?}");
    let file = Recipe {
        sizes: Some((3, 3)),
        ..Recipe::new(3)
    }
    .build(&folder, "good");
    assert_eq!(run(&folder, &file, "", &[]).code, Some(0));
}

#[test]
fn foreign_platform_is_refused_with_available_platforms() {
    let folder = Folder::new("platform");
    let file = Recipe {
        platform: Some("win64"),
        ..Recipe::new(2)
    }
    .build(&folder, "bad");
    let said = run(&folder, &file, "run.ports.inputs = []", &[]);
    assert_eq!(said.code, Some(2), "{said:?}");
    assert!(
        said.err.contains("linux64/model.so") && said.err.contains("made for win64"),
        "{said:?}"
    );
}

#[test]
fn second_instance_of_single_instance_fmu_is_refused() {
    let folder = Folder::new("single");
    let attributes = "canBeInstantiatedOnlyOncePerProcess=\"true\"";
    let file = Recipe {
        attributes,
        ..Recipe::new(2)
    }
    .build(&folder, "single");
    let second = format!(
        "run.ports.inputs = []\n[participants.other]\nperiod = \"2 ms\"\nrun.fmu = \"{}\"\nrun.ports.inputs = []",
        text(&file)
    );
    assert_eq!(run(&folder, &file, &second, &[]).code, Some(0));
    let said = run(&folder, &file, &second, &["--in-process"]);
    assert_eq!(said.code, Some(1), "{said:?}");
    assert!(
        said.err.contains("only once in a process") && said.err.contains("leave out --in-process"),
        "{said:?}"
    );
}

#[test]
fn malformed_archive_is_refused() {
    let folder = Folder::new("archives");
    let description = b"<fmiModelDescription fmiVersion=\"2.0\"/>".to_vec();
    let good = archive(&[("modelDescription.xml", description.clone())]);
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
        (archive(&[("../../evil", Vec::new())]), "leads out of the archive"),
        (archive(&[("/etc/evil", Vec::new())]), "absolute path"),
        (archive(&[("a\\b", Vec::new())]), "backslash"),
        (archive(&[("a", Vec::new()), ("a", Vec::new())]), "there twice"),
        (archive(&[("readme", Vec::new())]), "no modelDescription.xml"),
        (huge, "at most 2147483648 are unpacked"),
        (link, "symbolic link"),
        (locked, "encrypted"),
        (spoil(|bytes| bytes[60] ^= 1), "checksum"),
        (good.clone(), "no `CoSimulation`"),
        (
            archive(&[("modelDescription.xml", b"<fmiModelDescription".to_vec())]),
            "modelDescription.xml",
        ),
        (
            archive(&[(
                "modelDescription.xml",
                b"<fmiModelDescription fmiVersion=\"1.0\"/>".to_vec(),
            )]),
            "2.0 and 3.0 are supported",
        ),
    ] {
        let file = folder.path().join("bad.fmu");
        std::fs::write(&file, bytes).expect("the folder can be written");
        let said = orchestrate(&["fmu", "inspect", text(&file)]);
        assert_eq!(said.code, Some(2), "{said:?}");
        assert!(
            said.err.contains(words) && said.err.contains("bad.fmu"),
            "`{words}`: {said:?}"
        );
        let said = run(&folder, &file, "", &[]);
        assert_eq!(said.code, Some(2), "{said:?}");
        assert!(
            said.err.contains(words) && said.err.contains("bad.toml:4"),
            "`{words}`: {said:?}"
        );
    }
}
