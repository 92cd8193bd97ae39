//! The program's output for shells, `man` and users.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;

use escapement_tests::program::{Folder, ProgramOutput, built, text};

fn run_built(program: &str, arguments: &[&str]) -> ProgramOutput {
    let output = Command::new(built().join(program)).args(arguments).output();
    output.expect("the program can be started").into()
}

/// The commands that the help page lists.
fn commands(program: &str) -> BTreeSet<String> {
    let help = run_built(program, &["--help"]).out;
    let (_, listed) = help.split_once("Commands:").expect("the help page lists commands");
    let listed = listed.split("\n\n").next().unwrap_or_default();
    let names = listed.lines().filter_map(|line| {
        let line = line.strip_prefix("  ").filter(|line| !line.starts_with(' '))?;
        line.split_whitespace().next()
    });
    names.filter(|name| *name != "help").map(str::to_owned).collect()
}

#[test]
fn completions_know_every_command_under_the_programs_own_name() {
    for program in ["escapement", "lander"] {
        let commands = commands(program);
        assert!(commands.len() > 10, "{commands:?}");
        assert_eq!(commands.contains("new"), program == "escapement", "{commands:?}");
        for (shell, own) in [
            ("bash", format!("_{program}()")),
            ("zsh", format!("#compdef {program}")),
            ("fish", format!("complete -c {program}")),
        ] {
            let output = run_built(program, &["completions", shell]);
            assert_eq!(output.code, Some(0), "{output:?}");
            assert!(output.out.contains(&own), "{shell}: {}", output.out);
            for name in &commands {
                assert!(output.out.contains(name.as_str()), "{program}, {shell}: {name}");
            }
            for inner in ["campaign-worker", "bench-ping"] {
                assert!(!output.out.contains(inner), "{program}, {shell}: {inner}");
            }
        }
    }
    let output = run_built("escapement", &["completions", "csh"]);
    assert!(
        output.code == Some(2) && output.err.contains("bash, zsh, fish"),
        "{output:?}"
    );
}

#[test]
fn bash_completes_commands_and_options() {
    let folder = Folder::new("completions");
    let script = folder.write("escapement", &run_built("escapement", &["completions", "bash"]).out);
    let complete = |words: &str, number: u32| {
        let count = words.split(' ').count();
        let ask = format!(
            "source {}; COMP_WORDS=({words}); COMP_CWORD={}; _escapement escapement \"${{COMP_WORDS[{}]}}\" \
             \"${{COMP_WORDS[{}]}}\"; printf '%s\\n' \"${{COMPREPLY[@]}}\"",
            text(&script),
            count - 1,
            count - 1,
            number
        );
        let output = Command::new("bash").args(["-c", &ask]).output().expect("bash is there");
        ProgramOutput::from(output).out
    };
    assert_eq!(complete("escapement sw", 0).trim(), "sweep");
    assert_eq!(complete("escapement run --in-p", 1).trim(), "--in-process");
}

#[test]
fn every_command_has_a_page_that_man_reads() {
    let folder = Folder::new("man");
    for program in ["escapement", "lander"] {
        let pages = folder.path().join(program);
        let output = run_built(program, &["man", text(&pages)]);
        assert_eq!(output.code, Some(0), "{output:?}");
        let mut wanted: BTreeSet<String> = commands(program)
            .iter()
            .map(|command| format!("{program}-{command}.1"))
            .collect();
        wanted.insert(format!("{program}.1"));
        let written = std::fs::read_dir(&pages).expect("a folder").flatten();
        let written: BTreeSet<String> = written.map(|file| file.file_name().to_string_lossy().into()).collect();
        assert_eq!(written, wanted);
        assert_eq!(output.out.lines().count(), wanted.len(), "{output:?}");
        let read = |file: &str| std::fs::read_to_string(pages.join(file)).expect("a page");
        assert_eq!(run_built(program, &["man"]).out, read(&format!("{program}.1")));
        let page = read(&format!("{program}-run.1"));
        for part in [
            &*format!(".TH {program}-run 1"),
            ".SH SYNOPSIS",
            "\\-\\-in\\-process",
            program,
        ] {
            assert!(page.contains(part), "{part}: {page}");
        }
    }
}

#[test]
fn version_names_the_commit_where_there_is_one() {
    let version = |program: &str, option: &str| run_built(program, &[option]).out.trim().to_owned();
    let own = version("escapement", "--version");
    assert_eq!(own, version("escapement", "-V"));
    let built_on = own.strip_prefix("escapement ").expect("the name stands first");
    let (number, commit) = built_on.split_once(' ').unwrap_or((built_on, ""));
    assert_eq!(number, env!("CARGO_PKG_VERSION"));
    if !commit.is_empty() {
        let inside = commit.strip_prefix('(').and_then(|rest| rest.strip_suffix(')'));
        let hex = inside.map(|inside| inside.strip_suffix("-dirty").unwrap_or(inside));
        let hex = hex.unwrap_or_default();
        assert!(
            hex.len() == 12 && hex.bytes().all(|byte| byte.is_ascii_hexdigit()),
            "{own}"
        );
    }
    let lander = version("lander", "--version");
    assert_eq!(lander, format!("lander {number}, built on escapement {built_on}"));
    // The run folder contains the same.
    let folder = Folder::new("version");
    let out = folder.path().join("run");
    let scenario = escapement_tests::program::root().join("examples/lander/lander.toml");
    let run = ["run", text(&scenario), "--out", text(&out), "--quiet", "--in-process"];
    assert_eq!(run_built("lander", &run).code, Some(0));
    assert_eq!(
        recorded_version(&out),
        format!("{number}, built on escapement {built_on}")
    );
}

fn recorded_version(run: &Path) -> String {
    let text = std::fs::read_to_string(run.join("run.json")).expect("a run has run.json");
    let about: serde_json::Value = serde_json::from_str(&text).expect("it is JSON");
    about["version"].as_str().expect("a version").to_owned()
}
