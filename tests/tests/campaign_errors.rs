//! Mistakes in campaigns and lists of cases are rejected where they are, with the line and the remedy.

use escapement_tests::fixture;
use escapement_tests::program::{Folder, assert_refused, root, run_orchestrator, text};

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
fn case_list_is_refused_at_the_line_of_its_mistake() {
    let folder = Folder::new("wrong-cases");
    let scenario = root().join("scenarios/close.toml");
    for (text_of_list, part) in [
        ("[[case]]\nname = 'a'\nsett = {}", "wrong.toml:3: unknown field `sett`"),
        ("title = 'none'\ncase = []", "has no [[case]]"),
        (
            "[[case]]\nname = 'a'\n[[case]]\nname = 'a'",
            "wrong.toml:4: case.2.name: another case is called `a` too",
        ),
        (
            "[[case]]\nname = \"a\\u001b[2J\"",
            "wrong.toml:2: case.1.name: \"a\\u{1b}[2J\" has the control character",
        ),
        (
            "[[case]]\nname = 'a'\nappend = { \"participants.plant.period\" = [1] }",
            "wrong.toml:3: case `a`: `participants.plant.period` is string and no list",
        ),
        (
            "[[case]]\nname = 'a'\nset = { \"duraton\" = 1 }",
            "unknown field `duraton`",
        ),
    ] {
        let list = folder.write("wrong.toml", text_of_list);
        let output = run_orchestrator(&[
            "faults",
            text(&scenario),
            "--cases",
            text(&list),
            "--out",
            text(&folder.path().join("no")),
        ]);
        assert_eq!(output.code, Some(2), "{output:?}");
        assert!(output.err.contains(part), "`{part}` is not in: {}", output.err);
    }
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
    fixture::write_springs(&folder);
    let scenario = folder.path().join("springs.toml");
    let out = folder.path().join("out");
    let until = ["--until", "met within 20 %", "--quiet", "--out", text(&out)];
    let drawn = |head: &str, more: &str| {
        let campaign = format!(
            "scenario = \"springs.toml\"\npoints = 8\n{head}\n[vary.k]\nkey = \"participants.left.parameters.stiffness\"\n\
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

#[test]
fn stopping_rule_that_is_not_reached_is_reported() {
    let folder = Folder::new("not-reached");
    fixture::write_springs(&folder);
    let scenario = folder.path().join("springs.toml");
    let out = folder.path().join("out");
    let sweep = |rule: &str, more: &[&str]| {
        let all = [
            "sweep",
            text(&scenario),
            "--seeds",
            "4",
            "--until",
            rule,
            "--out",
            text(&out),
        ];
        run_orchestrator(&[&all[..], more].concat())
    };
    let output = sweep("met within 1 %", &["--json"]);
    assert_eq!(output.code, Some(0), "{output:?}");
    assert!(
        output.err.contains("`met within 1 %` was not reached: 4 points give "),
        "{output:?}"
    );
    let json = output.json();
    assert_eq!(json["until"]["reached"], false);
    assert!(json["until"]["within_percent"].as_f64().unwrap() > 1.0, "{json}");
    // Without a limit nothing is met or not met.
    let text_of = std::fs::read_to_string(&scenario).unwrap();
    folder.write("springs.toml", &text_of.replace("at-most = \"0.9 mm\"\n", ""));
    let output = sweep("met within 20 %", &[]);
    assert_refused(&output, &["--until: ", "no criterion", "give a measure a limit"], &[]);
}

#[test]
fn dispersion_with_the_name_of_a_figure_is_refused() {
    let folder = Folder::new("figure-name");
    fixture::write_springs(&folder);
    let drawn = |name: &str| {
        let campaign = format!(
            "scenario = \"springs.toml\"\npoints = 3\n\n[vary.{name}]\nkey = \"faults.push.value\"\n\
             distribution = \"uniform\"\nfrom = \"1 mm\"\nto = \"2 mm\"\n"
        );
        let campaign = folder.write("campaign.toml", &campaign);
        run_orchestrator(&[
            "sweep",
            text(&campaign),
            "--quiet",
            "--out",
            text(&folder.path().join(name)),
        ])
    };
    let place = "campaign.toml:4: vary.swing: the name `swing` is not possible";
    assert_refused(&drawn("swing"), &[place, "choose another"], &[]);
    assert_eq!(drawn("push").code, Some(0));
}

#[test]
fn changes_that_have_no_effect_cause_warnings() {
    let folder = Folder::new("no-effect");
    fixture::write_springs(&folder);
    let scenario = folder.path().join("springs.toml");
    let list = "[[case]]\nname = \"late\"\nset = { \"faults.push.at\" = \"300 ms\" }\n[[case]]\nname = \"early\"\n";
    let list = folder.write("cases.toml", list);
    let out = folder.path().join("cases");
    let output = run_orchestrator(&["faults", text(&scenario), "--cases", text(&list), "--out", text(&out)]);
    assert_eq!(output.code, Some(0), "{output:?}");
    let warning = "warning: point 1 (late, 300 ms): ";
    assert!(
        output.err.contains(warning) && output.err.contains("faults.push.at"),
        "{output:?}"
    );
    assert_eq!(output.err.matches("warning").count(), 1, "{output:?}");
    // The command line gives what varies, and the scenario too.
    let own = "\n[campaign]\npoints = 3\n\n[campaign.vary.v]\nkey = \"faults.push.value\"\n\
               distribution = \"uniform\"\nfrom = \"1 mm\"\nto = \"2 mm\"\n";
    let both = std::fs::read_to_string(&scenario).unwrap() + own;
    let both = folder.write("both.toml", &both);
    let out = folder.path().join("both");
    let output = run_orchestrator(&["sweep", text(&both), "--seeds", "2", "--out", text(&out)]);
    assert!(output.err.contains("both.toml: [campaign] is not used"), "{output:?}");
}
