//! Log lines of participants in an exported FMU reach the importer's log, for one participant and for a whole scenario.

use std::path::{Path, PathBuf};
use std::process::Command;

use escapement_tests::compiler::{NativeBuild, library_override, run_checked};
use escapement_tests::program::{Folder, root, run_orchestrator, text};

/// Two diaries, of 10 ms and of 20 ms, for 50 ms.
const SCENARIO: &str = "duration = \"50 ms\"\n[participants.first]\nrun = { builtin = \"diary\" }\nperiod = \"10 ms\"\n\
                        [participants.second]\nrun = { builtin = \"diary\" }\nperiod = \"20 ms\"\n";

/// An unpacked FMU, and the program that steps it.
struct UnpackedFmu {
    importer: PathBuf,
    library: PathBuf,
    resources: PathBuf,
    token: String,
}

impl UnpackedFmu {
    /// Exports the scenario with plug-ins in both slots, with the options `what`.
    fn new(folder: &Folder, native_build: &NativeBuild, name: &str, what: &[&str]) -> UnpackedFmu {
        let plugin = native_build.path("c/libdiary.so");
        let scenario = folder.write("diaries.toml", SCENARIO);
        let file = folder.path().join(format!("{name}.fmu"));
        let slots = ["first", "second"].map(|slot| library_override(slot, &plugin, None));
        let mut arguments = vec!["fmu", "export", text(&scenario), "--fmi", "3", "--out", text(&file)];
        slots.iter().for_each(|slot| arguments.extend(["--set", slot]));
        let output = run_orchestrator(&[&arguments[..], what].concat());
        assert_eq!(output.code, Some(0), "{output:?}");
        let into = folder.path().join(name);
        let archive = fmu::Archive::read(std::fs::read(&file).unwrap()).unwrap();
        archive.unpack(&into).unwrap();
        let description = std::fs::read_to_string(into.join("modelDescription.xml")).unwrap();
        let (_, rest) = description.split_once("instantiationToken=\"").unwrap();
        let binaries = std::fs::read_dir(into.join("binaries/x86_64-linux")).unwrap();
        let mut binaries = binaries.map(|entry| entry.unwrap().path());
        UnpackedFmu {
            importer: importer(native_build),
            library: binaries
                .find(|path| path.extension().is_some_and(|end| end == "so"))
                .unwrap(),
            resources: into.join("resources"),
            token: rest.split('"').next().unwrap().to_owned(),
        }
    }

    /// The messages that its logger receives, with these `categories`, and how the importer ends.
    fn logger_messages(&self, categories: &[&str]) -> (Option<i32>, String) {
        let mut command = Command::new(&self.importer);
        command
            .args([&self.library, &self.resources])
            .arg(&self.token)
            .args(categories);
        let output = command.output().unwrap();
        (
            output.status.code(),
            String::from_utf8_lossy(&output.stdout).into_owned(),
        )
    }
}

fn importer(native_build: &NativeBuild) -> PathBuf {
    let program = native_build.path("logger");
    let source: &Path = &root().join("tests/fmus/logger.c");
    run_checked(Command::new("cc").arg(source).arg("-o").arg(&program).arg("-ldl"));
    program
}

#[test]
fn participant_log_lines_reach_the_importers_logger() {
    let folder = Folder::new("fmu-logs");
    let native_build = NativeBuild::new("fmu-logs");
    native_build.plugin("tests/plugins/diary.c", "c/libdiary.so", &["-DESCAPEMENT_NO_MAIN"]);
    let alone = UnpackedFmu::new(&folder, &native_build, "alone", &["--participant", "first"]);
    let whole = UnpackedFmu::new(&folder, &native_build, "whole", &["--outputs", "first.page"]);
    let begin = "0 logMessages: first at t = 0 s: begins\n";
    let page = "0 logMessages: first at t = 0.02 s: is at page 3\n";
    for (fmu, end) in [
        (&alone, "ends, stopped, at page 5\n"),
        (&whole, "ends, finished, at page 5\n"),
    ] {
        for categories in [&[][..], &["logMessages"], &["logStatusError", "logMessages"]] {
            let (code, logger_messages) = fmu.logger_messages(categories);
            assert_eq!(code, Some(0), "{logger_messages}");
            for line in [begin, page, end] {
                assert_eq!(
                    logger_messages.matches(line).count(),
                    1,
                    "`{line}` in {logger_messages}"
                );
            }
        }
        for categories in [["off"], ["logStatusError"]] {
            assert_eq!(fmu.logger_messages(&categories), (Some(0), String::new()));
        }
        let (code, logger_messages) = fmu.logger_messages(&["gossip"]);
        assert_eq!(code, Some(3), "{logger_messages}");
        assert!(
            logger_messages.contains("there is no log category `gossip`; there are logMessages,"),
            "{logger_messages}"
        );
    }
    let (_, logger_messages) = whole.logger_messages(&[]);
    assert!(
        logger_messages.contains("second at t = 0.04 s: is at page 3"),
        "{logger_messages}"
    );
}
