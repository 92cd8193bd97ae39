//! Tuned gains from the user's point of view: recomputed, verified in closed-loop simulations, and contradicted.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use escapement_tests::machine::send_signal;
use escapement_tests::program::{
    Folder, ProgramOutput, root, run_orchestrator, start_orchestrator, text, wait_for_output,
};
use serde_json::Value;

/// The specification of the stock P gains with one closed-loop scenario of this title, length and criterion.
fn specification(folder: &Folder, title: &str, length: &str, rate: &str) -> PathBuf {
    let mut scenario = std::fs::read_to_string(root().join("gains/closed-loop.toml")).unwrap();
    for (stock, new) in [
        ("\"Hold the end effector after a push\"", format!("\"{title}\"")),
        ("at-most = \"0.02 deg/s\"", format!("at-most = \"{rate}\"")),
        ("duration = \"20 s\"", format!("duration = \"{length}\"")),
        ("grasp_at = \"20 s\"", format!("grasp_at = \"{length}\"")),
        ("../", format!("{}/", root().display())),
        ("file = \"pi", format!("file = \"{}/gains/pi", root().display())),
    ] {
        assert!(scenario.contains(stock), "{stock}");
        scenario = scenario.replace(stock, &new);
    }
    let scenario = folder.write("closed-loop.toml", &scenario);
    let specification = std::fs::read_to_string(root().join("gains/p-diagonal.spec.toml")).unwrap();
    let specification = specification
        .replace("gains/closed-loop.toml", text(&scenario))
        .replace("models/servicer.urdf", text(&root().join("models/servicer.urdf")))
        .replace("delays_s = [0.0, 0.005, 0.01, 0.02]", "delays_s = [0.01]");
    folder.write("p.spec.toml", &specification)
}

fn margins(specification: &Path) -> [String; 6] {
    let gains = root().join("gains/p-diagonal.toml");
    ["margins", text(&gains), "--spec", text(specification), "--models", "0"].map(String::from)
}

/// `margins` on the stock P gains with a specification whose closed-loop verification requires this base rate at the end.
fn verify_margins(rate: &str) -> escapement_tests::program::ProgramOutput {
    let folder = Folder::new("closed-loop");
    let arguments = margins(&specification(&folder, "a push", "12 s", rate));
    run_orchestrator(&arguments.each_ref().map(String::as_str))
}

/// A closed-loop verification that misses its criteria although the sampled loop is stable ends with 3 and reports which.
#[test]
fn simulation_that_contradicts_the_linear_result_is_reported() {
    let settled = verify_margins("0.1 deg/s");
    assert_eq!(settled.code, Some(0), "{settled:?}");
    assert!(settled.out.contains("10 + 10"), "{settled:?}");
    let contradicted = verify_margins("1e-9 deg/s");
    assert_eq!(contradicted.code, Some(3), "{contradicted:?}");
    assert!(
        contradicted.err.contains("the sampled loop is stable") && contradicted.err.contains("does not settle"),
        "{contradicted:?}"
    );
}

/// A command killed during the closed-loop verification leaves its folder where `doctor` finds it.
#[test]
fn leftovers_of_a_killed_verification_are_removed() {
    let base = Path::new("/dev/shm");
    let folder = Folder::new("killed-closed-loop");
    let title = format!("a simulation to be killed {}", std::process::id());
    let arguments = margins(&specification(&folder, &title, "100000 s", "1 deg/s"));
    let child = start_orchestrator(&arguments.each_ref().map(String::as_str));
    let started = Instant::now();
    let left = loop {
        let entries = std::fs::read_dir(base).into_iter().flatten().flatten();
        let mut runs = entries.map(|entry| entry.path());
        let ours = runs.find(|run| {
            let plan = std::fs::read_to_string(run.join("scratch/closed-loop/plan.toml"));
            plan.is_ok_and(|plan| plan.contains(&title))
        });
        if let Some(ours) = ours {
            break ours;
        }
        assert!(
            started.elapsed() < Duration::from_secs(60),
            "no simulation under {}",
            base.display()
        );
        std::thread::sleep(Duration::from_millis(5));
    };
    // While the process lives, its folder is not removed.
    assert_eq!(run_orchestrator(&["doctor", "--remove"]).code, Some(0));
    assert!(left.exists());
    let on_disk = left.join("scratch").canonicalize().expect("what is large is on disk");
    send_signal(child.id(), rustix::process::Signal::KILL);
    assert_eq!(wait_for_output(child).code, None);
    assert_eq!(run_orchestrator(&["doctor", "--remove"]).code, Some(0));
    for left in [left, on_disk] {
        assert!(!left.exists(), "{} is left", left.display());
    }
}

/// `tune` on plain matrices: exit code and message.
fn tune_matrices(json: &str) -> escapement_tests::program::ProgramOutput {
    let folder = Folder::new("tune-matrices");
    let file = folder.write("plant.json", json);
    run_orchestrator(&["tune", text(&file), "--starts", "2"])
}

#[test]
fn tune_warns_where_no_gain_is_optimal() {
    for (json, expected) in [
        (
            r#"{"A":[[1]],"B1":[[1]],"B":[[1]],"C1":[[1]],"C":[[1]]}"#,
            "falls with growing gains",
        ),
        (
            r#"{"A":[[1]],"B1":[[1]],"B":[[1]],"C1":[[1]],"C":[[1]],"D12":[[1]],"D21":[[1]]}"#,
            "imaginary axis",
        ),
        (
            r#"{"A":[[-1]],"B1":[[1]],"B":[[1]],"C1":[[0]],"C":[[1]]}"#,
            "w does not reach z",
        ),
    ] {
        let output = tune_matrices(json);
        assert_eq!(output.code, Some(3), "{output:?}");
        assert!(
            output.err.contains("warning: ") && output.err.contains(expected),
            "{output:?}"
        );
        assert!(output.out.contains("gamma"), "{output:?}");
    }
}

#[test]
fn tune_of_matrices_refuses_options_of_a_robot() {
    let folder = Folder::new("tune-matrices");
    let file = folder.write(
        "plant.json",
        r#"{"A":[[0,1],[2,-0.4]],"B1":[[0],[1]],"B":[[0],[1]],"C1":[[1,0]],"C":[[1,0],[0,1]],"D12":[[0.3]]}"#,
    );
    let plots = folder.path().join("plots");
    for option in [
        &["--plots", text(&plots)][..],
        &["--at", "run:1 s"],
        &["--table"],
        &["--no-margins"],
        &["--no-closed-loop"],
        &["--allow-unphysical"],
    ] {
        let output = run_orchestrator(&[&["tune", text(&file)], option].concat());
        assert_eq!(output.code, Some(2), "{output:?}");
        for part in [option[0], "plant.json", "specification"] {
            assert!(output.err.contains(part), "`{part}` is not in {output:?}");
        }
    }
    assert!(!plots.exists());
    // Nor can the result, gains without provenance or a specification be verified.
    let out = folder.path().join("gains.json");
    let output = run_orchestrator(&["tune", text(&file), "--starts", "2", "--out", text(&out)]);
    assert_eq!(output.code, Some(0), "zero is attained: {output:?}");
    for (file, part) in [
        (&out, "this is JSON"),
        (&root().join("gains/start.toml"), "no table `provenance`"),
        (&root().join("gains/p-diagonal.spec.toml"), "this is a specification"),
    ] {
        let output = run_orchestrator(&["margins", text(file)]);
        assert_eq!(output.code, Some(2), "{output:?}");
        assert!(
            output.err.contains(part) && output.err.contains("only gains that `escapement tune` wrote"),
            "{output:?}"
        );
    }
}

#[test]
fn tune_names_the_line_of_a_wrong_key() {
    let plant = "{\"A\": [[-1]],\n\"B1\": [[1]],\n\"B\": [[1]],\n\"C1\": [[1]],\n\"C\": [[1]]";
    for (extra, expected) in [
        (",\n\"D2l\": [[1]]}", "plant.json:6: D2l: unknown key"),
        (",\n\"ny\": 2}", "plant.json:6: ny: 2 stated"),
        (",\n\"D12\": [[1, 2]]}", "plant.json:6: matrix D12 is 1 x 2"),
    ] {
        let output = tune_matrices(&format!("{plant}{extra}"));
        assert_eq!(output.code, Some(2), "{output:?}");
        assert!(output.err.contains(expected), "{output:?}");
    }
}

/// The output of `check --json` about the velocity loop of a stock scenario, with the given changes.
fn velocity_loop(scenario: &str, sets: &[String]) -> Value {
    let output = check(scenario, sets, true);
    assert_eq!(output.code, Some(0), "{scenario}: {output:?}");
    let output: Value = serde_json::from_str(&output.out).expect("check gives JSON");
    let loops = output["velocity_loops"].as_array().expect("a list of loops");
    assert_eq!(loops.len(), 1, "{scenario}");
    loops[0].clone()
}

fn check(scenario: &str, sets: &[String], json: bool) -> ProgramOutput {
    let file = root().join("scenarios").join(format!("{scenario}.toml"));
    let mut arguments = vec!["check", text(&file)];
    arguments.extend(json.then_some("--json"));
    arguments.extend(sets.iter().flat_map(|set| ["--set", set.as_str()]));
    run_orchestrator(&arguments)
}

fn numbers(value: &Value) -> Vec<f64> {
    let list = value.as_array().expect("a list");
    list.iter().map(|one| one.as_f64().expect("a number")).collect()
}

/// A delay of ten milliseconds before the controller and of ten after it, for which the stock gains are tuned.
fn delays() -> Vec<String> {
    ["measured", "command"]
        .map(|link| format!("connections.{link}.delay=10ms"))
        .into()
}

/// The number of samples in transit is the order of the sampled loop, so a long delay would take the memory and the time of its eigenvalues.
#[test]
fn velocity_loop_with_a_long_delay_is_not_analysed() {
    let output = check("close", &["connections.command.delay=\"60 s\"".to_owned()], false);
    assert_eq!(output.code, Some(0), "{output:?}");
    let expected =
        "participants.controller.parameters.gains: the stability of the velocity loop is not analysed: 60.0 s of delay";
    assert!((output.out + &output.err).contains(expected), "{expected}");
}

/// Every stock scenario flies gains that are stable with the stated margin at the start, when pointing and at the grasp, with
/// the delays it has; and with those for which the gains were tuned.
#[test]
fn stock_velocity_loops_have_the_stated_margin() {
    let mut seen = 0;
    for entry in std::fs::read_dir(root().join("scenarios")).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_stem().unwrap().to_str().unwrap().to_owned();
        for sets in [Vec::new(), delays()] {
            let found = velocity_loop(&name, &sets);
            let configurations = found["configurations"].as_array().unwrap();
            let names: Vec<&str> = configurations.iter().filter_map(|one| one["name"].as_str()).collect();
            assert_eq!(names, ["start", "pointing", "grasp"], "{name}");
            for one in configurations {
                for radius in ["spectral_radius", "with_larger_gains", "with_more_delay"] {
                    assert!(one[radius].as_f64().unwrap() < 1.0, "{name} {sets:?}: {one}");
                }
            }
            let output = check(&name, &sets, false);
            assert!(!output.err.contains("velocity loop"), "{name}: {output:?}");
            seen += 1;
        }
    }
    assert!(seen >= 30);
}

/// The configurations that `check` predicts are those of the recorded simulations, which the gains file has.
#[test]
fn check_predicts_the_joints_at_the_grasp() {
    let file = std::fs::read_to_string(root().join("gains/pi-diagonal.toml")).unwrap();
    let file: toml::Table = file.parse().unwrap();
    for (scenario, model) in [("close", "close grasp"), ("far", "far grasp")] {
        let models = file["models"].as_array().unwrap();
        let simulated = models.iter().find(|one| one["name"].as_str() == Some(model)).unwrap();
        let simulated = simulated["joints_deg"]
            .as_array()
            .unwrap()
            .iter()
            .filter_map(toml::Value::as_float);
        let found = velocity_loop(scenario, &[]);
        let predicted = numbers(&found["configurations"][2]["joints_deg"]);
        let far = simulated.zip(predicted).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(far < 0.3, "{scenario}: {far} deg");
    }
}

/// Gains that are stable at the start and not at the grasp cause a warning for the grasp, from `check` and from `run`.
#[test]
fn gains_unstable_at_the_grasp_are_warned_of() {
    let folder = Folder::new("unstable");
    let mut file: toml::Table = std::fs::read_to_string(root().join("gains/pi-diagonal.toml"))
        .unwrap()
        .parse()
        .unwrap();
    let kp = file["gains"]["kp"].as_array_mut().unwrap();
    for gain in kp {
        *gain = (2.0 * gain.as_float().unwrap()).into();
    }
    let gains = folder.write("gains.toml", &file.to_string());
    let mut sets = delays();
    sets.push(format!(
        "participants.controller.parameters.gains={{ file = {:?} }}",
        text(&gains)
    ));
    let warned = check("far", &sets, false);
    assert_eq!(warned.code, Some(0), "{warned:?}");
    for words in [
        "warning",
        "velocity loop is unstable at the grasp",
        "10.0 ms of delay",
        "joints_deg = [8.0",
    ] {
        assert!(warned.err.contains(words), "{words}: {warned:?}");
    }
    let found = velocity_loop("far", &sets);
    assert!(found["configurations"][0]["spectral_radius"].as_f64().unwrap() < 1.0);
    let scenario = root().join("scenarios/far.toml");
    let out = folder.path().join("run");
    let mut arguments = vec![
        "run",
        text(&scenario),
        "--in-process",
        "--duration",
        "10ms",
        "--out",
        text(&out),
    ];
    arguments.extend(sets.iter().flat_map(|set| ["--set", set.as_str()]));
    let run = run_orchestrator(&arguments);
    assert!(run.err.contains("unstable at the grasp"), "{run:?}");
}

/// `at` of a specification and `--at` take the configuration from a recorded run, and the file of gains keeps it.
#[test]
fn tune_takes_a_configuration_from_a_run() {
    let folder = Folder::new("at");
    let run = folder.path().join("run");
    let scenario = root().join("scenarios/close.toml");
    let joints = "participants.plant.parameters.start.joints=\"[10, 20, 30, 40, 50, 60, 70] deg\"";
    let arguments = [
        "run",
        text(&scenario),
        "--in-process",
        "--duration",
        "20ms",
        "--set",
        joints,
        "--out",
        text(&run),
    ];
    // The approach fails because the time is too short; only the tape is needed.
    let output = run_orchestrator(&arguments);
    assert!(run.join("tape").exists(), "{output:?}");
    let stock = std::fs::read_to_string(root().join("gains/p-diagonal.spec.toml")).unwrap();
    let (head, rest) = stock.split_once("[[models]]").unwrap();
    let (_, tail) = rest.split_once("[search]").unwrap();
    let tail = tail
        .split_once("[closed_loop]")
        .unwrap()
        .0
        .replace("starts = 2", "starts = 1\niterations = 2\nfinishing = 1\nrounds = 1");
    let head = head.replace("models/servicer.urdf", text(&root().join("models/servicer.urdf")));
    let tuned = |at: &str, more: &[&str]| {
        let spec = format!("{head}[[models]]\nname = \"here\"\n{at}\n\n[search]{tail}");
        let spec = folder.write("here.spec.toml", &spec);
        let mut arguments = vec!["tune", text(&spec), "--no-margins", "--no-closed-loop"];
        arguments.extend(more);
        run_orchestrator(&arguments)
    };
    let place = format!("{}:10ms", text(&run));
    let key = format!("at = {place:?}");
    for (at, more) in [
        (key.as_str(), vec![]),
        ("joints_deg = [0, 0, 0, 0, 0, 0, 0]", vec!["--at", place.as_str()]),
    ] {
        let output = tuned(at, &more);
        assert_eq!(output.code, Some(0), "{output:?}");
        let file: toml::Table = std::fs::read_to_string(folder.path().join("here.toml"))
            .unwrap()
            .parse()
            .unwrap();
        let model = &file["models"][0];
        let joints = model["joints_deg"]
            .as_array()
            .unwrap()
            .iter()
            .filter_map(toml::Value::as_float);
        let far = joints
            .zip([10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0])
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f64::max);
        assert!(far < 0.02, "{model:?}");
        assert_eq!(model["at"].as_str(), Some(place.as_str()));
    }
    for (at, expected) in [
        ("", ["\"here\"", "give joints_deg, or at"]),
        (
            "joints_deg = [0, 0, 0, 0, 0, 0, 0]\nat = \"x:1s\"",
            ["both given", "leave one of them out"],
        ),
        (
            "at = \"runs/nowhere:1s\"",
            ["runs/nowhere", "no such run folder or scenario"],
        ),
        (&format!("at = \"{}:5s\"", text(&run)), ["ends at 0.02", "before 5 s"]),
        (&format!("at = \"{}\"", text(&run)), ["no instant", "RUN:TIME"]),
    ] {
        let output = tuned(at, &[]);
        assert_eq!(output.code, Some(2), "{at}: {output:?}");
        let found = expected.iter().all(|words| output.err.contains(words));
        assert!(found, "{at}: {output:?}");
    }
}
