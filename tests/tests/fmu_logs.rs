//! Log lines of participants in an exported FMU reach the importer's log, for one participant and for a whole scenario.

use std::path::{Path, PathBuf};
use std::process::Command;

use escapement_tests::compiler::{Workshop, library, must};
use escapement_tests::program::{Folder, orchestrate, root, text};

/// Two diaries, of 10 ms and of 20 ms, for 50 ms.
const SCENARIO: &str = "duration = \"50 ms\"\n[participants.first]\nrun = { builtin = \"diary\" }\nperiod = \"10 ms\"\n\
                        [participants.second]\nrun = { builtin = \"diary\" }\nperiod = \"20 ms\"\n";

/// An unpacked FMU, and the program that steps it.
struct Unpacked {
    importer: PathBuf,
    library: PathBuf,
    resources: PathBuf,
    token: String,
}

impl Unpacked {
    /// Exports the scenario with plug-ins in both slots, with the options `what`.
    fn new(folder: &Folder, shop: &Workshop, name: &str, what: &[&str]) -> Unpacked {
        let plugin = shop.path("c/libdiary.so");
        let scenario = folder.write("diaries.toml", SCENARIO);
        let file = folder.path().join(format!("{name}.fmu"));
        let seats = ["first", "second"].map(|seat| library(seat, &plugin, None));
        let mut arguments = vec!["fmu", "export", text(&scenario), "--fmi", "3", "--out", text(&file)];
        seats.iter().for_each(|seat| arguments.extend(["--set", seat]));
        let said = orchestrate(&[&arguments[..], what].concat());
        assert_eq!(said.code, Some(0), "{said:?}");
        let into = folder.path().join(name);
        let archive = fmu::Archive::read(std::fs::read(&file).unwrap()).unwrap();
        archive.unpack(&into).unwrap();
        let description = std::fs::read_to_string(into.join("modelDescription.xml")).unwrap();
        let (_, rest) = description.split_once("instantiationToken=\"").unwrap();
        let binaries = std::fs::read_dir(into.join("binaries/x86_64-linux")).unwrap();
        let mut binaries = binaries.map(|entry| entry.unwrap().path());
        Unpacked {
            importer: importer(shop),
            library: binaries
                .find(|path| path.extension().is_some_and(|end| end == "so"))
                .unwrap(),
            resources: into.join("resources"),
            token: rest.split('"').next().unwrap().to_owned(),
        }
    }

    /// The messages that its logger receives, with these `categories`, and how the importer ends.
    fn heard(&self, categories: &[&str]) -> (Option<i32>, String) {
        let mut command = Command::new(&self.importer);
        command
            .args([&self.library, &self.resources])
            .arg(&self.token)
            .args(categories);
        let said = command.output().unwrap();
        (said.status.code(), String::from_utf8_lossy(&said.stdout).into_owned())
    }
}

fn importer(shop: &Workshop) -> PathBuf {
    let program = shop.path("hears");
    let source: &Path = &root().join("tests/fmus/hears.c");
    must(Command::new("cc").arg(source).arg("-o").arg(&program).arg("-ldl"));
    program
}

#[test]
fn participant_log_lines_reach_the_importers_logger() {
    let folder = Folder::new("fmu-logs");
    let shop = Workshop::open("fmu-logs");
    shop.plugin("tests/plugins/diary.c", "c/libdiary.so", &["-DESCAPEMENT_NO_MAIN"]);
    let alone = Unpacked::new(&folder, &shop, "alone", &["--participant", "first"]);
    let whole = Unpacked::new(&folder, &shop, "whole", &["--outputs", "first.page"]);
    let begin = "0 logMessages: first at t = 0 s: begins\n";
    let page = "0 logMessages: first at t = 0.02 s: is at page 3\n";
    for (fmu, end) in [
        (&alone, "ends, stopped, at page 5\n"),
        (&whole, "ends, finished, at page 5\n"),
    ] {
        for categories in [&[][..], &["logMessages"], &["logStatusError", "logMessages"]] {
            let (code, heard) = fmu.heard(categories);
            assert_eq!(code, Some(0), "{heard}");
            for line in [begin, page, end] {
                assert_eq!(heard.matches(line).count(), 1, "`{line}` in {heard}");
            }
        }
        for categories in [["off"], ["logStatusError"]] {
            assert_eq!(fmu.heard(&categories), (Some(0), String::new()));
        }
        let (code, heard) = fmu.heard(&["gossip"]);
        assert_eq!(code, Some(3), "{heard}");
        assert!(
            heard.contains("there is no log category `gossip`; there are logMessages,"),
            "{heard}"
        );
    }
    let (_, heard) = whole.heard(&[]);
    assert!(heard.contains("second at t = 0.04 s: is at page 3"), "{heard}");
}
