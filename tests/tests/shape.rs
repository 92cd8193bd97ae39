//! The structure of the sources: no cycles between modules, short files, short functions, and libraries independent of the examples.

use std::path::Path;

use escapement_tests::modules::Modules;
use escapement_tests::program::root;
use escapement_tests::rust::{code_of, functions, tokens};
use escapement_tests::sources::{assert_none, files, find_word, lines, sources};
use escapement_tests::workspace::{package, packages};

fn shown(path: &Path) -> String {
    path.strip_prefix(root()).unwrap_or(path).display().to_string()
}

#[test]
fn modules_have_no_cyclic_dependencies() {
    let mut found = Vec::new();
    for target in packages().iter().flat_map(|package| &package.targets) {
        let modules = Modules::read(target);
        for cycle in modules.cycles() {
            found.push(format!("a circle of {} files:", cycle.len()));
            let uses = modules.uses_within(&cycle).into_iter();
            found.extend(uses.map(|(from, to, path)| format!("  {} uses {}: {path}", shown(from), shown(to))));
        }
    }
    assert!(
        found.is_empty(),
        "move what both sides use into a file below them:\n{}",
        found.join("\n")
    );
}

/// Every line counts: code, comments, tests.
#[test]
fn files_are_short() {
    const MAX: usize = 500;
    let long: Vec<String> = sources()
        .into_iter()
        .map(|file| (lines(&file).len(), file))
        .filter(|(count, _)| *count > MAX)
        .map(|(count, file)| format!("  {}:{count}: more than {MAX} lines", shown(&file)))
        .collect();
    assert!(long.is_empty(), "split these files:\n{}", long.join("\n"));
}

/// Lines from `fn` to the closing brace, including comments; also for tests.
#[test]
fn functions_are_short() {
    const MAX: usize = 80;
    let mut long = Vec::new();
    for file in sources() {
        let text = std::fs::read_to_string(&file).expect("a source is text");
        for function in functions(&code_of(&text)) {
            if function.lines > MAX {
                long.push(format!(
                    "  {}:{}: `{}` has {} lines, more than {MAX}",
                    shown(&file),
                    function.line,
                    function.name,
                    function.lines
                ));
            }
        }
    }
    assert!(long.is_empty(), "split these functions:\n{}", long.join("\n"));
}

/// Where the report draws the links of a URDF, whose joints follow fields.
const DRAWS_JOINTS: [&str; 2] = [
    "crates/report/src/scene/",
    "crates/report/src/export/mcap/transforms.rs",
];

/// Code that runs, records and draws any system does not name the bundled one: not in code, comments, texts or tests.
#[test]
fn generic_libraries_name_no_example() {
    let words = ["capture", "grasp", "slosh", "wheel", "thruster", "arm", "gain"];
    for name in ["lockstep", "tape", "report", "engine"] {
        let found = files(&package(name).folder, ".rs").into_iter().flat_map(|path| {
            let joints = DRAWS_JOINTS.iter().any(|part| shown(&path).starts_with(part));
            let joint: &[&str] = if joints { &[] } else { &["joint"] };
            let find_any = move |whole: &str| find_word(whole, &words).or(find_word(whole, joint)).map(str::to_owned);
            lines(&path)
                .into_iter()
                .filter_map(move |line| find_any(&line.whole).map(|word| (line, word)))
        });
        assert_none(&format!("{name} is for any system:"), found);
    }
    // A mouse has a wheel.
    let words = ["capture", "grasp", "slosh", "thruster", "arm", "servicer", "satellite"];
    let found = files(&package("report").folder, ".js")
        .into_iter()
        .flat_map(|path| lines(&path));
    let found = found.filter_map(|line| find_word(&line.whole, &words).map(|word| (line, word.to_owned())));
    assert_none("the page is for any system:", found);
}

/// Packages that compute, record and draw need no `unsafe`; elsewhere, clippy requires a reason for each block.
#[test]
fn unsafe_code_is_in_few_packages_and_always_documented() {
    const WITH: [&str; 13] = [
        "allocation",
        "engine",
        "escapement-c",
        "escapement-python",
        "foreign-calls",
        "fmu",
        "fmu-export",
        "lockstep",
        "multibody",
        "orchestrator",
        "plugin",
        "run-c",
        "escapement-tests",
    ];
    for package in packages() {
        let manifest = std::fs::read_to_string(package.folder.join("Cargo.toml")).expect("a manifest");
        let manifest: toml::Table = manifest.parse().expect("a manifest is TOML");
        let inherits = manifest.get("lints").and_then(|lints| lints.get("workspace"));
        assert_eq!(
            inherits.and_then(toml::Value::as_bool),
            Some(true),
            "{}: `[lints] workspace = true` is missing",
            package.name
        );
        if WITH.contains(&package.name.as_str()) {
            continue;
        }
        for file in files(&package.folder, ".rs") {
            let text = std::fs::read_to_string(&file).expect("a source is text");
            let found = tokens(&code_of(&text)).into_iter().find(|token| token.text == "unsafe");
            assert_eq!(found, None, "{}: {} does without `unsafe`", shown(&file), package.name);
        }
    }
    let workspace: toml::Table = std::fs::read_to_string(root().join("Cargo.toml"))
        .expect("a manifest")
        .parse()
        .expect("a manifest is TOML");
    assert_eq!(
        workspace["workspace"]["lints"]["clippy"]["undocumented_unsafe_blocks"].as_str(),
        Some("deny")
    );
}
