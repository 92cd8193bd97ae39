//! The architectural rules of the code base, over `cargo metadata` and the sources: permitted dependencies, and words that certain files
//! must not contain. `ARCHITECTURE.md` gives the reasons.

use std::collections::BTreeMap;
use std::process::Command;

use escapement_tests::program::root;
use escapement_tests::sources::{assert_none, files, find_word, lines, shipped_lines, sources};
use escapement_tests::workspace::{ALLOWED_DEPENDENCIES, package, packages};

/// Packages of pure functions.
const MODELS: [&str; 4] = ["multibody", "control-laws", "guidance-laws", "synthesis"];

/// The modules of the standard library that a line of code names, also in `use std::{a, b::c}`.
fn std_module_used(code: &str, modules: &[&str]) -> Option<String> {
    for (at, _) in code.match_indices("std::") {
        let rest = &code[at + 5..];
        let names: Vec<&str> = match rest.strip_prefix('{') {
            Some(group) => group.split(['{', '}', ',']).map(str::trim).collect(),
            None => vec![rest],
        };
        for name in names {
            let first = name.split(|c: char| !c.is_ascii_alphanumeric() && c != '_').next();
            if let Some(module) = first.filter(|first| modules.contains(first)) {
                return Some(format!("std::{module}"));
            }
        }
    }
    None
}

#[test]
fn package_dependencies_point_down() {
    let arrows: BTreeMap<&str, &[&str]> = ALLOWED_DEPENDENCIES.into_iter().collect();
    let ours: Vec<&str> = packages().iter().map(|package| package.name.as_str()).collect();
    let mut wrong = Vec::new();
    for package in packages() {
        let inner = package
            .folder
            .strip_prefix(root())
            .unwrap_or(&package.folder)
            .starts_with("crates");
        let allowed = arrows.get(package.name.as_str());
        if inner && allowed.is_none() {
            wrong.push(format!(
                "  {} is not in the table ARROWS of this test: say what it may link",
                package.name
            ));
        }
        for unused in allowed.into_iter().flat_map(|allowed| allowed.iter()) {
            if !package.dependencies.iter().any(|name| name == unused) {
                wrong.push(format!(
                    "  {} does not link {unused}: take it out of the table ARROWS",
                    package.name
                ));
            }
        }
        for dependency in package.dependencies.iter().filter(|name| ours.contains(&name.as_str())) {
            if allowed.is_some_and(|allowed| !allowed.contains(&dependency.as_str())) {
                let manifest = package.folder.join("Cargo.toml");
                wrong.push(format!(
                    "  {}: {} must not link {dependency}",
                    manifest.display(),
                    package.name
                ));
            }
            if !arrows.contains_key(dependency.as_str()) {
                wrong.push(format!("  {} links {dependency}, which is not a library", package.name));
            }
        }
    }
    assert!(
        wrong.is_empty(),
        "an arrow between packages points up:\n{}",
        wrong.join("\n")
    );
}

#[test]
fn models_use_no_process_file_clock_or_log() {
    // Synthesis runs offline, before any run; code in a step has one thread.
    let modules = ["process", "fs", "time", "env", "net", "thread"];
    let crates = ["log", "tracing", "rustix", "libc", "iceoryx2", "lockstep"];
    for name in MODELS {
        let package = package(name);
        for dependency in &package.dependencies {
            assert!(
                !crates.contains(&dependency.as_str()),
                "{name} links {dependency}: values in, values out"
            );
        }
        let found = shipped_lines(package)
            .into_iter()
            .filter(|line| !line.test)
            .filter_map(|line| {
                let known = if name == "synthesis" {
                    &modules[..5]
                } else {
                    &modules[..]
                };
                let what = std_module_used(&line.code, known);
                let logs = ["log::", "tracing::"].into_iter().find(|log| line.code.contains(log));
                let what = what.or_else(|| logs.map(str::to_owned))?;
                Some((line, what))
            });
        assert_none(
            &format!("{name} takes values and gives values, and knows nothing else:"),
            found,
        );
    }
}

#[test]
fn framework_names_nothing_specific_to_space() {
    let words = [
        "spacecraft",
        "servicer",
        "satellite",
        "thruster",
        "slosh",
        "propellant",
        "orbit",
        "rocket",
        "grasp",
        "arm",
    ];
    let found = files(&package("lockstep").folder, ".rs")
        .into_iter()
        .flat_map(|path| lines(&path))
        .filter_map(|line| find_word(&line.whole, &words).map(|word| (line, word.to_owned())));
    assert_none("lockstep is for any simulator:", found);
}

#[test]
fn report_names_no_application() {
    let words = [
        "capture",
        "captured",
        "grasp",
        "slosh",
        "wheel",
        "thruster",
        "arm",
        "gain",
        "satellite",
    ];
    let found = files(&package("report").folder.join("src"), ".rs")
        .into_iter()
        .flat_map(|path| lines(&path))
        .filter_map(|line| find_word(&line.whole, &words).map(|word| (line, word.to_owned())));
    assert_none(
        "a report draws any run; an application hands its figures and its scene in:",
        found,
    );
}

#[test]
fn processes_and_signals_have_one_module_each() {
    for package in packages() {
        let names: &[&str] = match package.name.as_str() {
            "orchestrator" | "escapement-tests" => continue,
            "engine" => &["signal_hook"],
            _ => &["Command::new", "signal_hook", "process::Command", "kill_process"],
        };
        let manifest = package.dependencies.iter().any(|name| name == "signal-hook");
        assert!(!manifest, "{} links signal-hook", package.name);
        let found = shipped_lines(package).into_iter().filter_map(|line| {
            let name = names.iter().find(|name| line.code.contains(**name))?;
            Some((line, (*name).to_owned()))
        });
        assert_none(
            "a process is started outside of engine and orchestrator, or a signal handled outside of the orchestrator:",
            found,
        );
    }
}

/// A library of a run does not print, reads no keys and never ends the process: it reports events to an observer.
#[test]
fn engine_uses_no_terminal() {
    let names = [
        "println!",
        "print!",
        "stdin()",
        "stdout()",
        "stderr()",
        "process::exit",
        "std::env::args()",
    ];
    for name in ["lockstep", "tape", "report", "engine", "capture"] {
        let found = shipped_lines(package(name))
            .into_iter()
            // A participant's program reports its failure and its log lines where the orchestrator keeps them.
            .filter(|line| !line.test && !line.path.ends_with("lockstep/src/host/mod.rs"))
            .filter(|line| !line.path.ends_with("lockstep/src/participant/log.rs"))
            .filter_map(|line| {
                let name = names.into_iter().find(|name| line.code.contains(name))?;
                Some((line, name.to_owned()))
            });
        assert_none(&format!("{name} is a library and knows no terminal:"), found);
    }
}

/// Every line of code outside of `home` that names the crate `name`, and every package that links it besides lockstep.
fn assert_named_only_in(home: &str, name: &str) {
    let (path, uses) = (format!("{name}::"), format!("use {name}"));
    let found = sources()
        .into_iter()
        .filter(|file| !file.starts_with(root().join(home)) && !file.ends_with("tests/tests/layout.rs"))
        .flat_map(|file| lines(&file))
        .filter_map(|line| {
            // `lockstep::transport::iceoryx::…` is ours.
            let named = line.code.contains(&path) || line.code.trim_start().starts_with(&uses);
            named.then(|| (line, name.to_owned()))
        });
    assert_none(&format!("only {home} names {name}:"), found);
    for package in packages().iter().filter(|package| package.name != "lockstep") {
        assert!(
            !package.dependencies.iter().any(|one| one == name),
            "{} links {name}",
            package.name
        );
    }
}

#[test]
fn one_module_names_iceoryx2() {
    assert_named_only_in("crates/lockstep/src/transport/iceoryx", "iceoryx2");
}

#[test]
fn one_file_names_bincode() {
    assert_named_only_in("crates/lockstep/src/wire.rs", "bincode");
}

#[test]
fn matrices_have_static_sizes() {
    // A dynamic product in nalgebra selects its kernel by CPU feature, which changes bits. Synthesis runs before any run.
    let names = ["DMatrix", "DVector", "OMatrix<f64, Dyn", "nalgebra::Dyn"];
    for name in MODELS.into_iter().filter(|name| *name != "synthesis") {
        let found = shipped_lines(package(name)).into_iter().filter_map(|line| {
            let name = names.into_iter().find(|name| line.code.contains(name))?;
            Some((line, name.to_owned()))
        });
        assert_none("matrices of models have static sizes:", found);
    }
}

#[test]
fn sources_contain_no_unfinished_work() {
    // Assembled here, so that this file does not match itself.
    let words = [
        ["to", "do!("],
        ["unimple", "mented!("],
        ["FIX", "ME"],
        ["XX", "X:"],
        ["dbg", "!("],
    ]
    .map(|two| two.concat());
    let found = sources().into_iter().flat_map(|file| lines(&file)).filter_map(|line| {
        let word = words.iter().find(|word| line.whole.contains(word.as_str()))?.clone();
        Some((line, word))
    });
    assert_none("finish it or leave it out:", found);
}

fn read(name: &str) -> String {
    std::fs::read_to_string(root().join(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

#[test]
fn bincode_stays_at_the_version_that_compiles() {
    let manifest: toml::Table = read("Cargo.toml").parse().expect("the manifest is TOML");
    let pinned = manifest["workspace"]["dependencies"]["bincode"]["version"].as_str();
    assert_eq!(
        pinned,
        Some("=2.0.1"),
        "Cargo.toml: bincode 3.0.0 is a tombstone; see deny.toml"
    );
    let deny: toml::Table = read("deny.toml").parse().expect("deny.toml is TOML");
    let waivers = deny["advisories"]["ignore"]
        .as_array()
        .expect("advisories.ignore is a list");
    for waiver in waivers {
        let reason = waiver.get("reason").and_then(toml::Value::as_str).unwrap_or_default();
        assert!(reason.len() > 40, "deny.toml: {waiver} has no reason");
    }
    let bincode = waivers
        .iter()
        .any(|waiver| waiver["id"].as_str() == Some("RUSTSEC-2025-0141"));
    assert!(bincode, "deny.toml: the waiver for bincode is missing");
}

#[test]
fn one_package_defines_what_cargo_run_runs() {
    let saying: Vec<&str> = packages()
        .iter()
        .filter(|package| {
            let text = std::fs::read_to_string(package.folder.join("Cargo.toml")).unwrap_or_default();
            let manifest: toml::Table = text.parse().expect("a manifest is TOML");
            manifest["package"].get("default-run").is_some()
        })
        .map(|package| package.name.as_str())
        .collect();
    assert_eq!(saying, ["orchestrator"], "`cargo run` must find one program");
    let manifest: toml::Table = read("Cargo.toml").parse().expect("the manifest is TOML");
    let narrow = manifest["workspace"].get("default-members").is_some();
    assert!(!narrow, "Cargo.toml: default-members would narrow `cargo test`");
}

#[test]
fn continuous_integration_runs_the_documented_commands() {
    let (readme, script) = (read("README.md"), read(".ci/run"));
    let command = "cargo test --release --no-fail-fast";
    assert!(
        readme.lines().any(|line| line.trim() == command),
        "README.md does not give `{command}`"
    );
    let contributing = read("CONTRIBUTING.md");
    assert!(
        contributing.contains(&format!("    {command} ")),
        "CONTRIBUTING.md does not give `{command}`"
    );
    let run = script.lines().any(|line| line.trim().starts_with(command));
    assert!(run, ".ci/run does not run `{command}`");
}

#[test]
fn failed_ci_step_is_listed_and_the_others_run() {
    let script = r#"
        set -euo pipefail
        . tests/steps.sh
        several() { false; echo "behind an error"; }
        step first echo "first runs"
        step second several
        step third sh -c 'exit 7'
        step last echo "last runs"
        failed_steps
    "#;
    let output = Command::new("bash").current_dir(root()).args(["-c", script]).output();
    let output = output.expect("bash can be started");
    let text = String::from_utf8_lossy(&output.stdout);
    assert_eq!(output.status.code(), Some(1), "{text}");
    assert!(text.contains("first runs") && text.contains("last runs"), "{text}");
    assert!(text.contains("third: FAILED (exit code 7)"), "{text}");
    assert!(text.ends_with("failed: second\nfailed: third\n"), "{text}");
    assert!(
        !text.contains("behind an error"),
        "a step ends at its first error: {text}"
    );
}
