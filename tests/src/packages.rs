//! Packages of system structures (SSP) that tests create, and their import.

use std::path::{Path, PathBuf};

use crate::fmus::{TestFmu, zip_archive};
use crate::program::{Folder, ProgramOutput, run_orchestrator, text};

/// The namespaces of the standard's files.
pub const SPACES: &str = "xmlns:ssd=\"http://ssp-standard.org/SSP1/SystemStructureDescription\" \
    xmlns:ssc=\"http://ssp-standard.org/SSP1/SystemStructureCommon\" xmlns:ssv=\"http://ssp-standard.org/SSP1/SystemStructureParameterValues\" \
    xmlns:ssm=\"http://ssp-standard.org/SSP1/SystemStructureParameterMapping\"";

/// A description with the given content of the root system.
pub fn description(system: &str, rest: &str) -> String {
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<ssd:SystemStructureDescription {SPACES} version=\"1.0\" name=\"Test\">\n\
         <ssd:System name=\"root\">\n{system}\n</ssd:System>\n{rest}\n</ssd:SystemStructureDescription>\n"
    )
}

/// A package of these files and `SystemStructure.ssd`.
///
/// # Panics
/// When the folder cannot be written.
pub fn package(folder: &Folder, description: &str, files: &[(&str, Vec<u8>)]) -> PathBuf {
    let mut entries = vec![("SystemStructure.ssd", description.as_bytes().to_vec())];
    entries.extend_from_slice(files);
    let path = folder.path().join("system.ssp");
    std::fs::write(&path, zip_archive(&entries)).expect("the folder can be written");
    path
}

/// The contents of a file.
///
/// # Panics
/// When it does not exist.
pub fn read(path: &Path) -> Vec<u8> {
    std::fs::read(path).expect("the file is there")
}

/// Builds a mass on a spring (FMI 2.0) and a damper (FMI 3.0).
///
/// # Panics
/// When there is no C compiler.
pub fn pair(folder: &Folder) -> (Vec<u8>, Vec<u8>) {
    let damper = TestFmu {
        damper: true,
        ..TestFmu::new(3)
    };
    (
        read(&TestFmu::new(2).build(folder, "spring")),
        read(&damper.build(folder, "damper")),
    )
}

/// Imports a package into the folder `imported`.
pub fn import(folder: &Folder, package: &Path, rest: &[&str]) -> ProgramOutput {
    let out = folder.path().join("imported");
    run_orchestrator(&[&["import", text(package), "--out", text(&out)], rest].concat())
}

/// Two units and an experiment, for the end of a description.
pub const NESTED_REST: &str = r#"<ssd:Units>
  <ssc:Unit name="mm/s"><ssc:BaseUnit m="1" s="-1" factor="0.001"/></ssc:Unit>
  <ssc:Unit name="N.s/mm"><ssc:BaseUnit kg="1" s="-1" factor="1000"/></ssc:Unit>
</ssd:Units>
<ssd:DefaultExperiment startTime="0" stopTime="2"/>"#;

/// Runs the imported scenario in both ways, and `by_hand` as well, and checks that all tapes are equal.
///
/// # Panics
/// When they are not.
pub fn is_what_is_written_by_hand(folder: &Folder, by_hand: &str) {
    let imported = folder.path().join("imported/scenario.toml");
    let checked = run_orchestrator(&["check", text(&imported)]);
    assert_eq!(checked.code, Some(0), "{checked:?}");
    let by_hand = folder.write("imported/by-hand.toml", by_hand);
    let runs = [
        ("expected", &by_hand, &[][..]),
        ("apart", &imported, &[]),
        ("together", &imported, &["--in-process"]),
    ];
    let expected = folder.path().join("expected");
    for (name, scenario, way) in runs {
        let out = folder.path().join(name);
        let output = run_orchestrator(&[&["run", text(scenario), "--out", text(&out), "--quiet"], way].concat());
        assert_eq!(output.code, Some(0), "{output:?}");
        let output = run_orchestrator(&["compare", text(&expected), text(&out)]);
        let scenario = String::from_utf8_lossy(&read(&imported)).into_owned();
        assert_eq!(output.code, Some(0), "{name}: {output:?}\n{scenario}");
    }
}
