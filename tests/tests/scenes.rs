//! `[scene]`: mistakes are rejected before anything runs; the playback is in the page of any run.

use escapement_tests::program::{Folder, root, run_orchestrator, text};

const SCENARIO: &str = r##"title = "Two springs that are drawn"
duration = "2 s"

[participants.blue]
run = { exe = "SPRING" }
period = "1 ms"
parameters = { position = 0.1 }

[participants.red]
run = { exe = "SPRING" }
period = "2.5 ms"
parameters = { position = 0.0 }

[connections.there]
from = "blue.motion"
to = "red.neighbour"

[connections.back]
from = "red.motion"
to = "blue.neighbour"
initial = "first-sample"

[scene]
camera = { at = "[0, -1, 0.3] m", towards = "first" }

[scene.bodies.first]
position = ["blue.motion.position", 0, 0]
shape = { box = ["5 cm", "5 cm", "5 cm"] }
colour = "#3366cc"

[scene.bodies.second]
position = ["20 cm", "red.motion.position", 0]
shape = [{ sphere = "3 cm" }, { urdf = { file = "flag.urdf" } }, { path = "1 s" }]
"##;

const FLAG: &str = r#"<robot name="flag"><link name="pole"><visual><geometry><box size="0.01 0.01 0.2"/></geometry></visual></link></robot>"#;

fn write_scenario(folder: &Folder, name: &str, scenario: &str) -> String {
    folder.write("flag.urdf", FLAG);
    let spring = escapement_tests::program::spring();
    let path = folder.write(name, &scenario.replace("SPRING", text(&spring)));
    text(&path).to_owned()
}

#[test]
fn invalid_scene_is_refused_with_line_key_value_and_remedy() {
    let folder = Folder::new("scene-refusals");
    let good = write_scenario(&folder, "good.toml", SCENARIO);
    let output = run_orchestrator(&["check", &good]);
    assert_eq!(output.code, Some(0), "{output:?}");
    for (from, to, expected) in [
        (
            "\"blue.motion.position\", 0",
            "\"blue.motion.place\", 0",
            "wrong.toml:27: scene.bodies.first.position: `blue.motion` has no field or element `place`; it has `position`, `velocity`",
        ),
        (
            "\"blue.motion.position\", 0",
            "\"blue.motion.velocity\", 0",
            "wrong.toml:27: scene.bodies.first.position: `blue.motion.velocity` is in `m/s`, and a component of a position needs a unit such as `m`",
        ),
        (
            "[\"blue.motion.position\", 0, 0]",
            "\"blue.motion.position\"",
            "wrong.toml:27: scene.bodies.first.position: `blue.motion.position` has one element, and a position",
        ),
        (
            "\"red.motion.position\", 0]",
            "\"green.motion.position\", 0]",
            "scene.bodies.second.position: there is no participant `green`",
        ),
        (
            "towards = \"first\"",
            "towards = \"third\"",
            "wrong.toml:24: scene.camera.towards: the scene has no body `third`; it has `first`, `second`",
        ),
        (
            "\"#3366cc\"",
            "\"blue\"",
            "wrong.toml:29: scene.bodies.first.colour: `blue` is not a colour: write red, green and blue in hexadecimal",
        ),
        (
            "\"flag.urdf\"",
            "\"flags.urdf\"",
            "scene.bodies.second.shape.2.urdf: the file",
        ),
        (
            "{ sphere = \"3 cm\" }",
            "{ sphere = \"3 kg\" }",
            "scene.bodies.second.shape.1.sphere: `3 kg`",
        ),
        (
            "{ path = \"1 s\" }",
            "{ path = \"1 s\", joints = \"a.b.c\" }",
            "a `path` has no key `joints`; it may have dashed, label, colour",
        ),
    ] {
        let changed = SCENARIO.replace(from, to);
        assert_ne!(changed, SCENARIO, "{from}");
        let wrong = write_scenario(&folder, "wrong.toml", &changed);
        let output = run_orchestrator(&["check", &wrong]);
        assert_eq!(output.code, Some(2), "{to}: {output:?}");
        assert!(
            output.err.contains(expected),
            "{to}: `{expected}` is not in\n{}",
            output.err
        );
    }
}

/// The data in the page for its script.
fn page_data(page: &str) -> serde_json::Value {
    let (_, rest) = page
        .split_once("<script type=\"application/json\" id=\"data\">")
        .expect("the page has data");
    let (data, _) = rest.split_once("</script>").expect("they end");
    serde_json::from_str(data).expect("they are JSON")
}

#[test]
fn page_has_the_scene_and_a_model_replaces_a_body() {
    let folder = Folder::new("scene-page");
    let scenario = write_scenario(&folder, "good.toml", SCENARIO);
    let run = folder.path().join("run");
    let output = run_orchestrator(&["run", &scenario, "--quiet", "--out", text(&run)]);
    assert_eq!(output.code, Some(0), "{output:?}");
    let page = folder.path().join("page.html");
    let report = |more: &[&str]| run_orchestrator(&[&["report", text(&run), "--out", text(&page)], more].concat());
    assert_eq!(report(&[]).code, Some(0));
    let shown = page_data(&std::fs::read_to_string(&page).unwrap());
    let scene = &shown["runs"][0]["scene"];
    assert_eq!(scene["bodies"][0]["name"], "first");
    assert_eq!(
        scene["bodies"][1]["models"].as_array().map(Vec::len),
        Some(2),
        "the sphere and the file"
    );
    assert_eq!(scene["cameras"][0]["follow"], 0);
    assert_eq!(shown["runs"][0]["motion"]["channels"].as_array().map(Vec::len), Some(2));

    let flag = folder.path().join("flag.urdf");
    assert_eq!(report(&["--model", &format!("first={}", text(&flag))]).code, Some(0));
    let shown = page_data(&std::fs::read_to_string(&page).unwrap());
    assert_eq!(
        shown["runs"][0]["scene"]["bodies"][0]["models"][0]["links"][0]["name"],
        "pole"
    );
    for (model, expected) in [
        (
            format!("third={}", text(&flag)),
            "the scene has no body `third`; it has `first`, `second`",
        ),
        (format!("first={scenario}"), "the model is not XML"),
        ("first=nowhere.urdf".to_owned(), "nowhere.urdf: cannot read the model"),
        ("nowhere.urdf".to_owned(), "write the body and its file as BODY=URDF"),
    ] {
        let output = report(&["--model", &model]);
        assert_eq!(output.code, Some(2), "{model}: {output:?}");
        assert!(output.err.contains(expected), "{model}: {}", output.err);
    }
}

/// A scenario without a scene has no playback, whatever its fields are called.
#[test]
fn run_without_a_scene_has_no_playback() {
    let folder = Folder::new("scene-none");
    let run = folder.path().join("run");
    let spring = root().join("examples/spring/spring.toml");
    let output = run_orchestrator(&[
        "run",
        text(&spring),
        "--quiet",
        "--duration",
        "1 s",
        "--out",
        text(&run),
    ]);
    assert_eq!(output.code, Some(0), "{output:?}");
    let page = folder.path().join("page.html");
    assert_eq!(
        run_orchestrator(&["report", text(&run), "--out", text(&page)]).code,
        Some(0)
    );
    let shown = page_data(&std::fs::read_to_string(&page).unwrap());
    assert_eq!(shown["runs"][0]["scene"], serde_json::Value::Null);
    let output = run_orchestrator(&["report", text(&run), "--model", "cart=models/cart.urdf"]);
    assert!(output.err.contains("cart.urdf"), "{output:?}");
}
