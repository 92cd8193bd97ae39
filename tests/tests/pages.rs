//! The documentation pages: everything that they quote, name and link exists.

use std::path::PathBuf;

use escapement_tests::program::{Folder, root, run_orchestrator, text};
use escapement_tests::sources::files;

fn read(name: &str) -> String {
    std::fs::read_to_string(root().join(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

#[test]
fn readme_quotes_the_example_that_compiles() {
    let readme = read("README.md");
    for file in ["examples/spring/src/main.rs", "examples/spring/spring.toml"] {
        assert!(
            readme.contains(read(file).trim_end()),
            "README.md: its copy of {file} differs from the file"
        );
    }
    let python = read("docs/python.md");
    assert!(
        python.contains(read("examples/python/spring.py").trim_end()),
        "docs/python.md: its copy of examples/python/spring.py differs from the file"
    );
    let languages = read("docs/languages.md");
    for file in ["examples/c/spring.c", "examples/cpp/spring.cpp"] {
        assert!(
            languages.contains(read(file).trim_end()),
            "docs/languages.md: its copy of {file} differs from the file"
        );
    }
}

/// The first example in TOML below the line `above` of a page.
fn example(page: &str, above: &str) -> String {
    let (_, rest) = page
        .split_once(above)
        .unwrap_or_else(|| panic!("there is no `{above}`"));
    let (_, rest) = rest.split_once("```toml\n").expect("there is an example");
    rest.split_once("```").expect("it ends").0.to_owned()
}

#[test]
fn scenario_page_begins_with_the_example_that_runs() {
    // With `tests/examples.rs`, which runs the file.
    let scenario = example(&read("docs/scenarios.md"), "# The scenario file");
    let whole = read("examples/spring/spring.toml");
    assert!(
        whole.starts_with(scenario.trim_end()),
        "docs/scenarios.md: its copy of examples/spring/spring.toml differs from the file"
    );
    assert!(
        whole[scenario.trim_end().len()..]
            .trim_start()
            .starts_with("[measures.")
    );
}

#[test]
fn documented_guards_pass_the_close_capture() {
    let guards = example(&read("docs/scenarios.md"), "## `[guards.NAME]`");
    let folder = Folder::new("guards-of-the-page");
    let stock = read("scenarios/close.toml").replace("../", &format!("{}/", root().display()));
    let scenario = folder.write("close.toml", &format!("{stock}\n{guards}"));
    let out = folder.path().join("run");
    let output = run_orchestrator(&["run", text(&scenario), "--in-process", "--quiet", "--out", text(&out)]);
    assert_eq!(output.code, Some(0), "{output:?}");
}

#[test]
fn architecture_page_stays_short() {
    let count = read("ARCHITECTURE.md").lines().count();
    assert!(count < 400, "ARCHITECTURE.md:{count}: 400 lines are the limit");
}

/// The documentation pages, with their names.
fn pages() -> Vec<(PathBuf, String)> {
    let pages = files(&root(), ".md").into_iter();
    pages
        .map(|path| (path.clone(), std::fs::read_to_string(&path).unwrap_or_default()))
        .collect()
}

#[test]
fn tests_that_pages_name_exist() {
    let mut missing = Vec::new();
    for (page, text) in pages() {
        for (number, line) in text.lines().enumerate() {
            // `path/to/file.rs::name`
            for quoted in line.split('`').skip(1).step_by(2) {
                let Some((file, name)) = quoted.split_once(".rs::") else {
                    continue;
                };
                let source = std::fs::read_to_string(root().join(format!("{file}.rs"))).unwrap_or_default();
                if !source.contains(&format!("fn {name}(")) {
                    missing.push(format!("  {}:{}: {quoted}", page.display(), number + 1));
                }
            }
        }
    }
    assert!(
        missing.is_empty(),
        "pages name tests that are not there:\n{}",
        missing.join("\n")
    );
}

#[test]
fn links_between_pages_have_a_target() {
    let mut broken = Vec::new();
    for (page, text) in pages() {
        for (number, line) in text.lines().enumerate() {
            for target in line.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
                let file = target.split('#').next().unwrap_or_default();
                let outside = file.is_empty() || file.contains("://") || file.contains(char::is_whitespace);
                if !outside && !page.parent().unwrap_or(&root()).join(file).exists() {
                    broken.push(format!("  {}:{}: {target}", page.display(), number + 1));
                }
            }
        }
    }
    assert!(broken.is_empty(), "links lead nowhere:\n{}", broken.join("\n"));
}
