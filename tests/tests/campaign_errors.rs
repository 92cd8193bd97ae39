//! Mistakes in campaigns and lists of cases are rejected where they are, with the line and the remedy.

use escapement_tests::fixture;
use escapement_tests::program::{Folder, assert_refused, run_orchestrator, text};

#[test]
fn list_entry_is_addressed_by_number_or_by_name() {
    let folder = Folder::new("by-number");
    fixture::write_springs(&folder);
    let scenario = folder.path().join("springs.toml");
    let out = folder.path().join("out");
    for entry in ["push", "1"] {
        let set = format!("faults.{entry}.value=3 kg");
        let output = run_orchestrator(&["check", text(&scenario), "--set", &set]);
        assert_refused(
            &output,
            &["springs.toml: faults.push.value: ", "`3 kg`", "(given with --set)"],
            &[],
        );
        let drawn = format!(
            "scenario = \"springs.toml\"\npoints = 3\n\n[vary.push]\nkey = \"faults.{entry}.value\"\n\
             distribution = \"uniform\"\nfrom = \"1 kg\"\nto = \"2 kg\"\n"
        );
        let campaign = folder.write("campaign.toml", &drawn);
        let output = run_orchestrator(&["sweep", text(&campaign), "--out", text(&out)]);
        assert_refused(
            &output,
            &["campaign.toml:4: vary.push: ", "faults.push.value", "kg"],
            &["springs.toml:"],
        );
    }
}

#[test]
fn error_in_a_case_names_the_case_list() {
    let folder = Folder::new("case-mistake");
    let scenario = fixture::write_two_masses(&folder);
    let out = folder.path().join("out");
    let fault =
        "[{ at = \"0.1 s\", input = \"right.neighbour\", field = \"position\", kind = \"bias\", value = \"1 kg\" }]";
    for (part, change, names) in [
        (
            "set",
            "set = { \"connections.to-right.dellay\" = \"20 ms\" }",
            "connections.to-right.dellay",
        ),
        ("set", "set = { \"duraton\" = 1 }", "duraton"),
        ("faults", &format!("faults = {fault}"), "`1 kg`"),
    ] {
        let list = folder.write(
            "cases.toml",
            &format!("title = \"t\"\n\n[[case]]\nname = \"a\"\n{change}\n"),
        );
        let output = run_orchestrator(&["faults", text(&scenario), "--cases", text(&list), "--out", text(&out)]);
        let place = format!("cases.toml:5: case `a`: {part}: ");
        assert_refused(&output, &[&place, names], &["m.toml"]);
    }
    // A case without changes is not the cause.
    let wrong = std::fs::read_to_string(&scenario).unwrap().replace("1 kg", "1 m");
    let wrong = folder.write("m.toml", &wrong);
    let list = folder.write("cases.toml", "[[case]]\nname = \"a\"\n");
    let output = run_orchestrator(&["faults", text(&wrong), "--cases", text(&list), "--out", text(&out)]);
    assert_refused(&output, &["m.toml:", "`1 m`"], &["cases.toml"]);
    assert!(!out.exists(), "nothing is written");
}

#[test]
fn audit_without_another_shard_is_refused() {
    let folder = Folder::new("audit-alone");
    let scenario = fixture::write_two_masses(&folder);
    let out = folder.path().join("out");
    let sweep = |more: &[&str]| {
        run_orchestrator(&[&["sweep", text(&scenario), "--seeds", "2", "--out", text(&out)], more].concat())
    };
    let parts = ["--audit: ", "no other shard", "two shards or more"];
    assert_refused(&sweep(&["--audit", "50%", "--shard", "1/1"]), &parts, &[]);
    assert_refused(
        &sweep(&["--audit", "50%", "--on", "shell", "--shards", "1"]),
        &parts,
        &[],
    );
    assert!(!out.exists(), "nothing is written");
    assert_eq!(sweep(&["--quiet"]).code, Some(0));
    assert_refused(
        &run_orchestrator(&["sweep", "run", text(&out), "--audit", "50%"]),
        &parts,
        &[],
    );
}

#[test]
fn design_that_needs_all_points_refuses_early_stop() {
    let folder = Folder::new("early-end");
    let scenario = fixture::write_two_masses(&folder);
    let out = folder.path().join("out");
    let until = ["--until", "met within 20 %", "--quiet", "--out", text(&out)];
    let drawn = |head: &str, more: &str| {
        let campaign = format!(
            "scenario = \"m.toml\"\npoints = 8\n{head}\n[vary.k]\nkey = \"participants.left.parameters.stiffness\"\n\
             distribution = \"uniform\"\nfrom = \"30 N/m\"\nto = \"50 N/m\"\n{more}\n"
        );
        let campaign = folder.write("campaign.toml", &campaign);
        run_orchestrator(&[&["sweep", text(&campaign)], &until[..]].concat())
    };
    for design in ["latin-hypercube", "saltelli"] {
        let output = drawn(&format!("design = \"{design}\""), "");
        assert_refused(
            &output,
            &["--until: ", "campaign.toml", design, "leave --until out"],
            &[],
        );
    }
    // One dispersion with such a design is enough.
    let output = drawn("", "levels = 3\ndesign = \"grid\"");
    assert_refused(&output, &["--until: ", "grid", "random or sobol"], &[]);
    let grid = ["--vary", "connections.to-right.delay=0ms,10ms", "--seeds", "4"];
    let output = run_orchestrator(&[&["sweep", text(&scenario)], &grid[..], &until[..]].concat());
    assert_refused(
        &output,
        &["--until: ", "connections.to-right.delay", "the seed alone"],
        &[],
    );
    assert!(!out.exists(), "nothing is written");
    assert_eq!(drawn("design = \"sobol\"", "").code, Some(0));
}
