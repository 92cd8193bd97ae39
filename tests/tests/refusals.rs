//! Every mistake in a scenario is rejected before anything starts: exit code 2, the file, the line, the key, the remedy, and no run
//! folder.

use escapement_tests::program::{Folder, root, run_orchestrator, text};

/// Runs the close capture with `from` replaced by `to`; the message must contain all of `expected`.
fn assert_refused(from: &str, to: &str, expected: &[&str]) {
    let folder = Folder::new("refused");
    let stock = std::fs::read_to_string(root().join("scenarios/close.toml")).unwrap();
    assert!(stock.contains(from), "the stock scenario has no `{from}`");
    let changed = stock
        .replacen(from, to, 1)
        .replace("../", &format!("{}/", root().display()));
    let scenario = folder.write("changed.toml", &changed);
    let out = folder.path().join("run");
    for command in [
        &["run", text(&scenario), "--out", text(&out)][..],
        &["check", text(&scenario)],
    ] {
        let output = run_orchestrator(command);
        assert_eq!(output.code, Some(2), "{output:?}");
        for part in expected {
            assert!(output.err.contains(part), "`{part}` is not in: {}", output.err);
        }
        assert!(output.err.contains("changed.toml"), "{output:?}");
    }
    assert!(!out.exists(), "nothing is written");
}

#[test]
fn unknown_key_is_refused() {
    assert_refused(
        "duration = ",
        "duratoin = \"1 s\"\nduration = ",
        &["changed.toml:", "duratoin", "unknown field"],
    );
}

#[test]
fn unknown_key_of_a_participant_is_refused() {
    assert_refused(
        "[participants.plant]",
        "[participants.plant]\nperoid = \"1 ms\"",
        &["participants.plant.peroid", "unknown field"],
    );
}

#[test]
fn unknown_parameter_is_refused() {
    assert_refused(
        "[participants.controller.parameters]",
        "[participants.controller.parameters]\nspeeed = 3",
        &["participants.controller.parameters", "speeed"],
    );
}

#[test]
fn title_with_control_characters_is_refused_and_escaped() {
    let title = "title = \"Close capture";
    for (written, shown) in [("\\n", "\\n"), ("\\u001b[31m", "\\u{1b}"), ("\\u2028", "\\u{2028}")] {
        let line = format!(": title: \"{shown}");
        let to = title.replace("\"Close", &format!("\"{written}Close"));
        assert_refused(
            title,
            &to,
            &["changed.toml:", &line, "write one line without control characters"],
        );
    }
}

#[test]
fn wrong_unit_is_refused() {
    assert_refused(
        "period = \"1 ms\"",
        "period = \"1 m\"",
        &["participants.plant.period", "`1 m`", "not one of time"],
    );
}

#[test]
fn missing_connection_is_refused() {
    assert_refused(
        "to = \"plant.command\"",
        "to = []",
        &["connections.command.to", "names no input"],
    );
}

#[test]
fn too_many_samples_in_flight_name_the_longest_delay() {
    assert_refused(
        "delay = \"0 ms\"\n\n[assessment]",
        "delay = \"1 ms\"\njitter = \"9 h\"\n\n[assessment]",
        &["connections.command.jitter", "shorten its jitter of 32400 s"],
    );
    assert_set_refused(
        "connections.command.delay=\"9 h\"",
        &["connections.command.delay", "shorten its delay of 32400 s"],
    );
    let scenario = root().join("scenarios/close.toml");
    let fault = "connection=command,at=1 s,extra-delay=9 h";
    let output = run_orchestrator(&["check", text(&scenario), "--fault", fault]);
    assert_eq!(output.code, Some(2), "{output:?}");
    for part in [
        "faults.fault-1.extra-delay",
        "shorten the extra delay of 32400 s of the fault `fault-1`",
        "given with --fault",
    ] {
        assert!(output.err.contains(part), "`{part}` is not in: {}", output.err);
    }
}

#[test]
fn missing_file_is_refused() {
    assert_refused(
        "servicer.urdf",
        "serviser.urdf",
        &["participants.plant.parameters", "serviser.urdf", "cannot be read"],
    );
}

#[test]
fn unknown_builtin_is_refused() {
    assert_refused(
        "builtin = \"plant\"",
        "builtin = \"plan\"",
        &["participants.plant.run", "no builtin `plan`", "`plant`"],
    );
}

#[test]
fn invalid_toml_is_refused() {
    assert_refused(
        "[connections.command]",
        "[connections.command",
        &["changed.toml:", "is not TOML"],
    );
}

fn assert_set_refused(set: &str, expected: &[&str]) {
    let scenario = root().join("scenarios/close.toml");
    let output = run_orchestrator(&["check", text(&scenario), "--set", set]);
    assert_eq!(output.code, Some(2), "{output:?}");
    for part in expected {
        assert!(output.err.contains(part), "`{part}` is not in: {}", output.err);
    }
}

#[test]
fn overrides_are_checked_like_the_file() {
    assert_set_refused(
        "connections.measured.delay=-1ms",
        &["connections.measured", "-1 ms", "must not be negative"],
    );
    assert_set_refused(
        "connections.nothing.delay=1ms",
        &["no `nothing`", "`measured`", "--set"],
    );
    assert_set_refused(
        "connections.measured.drop=1.5",
        &["connections.measured", "1.5", "between 0 and 1"],
    );
    assert_set_refused(
        "connections.command.initial=first-sample",
        &["connections.command", "first-sample", "initial value"],
    );
    assert_set_refused(
        "connections.command.from=controller.comand",
        &["no output of `controller`", "`comand`", "`command`"],
    );
    assert_set_refused(
        "connections.command.to=guidance.target",
        &["does not fit", "`plant.command` is not connected"],
    );
    assert_set_refused(
        "connections.target.to=[\"guidance.target\", \"guidance.target\"]",
        &["`guidance.target` is fed twice"],
    );
    assert_set_refused(
        "connections.setpoint.to=plant.command",
        &["does not fit", "f64 in s", "in N m, frame B"],
    );
    assert_set_refused(
        "participants.plant.period=0s",
        &["participants.plant.period", "must be positive"],
    );
    assert_set_refused("duration=0s", &["duration", "must be positive"]);
    assert_set_refused("seed=-1", &["seed"]);
    assert_set_refused(
        "participants.plant.run.exe=/bin/true",
        &["participants.plant.run", "write {"],
    );
    assert_set_refused("nonsense", &["KEY.PATH=VALUE"]);
}

/// A file is read in stages, each of which needs the result of the previous one: sections, parameters, plan.
#[test]
fn all_errors_of_a_stage_are_reported_at_once() {
    let scenario = root().join("scenarios/close.toml");
    let sections = [
        ("participants.plant.period=0s", "must be positive"),
        ("participants.guidance.perod=1s", "unknown field `perod`"),
        ("connections.measured.jitter=1m", "not one of time"),
    ];
    let parameters = [
        ("participants.plant.parameters.speeed=1", "`speeed`"),
        ("participants.controller.parameters.law=none", "`none`"),
    ];
    let plan = [
        ("connections.measured.delay=-1ms", "must not be negative"),
        (
            "connections.target.to=[\"guidance.target\", \"guidance.target\"]",
            "`guidance.target` is fed twice",
        ),
        ("connections.setpoint.to=plant.command", "f64 in s"),
    ];
    for stage in [&sections[..], &parameters, &plan] {
        let sets = stage.iter().flat_map(|(set, _)| ["--set", set]);
        let output = run_orchestrator(&["check", text(&scenario)].into_iter().chain(sets).collect::<Vec<_>>());
        assert_eq!(output.code, Some(2), "{output:?}");
        for (_, mistake) in stage {
            assert!(output.err.contains(mistake), "`{mistake}` is not in: {}", output.err);
        }
    }
}

#[test]
fn algebraic_loop_is_refused_with_its_members_and_the_remedy() {
    let folder = Folder::new("loop");
    let scenario = folder.write(
        "loop.toml",
        r#"duration = "1 s"
[participants.a]
run = { builtin = "bench-sampled" }
period = "1 ms"
[participants.b]
run = { builtin = "bench-sampled" }
period = "3 ms"
[connections.there]
from = "a.to"
to = "b.from"
[connections.back]
from = "b.to"
to = "a.from"
"#,
    );
    let output = run_orchestrator(&["check", text(&scenario)]);
    assert_eq!(output.code, Some(2), "{output:?}");
    for part in ["algebraic loop at t = 0 s", "a -> b -> a", "`there`", "`back`", "delay"] {
        assert!(output.err.contains(part), "`{part}` is not in: {}", output.err);
    }
    // Members without a common instant form no loop; neither does a cycle with a delay in it.
    for cure in ["participants.b.offset=0.5ms", "connections.back.delay=1us"] {
        let output = run_orchestrator(&["check", text(&scenario), "--set", cure]);
        assert_eq!(output.code, Some(0), "{cure}: {output:?}");
    }
}

#[test]
fn run_folder_is_never_overwritten() {
    let folder = Folder::new("taken");
    folder.write("precious.txt", "work of years");
    let scenario = root().join("scenarios/close.toml");
    let output = run_orchestrator(&[
        "run",
        text(&scenario),
        "--out",
        text(folder.path()),
        "--duration",
        "10 ms",
    ]);
    assert_eq!(output.code, Some(2), "{output:?}");
    assert!(
        output.err.contains("not empty") && output.err.contains("--out"),
        "{output:?}"
    );
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

/// A file of tuned gains that does not fit: the key, what is wrong, the remedy.
#[test]
fn gains_that_do_not_fit_the_controller_are_refused() {
    let folder = Folder::new("gains");
    let tuned = std::fs::read_to_string(root().join("gains/pi-diagonal.toml")).unwrap();
    let integral = tuned.lines().find(|line| line.starts_with("ki = ")).unwrap();
    let proportional = tuned.lines().find(|line| line.starts_with("kp = ")).unwrap();
    let shorter = format!("{}]", proportional.rsplit_once(',').unwrap().0);
    let twice = format!("{proportional}\nkp_matrix = [[1.0]]");
    let cases: [(&str, &str, &[&str]); 5] = [
        (
            proportional,
            &shorter,
            &["gains.gains.kp", "12 entries", "13 channels", "tuned for this robot"],
        ),
        (
            integral,
            "",
            &["gains.gains.ki", "without an integral part", "proportional"],
        ),
        (
            "structure = \"diagonal\"",
            "structure = \"scheduled\"",
            &["gains.gains.kp", "`x` alone"],
        ),
        (proportional, &twice, &["gains.gains.kp_matrix", "`kp` alone"]),
        ("[gains]", "[gains]\nlaw = \"reference\"", &["unknown field", "law"]),
    ];
    for (from, to, expected) in cases {
        assert!(tuned.contains(from));
        let file = folder.write("gains.toml", &tuned.replacen(from, to, 1));
        let set = format!(
            "participants.controller.parameters.gains={{ file = {:?} }}",
            text(&file)
        );
        assert_set_refused(&set, expected);
    }
    // The paper's bound is the norm of K_S, which not every file has, and it is one bound for all channels.
    let without: String = tuned
        .lines()
        .filter(|line| !line.starts_with("ks = "))
        .map(|line| format!("{line}\n"))
        .collect();
    assert_ne!(without, tuned);
    let file = folder.write("without.toml", &without);
    let set = format!(
        "participants.controller.parameters.gains={{ file = {:?} }}",
        text(&file)
    );
    assert_set_refused(&set, &["gains.gains.ks", "is missing", "bound = \"actuators\""]);
    assert_set_refused(
        "participants.controller.parameters.inner={ bound = \"sliding-gain\", force_bound = \"5 N\" }",
        &["inner.force_bound", "would be ignored", "sliding-gain"],
    );
    assert_set_refused(
        "participants.controller.parameters.inner={ scalar_bound = 5.0, torque_bound = \"1 N m\" }",
        &["inner.torque_bound", "would be ignored", "scalar_bound"],
    );
    assert_set_refused(
        "participants.controller.parameters.inner={ feedback = \"proportional\" }",
        &["gains.gains.ki", "would be ignored", "integral = false"],
    );
}

/// The certificate of gains holds for one robot and one period: `check` reports when they are used with another.
#[test]
fn gains_of_another_robot_are_warned_of() {
    let scenario = root().join("scenarios/close.toml");
    let check = |set: &str| run_orchestrator(&["check", text(&scenario), "--set", set]);
    let as_tuned = check("seed=1");
    assert_eq!(
        (as_tuned.code, as_tuned.err.contains("warning")),
        (Some(0), false),
        "{as_tuned:?}"
    );
    let slower = check("participants.controller.period=20ms");
    assert_eq!(slower.code, Some(0), "{slower:?}");
    assert!(slower.err.contains("tuned for a period of 0.01 s"), "{slower:?}");
    let folder = Folder::new("robot");
    let urdf = std::fs::read_to_string(root().join("models/servicer.urdf")).unwrap();
    let with = |name: &str, urdf: String| {
        let file = folder.write(name, &urdf);
        check(&format!(
            "participants.controller.parameters.urdf={{ file = {:?} }}",
            text(&file)
        ))
    };
    // A robot that is only drawn differently is the same; one with other masses is not.
    let painted = with("painted.urdf", format!("{urdf}\n<!-- another coat of paint -->\n"));
    assert_eq!(
        (painted.code, painted.err.contains("warning")),
        (Some(0), false),
        "{painted:?}"
    );
    let heavier = urdf.replacen("<mass value=\"", "<mass value=\"1", 1);
    assert_ne!(heavier, urdf);
    let another = with("heavier.urdf", heavier);
    assert_eq!(another.code, Some(0), "{another:?}");
    assert!(another.err.contains("tuned for another robot"), "{another:?}");
    assert!(
        another.err.contains("escapement tune gains/pi-diagonal.spec.toml"),
        "{another:?}"
    );
}

#[test]
fn panel_of_unknown_signals_is_refused() {
    for (panel, expected) in [
        (
            "curves = [\"plant.truth.position\"]",
            &[
                "changed.toml:5: report.panels.1.curves.1",
                "`plant.truth` has no field or element `position`",
                "`p_NB_N[3]`",
            ][..],
        ),
        (
            "title = \"x\"\ncurves = [\"pilot.truth.q\"]",
            &[
                "changed.toml:5: report.panels.1.curves.1",
                "there is no participant `pilot`",
                "`plant`",
            ],
        ),
        (
            "curves = [{ of = \"plant.truth.p_NE_N\", minus = \"plant.truth.v_NB_B\" }]",
            &["report.panels.1.curves.1", "is in `m/s`, not in `m`"],
        ),
        (
            "curves = [\"plant.truth.p_NE_N\"]\nunit = \"kg\"",
            &["report.panels.1.curves.1", "`kg`"],
        ),
        (
            "curve = []",
            &["changed.toml:5: report.panels.1.curve", "unknown field"],
        ),
    ] {
        // At the head of the file, on a separate line.
        let panel = panel.replace('\n', ", ");
        assert_refused(
            "title = ",
            &format!("report.panels = [\n{{ {panel} }}]\ntitle = "),
            expected,
        );
    }
}
