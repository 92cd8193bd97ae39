//! Tuned gains as their user sees them: recomputed, flown, and contradicted.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use escapement_tests::machine::signal;
use escapement_tests::program::{Folder, finish, orchestrate, root, start, text};

/// The specification of the stock P gains with one flight of this title, length and criterion.
fn specification(folder: &Folder, title: &str, length: &str, rate: &str) -> PathBuf {
    let mut scenario = std::fs::read_to_string(root().join("gains/flight.toml")).unwrap();
    for (stock, new) in [
        ("\"Hold the end effector after a push\"", format!("\"{title}\"")),
        (
            "base_rate_at_end = \"0.02 deg/s\"",
            format!("base_rate_at_end = \"{rate}\""),
        ),
        ("duration = \"20 s\"", format!("duration = \"{length}\"")),
        ("grasp_at = \"20 s\"", format!("grasp_at = \"{length}\"")),
        ("../", format!("{}/", root().display())),
        ("file = \"pi", format!("file = \"{}/gains/pi", root().display())),
    ] {
        assert!(scenario.contains(stock), "{stock}");
        scenario = scenario.replace(stock, &new);
    }
    let scenario = folder.write("flight.toml", &scenario);
    let specification = std::fs::read_to_string(root().join("gains/p-diagonal.spec.toml")).unwrap();
    let specification = specification
        .replace("gains/flight.toml", text(&scenario))
        .replace("models/servicer.urdf", text(&root().join("models/servicer.urdf")))
        .replace("delays_s = [0.0, 0.005, 0.01, 0.02]", "delays_s = [0.01]");
    folder.write("p.spec.toml", &specification)
}

fn margins(specification: &Path) -> [String; 6] {
    let gains = root().join("gains/p-diagonal.toml");
    ["margins", text(&gains), "--spec", text(specification), "--models", "0"].map(String::from)
}

/// `margins` on the stock P gains with a specification whose flights ask for this base rate at the end.
fn flown(rate: &str) -> escapement_tests::program::Said {
    let folder = Folder::new("flown");
    let arguments = margins(&specification(&folder, "a push", "12 s", rate));
    orchestrate(&arguments.each_ref().map(String::as_str))
}

/// A flight that misses its criteria although the sampled loop is stable ends with 3, and says which.
#[test]
fn a_flight_that_contradicts_the_linear_claim_is_told() {
    let settled = flown("0.1 deg/s");
    assert_eq!(settled.code, Some(0), "{settled:?}");
    assert!(settled.out.contains("10 + 10"), "{settled:?}");
    let contradicted = flown("1e-9 deg/s");
    assert_eq!(contradicted.code, Some(3), "{contradicted:?}");
    assert!(
        contradicted.err.contains("the sampled loop is stable") && contradicted.err.contains("does not settle"),
        "{contradicted:?}"
    );
}

/// Who is killed in the middle of a flight leaves its folder where `doctor` finds it.
#[test]
fn what_a_killed_flight_leaves_is_removed() {
    let doctor = orchestrate(&["doctor"]);
    let line = doctor
        .out
        .lines()
        .find_map(|line| line.strip_prefix("runs keep their files under "));
    let base = PathBuf::from(line.expect("doctor says where runs keep their files"));
    let folder = Folder::new("killed-flight");
    let title = format!("a flight to be killed {}", std::process::id());
    let arguments = margins(&specification(&folder, &title, "100000 s", "1 deg/s"));
    let child = start(&arguments.each_ref().map(String::as_str));
    let started = Instant::now();
    let left = loop {
        let entries = std::fs::read_dir(&base).into_iter().flatten().flatten();
        let mut flights = entries.map(|entry| entry.path());
        let ours = flights.find(|run| {
            let plan = std::fs::read_to_string(run.join("scratch/flight/plan.toml"));
            plan.is_ok_and(|plan| plan.contains(&title))
        });
        if let Some(ours) = ours {
            break ours;
        }
        assert!(
            started.elapsed() < Duration::from_secs(60),
            "no flight under {}",
            base.display()
        );
        std::thread::sleep(Duration::from_millis(5));
    };
    // While it lives nobody takes it away.
    assert_eq!(orchestrate(&["doctor", "--remove"]).code, Some(0));
    assert!(left.exists());
    let on_disk = left.join("scratch").canonicalize().expect("what is large is on disk");
    signal(child.id(), rustix::process::Signal::KILL);
    assert_eq!(finish(child).code, None);
    assert_eq!(orchestrate(&["doctor", "--remove"]).code, Some(0));
    for left in [left, on_disk] {
        assert!(!left.exists(), "{} is left", left.display());
    }
}

/// `tune` on plain matrices: exit code and message.
fn tune_matrices(json: &str) -> escapement_tests::program::Said {
    let folder = Folder::new("tune-matrices");
    let file = folder.write("plant.json", json);
    orchestrate(&["tune", text(&file), "--starts", "2"])
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
        let said = tune_matrices(json);
        assert_eq!(said.code, Some(3), "{said:?}");
        assert!(
            said.err.contains("warning: ") && said.err.contains(expected),
            "{said:?}"
        );
        assert!(said.out.contains("gamma"), "{said:?}");
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
        let said = tune_matrices(&format!("{plant}{extra}"));
        assert_eq!(said.code, Some(2), "{said:?}");
        assert!(said.err.contains(expected), "{said:?}");
    }
}
