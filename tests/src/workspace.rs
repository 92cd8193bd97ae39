//! The packages of the workspace, and their permitted dependencies.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use crate::program::root;

/// The workspace packages that each library and each program may link. A package that is not listed (programs at the top, tests, examples,
/// benches) may link anything, and no package may link it.
pub const ALLOWED_DEPENDENCIES: [(&str, &[&str]); 26] = [
    ("allocation", &[]),
    ("foreign-calls", &[]),
    ("lockstep", &[]),
    ("multibody", &[]),
    ("guidance-laws", &[]),
    ("control-laws", &["guidance-laws", "multibody"]),
    ("synthesis", &["multibody"]),
    ("interfaces", &["lockstep", "multibody"]),
    ("tape", &["lockstep"]),
    ("fmu", &["foreign-calls", "lockstep"]),
    ("ssp", &["fmu", "lockstep"]),
    ("plugin", &["foreign-calls", "lockstep"]),
    ("testing", &["allocation"]),
    ("sampling", &["lockstep"]),
    ("report", &["lockstep", "multibody", "tape"]),
    ("engine", &["fmu", "lockstep", "plugin", "report", "sampling", "tape"]),
    (
        "capture",
        &[
            "controller-proc",
            "engine",
            "guidance-laws",
            "guidance-proc",
            "interfaces",
            "lockstep",
            "multibody",
            "plant-proc",
            "report",
            "synthesis",
            "tape",
        ],
    ),
    ("plant-proc", &["interfaces", "lockstep", "multibody"]),
    (
        "controller-proc",
        &["control-laws", "guidance-laws", "interfaces", "lockstep", "multibody"],
    ),
    (
        "guidance-proc",
        &["guidance-laws", "interfaces", "lockstep", "multibody"],
    ),
    (
        "orchestrator",
        &[
            "capture",
            "controller-proc",
            "engine",
            "fmu",
            "guidance-proc",
            "lockstep",
            "multibody",
            "plant-proc",
            "plugin",
            "report",
            "ssp",
            "synthesis",
            "tape",
        ],
    ),
    (
        "escapement",
        &[
            "allocation",
            "engine",
            "fmu-export",
            "lockstep",
            "orchestrator",
            "plugin",
            "tape",
        ],
    ),
    ("escapement-c", &["plugin"]),
    ("fmu-export", &["engine", "lockstep", "tape"]),
    ("run-c", &["engine", "fmu-export"]),
    ("escapement-fmu", &["fmu-export", "orchestrator", "run-c"]),
];

/// A package of the workspace.
pub struct Package {
    /// Its name.
    pub name: String,
    /// The path of its manifest.
    pub folder: PathBuf,
    /// Its dependencies, without those of tests and benches.
    pub dependencies: Vec<String>,
    /// The root file of each of its targets.
    pub targets: Vec<PathBuf>,
}

/// The packages of the workspace.
///
/// # Panics
/// When `cargo` cannot be run.
pub fn packages() -> &'static [Package] {
    static READ: OnceLock<Vec<Package>> = OnceLock::new();
    READ.get_or_init(|| {
        let output = Command::new(env!("CARGO"))
            .current_dir(root())
            .args(["metadata", "--format-version", "1", "--offline", "--no-deps"])
            .output()
            .expect("cargo can be started");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let all: serde_json::Value = serde_json::from_slice(&output.stdout).expect("cargo metadata gives JSON");
        let list = |value: &serde_json::Value| value.as_array().cloned().unwrap_or_default();
        let text = |value: &serde_json::Value| value.as_str().unwrap_or_default().to_owned();
        list(&all["packages"])
            .iter()
            .map(|package| Package {
                name: text(&package["name"]),
                folder: Path::new(&text(&package["manifest_path"])).parent().unwrap().to_owned(),
                dependencies: list(&package["dependencies"])
                    .iter()
                    .filter(|one| one["kind"] != "dev")
                    .map(|one| text(&one["name"]))
                    .collect(),
                targets: list(&package["targets"])
                    .iter()
                    .map(|target| PathBuf::from(text(&target["src_path"])))
                    .collect(),
            })
            .collect()
    })
}

/// The package called `name`.
///
/// # Panics
/// When there is none.
pub fn package(name: &str) -> &'static Package {
    let found = packages().iter().find(|package| package.name == name);
    found.unwrap_or_else(|| panic!("there is no package `{name}`"))
}
