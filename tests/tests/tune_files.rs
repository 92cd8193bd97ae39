//! The files of `tune` and `margins`: what is refused before a search, what is warned of, and what is never written over.

use std::path::PathBuf;

use escapement_tests::program::{Folder, ProgramOutput, root, run_orchestrator, text};
use serde_json::Value;

const PLANT: &str =
    r#"{"A":[[0,1],[2,-0.4]],"B1":[[0],[1]],"B":[[0],[1]],"C1":[[1,0]],"C":[[1,0],[0,1]],"D12":[[0.3]]}"#;

/// A specification of the stock robot with changes, in which the search ends at once.
fn specification(folder: &Folder, changes: &[(&str, &str)]) -> PathBuf {
    let stock = std::fs::read_to_string(root().join("gains/p-diagonal.spec.toml")).unwrap();
    let (head, rest) = stock.split_once("[[models]]").unwrap();
    let (_, tail) = rest.split_once("[search]").unwrap();
    let tail = tail.split_once("[closed_loop]").unwrap().0;
    let tail = tail.replace("starts = 2", "starts = 1\niterations = 1\nfinishing = 1\nrounds = 1");
    let model = "[[models]]\nname = \"here\"\njoints_deg = [0, 40, 0, 80, 0, 40, 0]\n\n";
    let mut spec = format!("{head}{model}[search]{tail}");
    let urdf = root().join("models/servicer.urdf");
    for (stock, new) in [("models/servicer.urdf", text(&urdf))].iter().chain(changes) {
        assert!(spec.contains(stock), "{stock}");
        spec = spec.replace(stock, new);
    }
    folder.write("x.spec.toml", &spec)
}

fn tune(arguments: &[&str]) -> ProgramOutput {
    run_orchestrator(&[&["tune"], arguments].concat())
}

fn check_refused(output: &ProgramOutput, parts: &[&str]) {
    assert_eq!(output.code, Some(2), "{output:?}");
    for part in parts {
        assert!(output.err.contains(part), "`{part}` is not in {output:?}");
    }
}

#[test]
fn tune_writes_over_no_file_that_it_reads() {
    let folder = Folder::new("own-input");
    let plant = folder.write("plant.json", PLANT);
    let link = folder.path().join("link.json");
    std::os::unix::fs::symlink(&plant, &link).unwrap();
    let other_spelling = folder
        .path()
        .join("../")
        .join(folder.path().file_name().unwrap())
        .join("plant.json");
    let (plant, link, other_spelling) = (text(&plant), text(&link), text(&other_spelling));
    for arguments in [
        [plant, "--out", plant],
        [plant, "--export-problem", plant],
        [plant, "--out", link],
        [link, "--out", plant],
        [plant, "--out", other_spelling],
    ] {
        check_refused(
            &tune(&arguments),
            &[arguments[1], "this is also SPEC", "name another file"],
        );
    }
    let new = folder.path().join("new.json");
    let output = tune(&[plant, "--out", text(&new), "--export-problem", text(&new)]);
    check_refused(&output, &["--export-problem", "this is also --out"]);
    assert!(!new.exists());
    assert_eq!(std::fs::read_to_string(plant).unwrap(), PLANT);

    let spec = specification(&folder, &[]);
    check_refused(
        &tune(&[text(&spec), "--out", text(&spec)]),
        &["--out", "this is also SPEC"],
    );
    let gains = folder.path().join("x.toml");
    let output = tune(&[text(&spec), "--export-problem", text(&gains)]);
    check_refused(&output, &["--export-problem", "this is also the file of gains"]);
    let urdf = folder.write(
        "robot.urdf",
        &std::fs::read_to_string(root().join("models/servicer.urdf")).unwrap(),
    );
    let before = std::fs::read_to_string(&urdf).unwrap();
    let spec = specification(&folder, &[(text(&root().join("models/servicer.urdf")), text(&urdf))]);
    let output = tune(&[text(&spec), "--out", text(&urdf)]);
    check_refused(&output, &["--out", "this is also robot.urdf of SPEC"]);
    assert_eq!(std::fs::read_to_string(&urdf).unwrap(), before);
}

#[test]
fn wrong_number_of_a_specification_is_refused_before_the_search() {
    let folder = Folder::new("wrong-numbers");
    for (stock, new, expected) in [
        (
            "multiplicative_low = 0.2",
            "multiplicative_low = -0.2",
            "uncertainty.multiplicative_low = -0.2: must be positive",
        ),
        (
            "multiplicative_cutoff_rad_s = 30.0",
            "multiplicative_cutoff_rad_s = 0",
            "uncertainty.multiplicative_cutoff_rad_s = 0",
        ),
        (
            "parametric = 0.1",
            "parametric = 2.0",
            "uncertainty.parametric = 2: must be above 0 and below 1",
        ),
        (
            "parametric = 0.1",
            "parametric = 0",
            "uncertainty.parametric = 0: must be above 0",
        ),
        (
            "controller_period_s = 0.01",
            "controller_period_s = 0",
            "sampling.controller_period_s = 0: a period must be positive",
        ),
        (
            "plant_period_s = 0.001",
            "plant_period_s = -0.001",
            "sampling.plant_period_s = -0.001: a period must be positive",
        ),
        (
            "plant_period_s = 0.001",
            "plant_period_s = 0.003",
            "sampling.controller_period_s = 0.01: must be a whole multiple",
        ),
        (
            "starts = 1",
            "starts = 0",
            "search.starts = 0: at least one start is needed",
        ),
    ] {
        let spec = specification(&folder, &[(stock, new)]);
        let output = tune(&[text(&spec), "--no-margins", "--no-closed-loop"]);
        check_refused(&output, &["x.spec.toml: line ", expected]);
        assert!(!folder.path().join("x.toml").exists());
    }
    let plant = folder.write("plant.json", PLANT);
    check_refused(
        &tune(&[text(&plant), "--starts", "0"]),
        &["--starts 0", "write 1 or more"],
    );
    check_refused(
        &tune(&[text(&specification(&folder, &[])), "--starts", "0"]),
        &["--starts 0"],
    );
}

#[test]
fn doubtful_specification_is_warned_of() {
    let folder = Folder::new("doubts");
    let warnings = |changes: &[(&str, &str)]| {
        let spec = specification(&folder, changes);
        let output = tune(&[text(&spec), "--no-margins", "--no-closed-loop", "--seed", "1"]);
        assert!(matches!(output.code, Some(0 | 3)), "{output:?}");
        let lines = output.err.lines().filter(|line| line.contains("warning: "));
        lines.map(String::from).collect::<Vec<_>>()
    };
    assert_eq!(warnings(&[]), [""; 0]);
    for (change, expected) in [
        (
            ("[0, 40, 0, 80, 0, 40, 0]", "[0, 121, 0, 80, 0, 40, 0]"),
            ["\"here\"", "121 for the joint `A2`"],
        ),
        (
            ("[0, 40, 0, 80, 0, 40, 0]", "[0, 40, 0, 80, 0, 40, -180]"),
            ["\"here\"", "-180 for the joint `A7`"],
        ),
        (("\"link_7\", ", ""), ["`link_7`", "robot.arm_links"]),
    ] {
        let found = warnings(&[change]);
        assert_eq!(found.len(), 1, "{found:?}");
        for part in expected {
            assert!(
                found[0].contains(part) && found[0].contains("x.spec.toml: "),
                "{found:?}"
            );
        }
    }
}

#[test]
fn margins_name_the_wrong_gain_and_its_file() {
    let folder = Folder::new("wrong-gains");
    let changed = |stock: &str, change: &dyn Fn(&str) -> String| {
        let gains = std::fs::read_to_string(root().join("gains").join(stock)).unwrap();
        let file = folder.write("wrong.toml", &change(&gains));
        run_orchestrator(&["margins", text(&file), "--models", "0", "--no-closed-loop"])
    };
    for (stock, from, to, expected) in [
        (
            "p-diagonal.toml",
            "\nkp = [",
            "\nkp = [1.0, ",
            "gains.kp has 14 entries, the robot has 13 channels",
        ),
        ("p-diagonal.toml", "\nkp = [", "\nkp = [-", "a gain must be positive"),
        (
            "p-diagonal.toml",
            "\nkp = [",
            "\nki = [1.0]\nkp = [",
            "gains.ki = 1: the specification has no integral part",
        ),
        (
            "pi-diagonal.toml",
            "\nki = [",
            "\nki = [1.0, ",
            "gains.ki has 14 entries",
        ),
        (
            "pi-full.toml",
            "kp_matrix = [[",
            "kp_matrix = [[-",
            "least eigenvalue = -",
        ),
        (
            "pi-full.toml",
            "kp_matrix = [[",
            "kp_matrix = [[1.0, ",
            "a row of gains.kp_matrix has 14 entries",
        ),
        ("pi-full.toml", "], [-", "], [", "the matrix is not symmetric"),
    ] {
        let output = changed(stock, &|gains| {
            assert!(gains.contains(from), "{stock}: {from}");
            gains.replacen(from, to, 1)
        });
        check_refused(&output, &["wrong.toml: line ", expected]);
    }
}

#[test]
fn peak_at_infinity_is_null_and_starts_are_numbers() {
    let folder = Folder::new("infinite-peak");
    let plant = folder.write(
        "plant.json",
        r#"{"A":[[-1]],"B1":[[1]],"B":[[1]],"C1":[[-1]],"C":[[1]],"D11":[[5]]}"#,
    );
    let export = folder.path().join("problem.json");
    let output = tune(&[
        text(&plant),
        "--starts",
        "2",
        "--json",
        "--export-problem",
        text(&export),
    ]);
    let found: Value = serde_json::from_str(&output.out).unwrap();
    assert_eq!(found["gamma"], 5.0, "{output:?}");
    assert_eq!(found["peak_rad_s"], Value::Null, "{output:?}");
    let starts = found["starts"].as_array().unwrap();
    assert!(!starts.is_empty() && starts.iter().all(Value::is_number), "{output:?}");
    let exported: Value = serde_json::from_str(&std::fs::read_to_string(export).unwrap()).unwrap();
    assert_eq!(exported["models"][0]["channels"][0]["omega_rad_s"], Value::Null);
}

/// The page about an own plant shows what the program prints for the page's file, to the last digit.
#[test]
fn page_shows_the_output_of_its_plant() {
    let page = std::fs::read_to_string(root().join("docs/synthesis/own-plant.md")).unwrap();
    let (_, rest) = page.split_once("```json\n").unwrap();
    let (plant, rest) = rest.split_once("```").unwrap();
    let (_, rest) = rest.split_once("    escapement tune my-plant.json\n").unwrap();
    let shown: Vec<&str> = rest.lines().map_while(|line| line.strip_prefix("    ")).collect();
    let folder = Folder::new("page-plant");
    let plant = folder.write("my-plant.json", plant);
    let output = tune(&[text(&plant)]);
    assert_eq!(output.code, Some(0), "{output:?}");
    assert_eq!(output.out.lines().collect::<Vec<_>>(), shown);
}
