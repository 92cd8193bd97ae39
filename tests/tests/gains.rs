//! Tuned gains as their user sees them: recomputed, flown, and contradicted.

use escapement_tests::program::{Folder, orchestrate, root, text};

/// `margins` on the stock P gains with a specification whose flights ask for this base rate at the end.
fn flown(rate: &str) -> escapement_tests::program::Said {
    let folder = Folder::new("flown");
    let absolute = |text: String| text.replace("../", &format!("{}/", root().display()));
    let scenario = std::fs::read_to_string(root().join("gains/flight.toml")).unwrap();
    let stock = "base_rate_at_end = \"0.02 deg/s\"";
    assert!(scenario.contains(stock));
    let scenario = absolute(scenario)
        .replace(stock, &format!("base_rate_at_end = \"{rate}\""))
        .replace("file = \"pi", &format!("file = \"{}/gains/pi", root().display()))
        .replace("duration = \"20 s\"", "duration = \"12 s\"")
        .replace("grasp_at = \"20 s\"", "grasp_at = \"12 s\"");
    let scenario = folder.write("flight.toml", &scenario);
    let specification = std::fs::read_to_string(root().join("gains/p-diagonal.spec.toml")).unwrap();
    let specification = specification
        .replace("gains/flight.toml", text(&scenario))
        .replace("models/servicer.urdf", text(&root().join("models/servicer.urdf")))
        .replace("delays_s = [0.0, 0.005, 0.01, 0.02]", "delays_s = [0.01]");
    let specification = folder.write("p.spec.toml", &specification);
    let gains = root().join("gains/p-diagonal.toml");
    orchestrate(&["margins", text(&gains), "--spec", text(&specification), "--models", "0"])
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
