//! The commands that the README shows work.

use escapement_tests::program::{Folder, built_as_shipped, root, run_orchestrator, text};

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

/// Programs describe their ports when they are asked, so figures and criteria of their outputs are known before a campaign runs.
#[test]
fn figures_of_separate_programs_are_known_to_a_campaign() {
    built_as_shipped();
    let folder = Folder::new("spring-figures");
    let out = |name: &str| folder.path().join(name);
    let spring = "examples/spring/spring.toml";
    let sweep = |name: &str, more: &[&str]| {
        let own = ["sweep", spring, "--duration", "1500 ms", "--quiet", "--out"];
        run_orchestrator(&[&own[..], &[text(&out(name))], more].concat())
    };
    let delays = ["--vary", "connections.to-right.delay=0ms..20ms:10ms"];
    let output = sweep("figure", &[&delays[..], &["--figure", "swing"]].concat());
    assert_eq!((output.code, output.err.as_str()), (Some(0), ""), "{output:?}");
    let output = sweep("until", &["--seeds", "40", "--until", "apart within 5 %"]);
    assert_eq!(output.code, Some(0), "{output:?}");
    // All seeds give the same mean, which is known after the least number of points.
    let table = std::fs::read_to_string(out("until").join("table.csv")).unwrap();
    assert_eq!(table.lines().count(), 31, "{table}");
    let output = sweep("wrong", &[&delays[..], &["--figure", "sway"]].concat());
    assert_eq!(output.code, Some(2), "{output:?}");
    assert!(output.err.contains("`sway`; there is swing, apart"), "{output:?}");
    assert!(!out("wrong").exists(), "nothing is run");

    let scenario = root().join(spring);
    let subset = |criterion: &str| {
        format!(
            "scenario = \"{}\"\npoints = 20\ndesign = \"subset\"\n[subset]\nshare = 0.5\nlevels = 1\ncriterion = \"{criterion}\"\n\
             [vary.start]\nkey = \"participants.left.parameters.position\"\ndistribution = \"normal\"\nmean = 0.1\ndeviation = 0.01\n",
            text(&scenario)
        )
    };
    let rare = |name: &str, criterion: &str| {
        let file = folder.write(&format!("{name}.toml"), &subset(criterion));
        let duration = ["--duration", "1500 ms", "--quiet"];
        run_orchestrator(&[&["sweep", text(&file), "--out", text(&out(name))], &duration[..]].concat())
    };
    let output = rare("rare", "swing");
    assert_eq!(output.code, Some(0), "{output:?}");
    let output = rare("unlimited", "apart");
    assert_eq!(output.code, Some(2), "{output:?}");
    assert!(
        output.err.contains("the measure `apart` is no criterion") && output.err.contains("there is `swing`"),
        "{output:?}"
    );
}
