//! What the README tells a reader to type works.

use std::process::Command;

use escapement_tests::program::{Folder, built, orchestrate, root};

#[test]
fn the_example_runs_as_the_readme_says() {
    // The scenario names the program in target/release, whatever profile this test was built with.
    if !built().ends_with("release") {
        let built = Command::new(env!("CARGO"))
            .current_dir(root())
            .args(["build", "--quiet", "--release", "--workspace", "--bins"])
            .status();
        assert!(
            built.expect("cargo can be started").success(),
            "the example does not build"
        );
    }
    let folder = Folder::new("spring");
    let out = folder.path().join("run");
    let out = out.to_str().expect("paths of tests are text");
    let said = orchestrate(&["run", "examples/spring/spring.toml", "--out", out, "--json"]);
    assert_eq!(said.code, Some(0), "{said:?}");
    assert_eq!(said.json()["simulated_time_s"], 10.0, "{said:?}");
}
