//! Third-party robot descriptions, through the program: warnings and mistakes have file and line.

use escapement_tests::program::{Folder, root, run_orchestrator, text};

const HULL: &str = r#"<link name="hull"><inertial><mass value="10"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>"#;

fn robot(more: &str) -> String {
    format!("<robot name=\"bench\">\n{HULL}\n{more}\n</robot>\n")
}

fn arm(moments: &str, more: &str) -> String {
    format!(
        "<link name=\"arm\"><inertial><mass value=\"1\"/><inertia {moments} ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial></link>\n\
         <joint name=\"hinge\" type=\"continuous\"><parent link=\"hull\"/><child link=\"arm\"/>{more}</joint>"
    )
}

#[test]
fn model_warns_of_friction_with_file_and_line() {
    let folder = Folder::new("models");
    let body = arm(
        "ixx=\"1\" iyy=\"1\" izz=\"1\"",
        "<dynamics damping=\"1\" friction=\"0.5\"/>",
    );
    let file = folder.write("bench.urdf", &robot(&body));
    let output = run_orchestrator(&["model", text(&file)]);
    assert_eq!(output.code, Some(0), "{output:?}");
    assert!(
        output
            .err
            .contains("bench.urdf:4: joint `hinge`: friction=\"0.5\" is not modelled"),
        "{}",
        output.err
    );
    assert!(output.out.contains("1 moving joints"), "{}", output.out);
}

#[test]
fn model_command_reports_all_errors_or_accepts_them() {
    let folder = Folder::new("models");
    let body = arm("ixx=\"1\" iyy=\"1\" izz=\"3\"", "")
        + "\n"
        + &arm("ixx=\"-1\" iyy=\"1\" izz=\"1\"", "")
            .replace("arm", "leg")
            .replace("hinge", "hip");
    let file = folder.write("bench.urdf", &robot(&body));
    let output = run_orchestrator(&["model", text(&file)]);
    assert_ne!(output.code, Some(0));
    assert!(
        output.err.contains("bench.urdf:3: link `arm`") && output.err.contains("bench.urdf:5: link `leg`"),
        "{}",
        output.err
    );
    assert!(output.err.contains("--allow-unphysical"), "{}", output.err);
    let only = folder.write("flat.urdf", &robot(&arm("ixx=\"1\" iyy=\"1\" izz=\"3\"", "")));
    let output = run_orchestrator(&["model", text(&only), "--allow-unphysical"]);
    assert_eq!(output.code, Some(0), "{output:?}");
    assert!(
        output.err.contains("warning: ") && output.err.contains("flat.urdf:3: link `arm`"),
        "{}",
        output.err
    );
}

#[test]
fn misspelt_key_of_a_state_is_refused() {
    let folder = Folder::new("models");
    let model = folder.write("bench.urdf", &robot(&arm("ixx=\"1\" iyy=\"1\" izz=\"1\"", "")));
    let evaluate = |state: &str| run_orchestrator(&["model", text(&model), text(&folder.write("state.json", state))]);
    let good = evaluate(r#"{"qj": [0.1], "v": [0.2], "tau": [3]}"#);
    assert_eq!(good.code, Some(0), "{good:?}");
    let misspelt = evaluate(r#"{"qj": [0.1], "v": [0.2], "taw": [3]}"#);
    assert_eq!(misspelt.code, Some(2), "{misspelt:?}");
    for part in ["state.json", "state 0", "`taw`", "`tau`"] {
        assert!(misspelt.err.contains(part), "`{part}` is not in {misspelt:?}");
    }
}

#[test]
fn unexpanded_macro_is_refused_and_not_a_robot_without_arm() {
    let folder = Folder::new("models");
    let file = folder.write("bench.urdf", &robot("<xacro:arm prefix=\"left\"/>"));
    let output = run_orchestrator(&["model", text(&file)]);
    assert_ne!(output.code, Some(0));
    assert!(
        output.err.contains("bench.urdf:3: <xacro:arm> is not expanded"),
        "{}",
        output.err
    );
}

#[test]
fn scenario_check_warns_of_unmodelled_parts_of_its_robot() {
    let folder = Folder::new("models");
    let stock = std::fs::read_to_string(root().join("models/servicer.urdf")).unwrap();
    let rough = stock.replacen("friction=\"0\"", "friction=\"0.5\"", 1);
    assert_ne!(rough, stock);
    let file = folder.write("rough.urdf", &rough);
    let scenario = std::fs::read_to_string(root().join("scenarios/close.toml")).unwrap();
    let scenario = scenario
        .replace("../models/servicer.urdf", text(&file))
        .replace("\"../", &format!("\"{}/", root().display()));
    let scenario = folder.write("rough.toml", &scenario);
    let output = run_orchestrator(&["check", text(&scenario)]);
    assert_eq!(output.code, Some(0), "{output:?}");
    let warned = output.err.matches("friction=\"0.5\" is not modelled").count();
    assert_eq!(
        warned, 1,
        "once for the file, not for each participant that reads it: {}",
        output.err
    );
}
