//! The commands that the README shows work.

use escapement_tests::program::{Folder, built_as_shipped, run_orchestrator};

#[test]
fn example_runs_as_documented_in_the_readme() {
    built_as_shipped();
    let folder = Folder::new("spring");
    let out = folder.path().join("run");
    let out = out.to_str().expect("paths of tests are text");
    let output = run_orchestrator(&["run", "examples/spring/spring.toml", "--out", out, "--json"]);
    assert_eq!(output.code, Some(0), "{output:?}");
    assert_eq!(output.json()["simulated_time_s"], 10.0, "{output:?}");
}
