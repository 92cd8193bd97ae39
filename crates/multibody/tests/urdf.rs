//! Accepted and rejected URDF content; every error names the offending element and the remedy.

mod common;

use common::servicer;
use multibody::{Description, JointKind, Tree, TreeError};
use nalgebra::Vector3;

/// A base, one moving link, one joint; pieces of it replaced by the tests.
const PLAIN: &str = r#"<robot name="r">
  <link name="base"><inertial><mass value="10"/>
    <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
  <link name="arm"><inertial><origin xyz="0 0 0.2"/><mass value="2"/>
    <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.02"/></inertial></link>
  <joint name="hinge" type="revolute"><parent link="base"/><child link="arm"/>
    <axis xyz="0 1 0"/></joint>
</robot>"#;

fn refused(from: &str, to: &str) -> String {
    assert!(PLAIN.contains(from), "the test replaces {from:?}");
    let text = PLAIN.replace(from, to);
    Description::from_urdf(&text)
        .err()
        .unwrap_or_else(|| panic!("{to:?} was accepted"))
        .to_string()
}

fn check(from: &str, to: &str, words: &[&str]) {
    let message = refused(from, to);
    for word in words {
        assert!(message.contains(word), "{message:?} does not say {word:?}");
    }
}

#[test]
fn valid_description_is_accepted() {
    let d = Description::from_urdf(PLAIN).expect("valid");
    assert_eq!((d.dof(), d.links.len(), d.joints[0].kind), (1, 2, JointKind::Revolute));
}

const REVOLUTE: &str = r#"type="revolute""#;
const AXIS: &str = r#"<axis xyz="0 1 0"/>"#;

/// Text to replace, its replacement, and words of the error.
const REFUSED: [(&str, &str, &[&str]); 23] = [
    (
        REVOLUTE,
        r#"type="planar""#,
        &[
            "`hinge`",
            "`planar`",
            "revolute, continuous, prismatic or fixed",
            "line 6",
        ],
    ),
    (REVOLUTE, r#"type="floating""#, &["`hinge`", "`floating`"]),
    (
        AXIS,
        r#"<axis xyz="0 0 0"/>"#,
        &["`hinge`", "[0 0 0]", "non-zero length"],
    ),
    (
        AXIS,
        r#"<axis xyz="0 1"/>"#,
        &["`hinge`", "xyz=\"0 1\"", "three finite numbers", "line 7"],
    ),
    (
        AXIS,
        r#"<axis xyz="0 1 0"/><mimic joint="other"/>"#,
        &["`hinge`", "mimic"],
    ),
    (
        r#"<mass value="2"/>"#,
        r#"<mass value="-2"/>"#,
        &["`arm`", "-2", "negative"],
    ),
    (
        AXIS,
        r#"<axis xyz="0 1 0"/><limit lower="-3" upper="-4"/>"#,
        &["line 6", "`hinge`", "lower=\"-3\"", "upper=\"-4\""],
    ),
    (
        r#"<mass value="2"/>"#,
        r#"<mass value="0"/>"#,
        &["`arm`", "mass is zero", "1e-1 kg m²", "set both to zero"],
    ),
    (
        r#"<mass value="10"/>"#,
        r#"<mass value="0"/>"#,
        &["`base`", "mass is zero", "1e0 kg m²"],
    ),
    (
        r#"<mass value="2"/>"#,
        r#"<mass value="heavy"/>"#,
        &["`arm`", "heavy", "finite number"],
    ),
    (
        r#"<mass value="2"/>"#,
        r#"<mass value="nan"/>"#,
        &["`arm`", "nan", "finite number"],
    ),
    (r#"<mass value="2"/>"#, "", &["`arm`", "<mass>", "missing"]),
    (r#"izz="0.02""#, r#"izz="-0.02""#, &["`arm`", "not positive", "-2e-2"]),
    (r#"izz="0.02""#, r#"izz="0.3""#, &["`arm`", "triangle"]),
    (r#"izz="0.02""#, "", &["`arm`", "izz", "missing"]),
    (
        r#"<child link="arm"/>"#,
        r#"<child link="leg"/>"#,
        &["`hinge`", "child", "`leg`"],
    ),
    (r#"<parent link="base"/>"#, "", &["`hinge`", "<parent>"]),
    (
        r#"<robot name="r">"#,
        r#"<robot name="r"><link name="stray"/>"#,
        &["not a tree", "`stray`"],
    ),
    ("</robot>", "", &["not well-formed XML"]),
    (
        "</joint>",
        r#"</joint><joint name="other" type="fixed"><parent link="base"/><child link="arm"/></joint>"#,
        &["not a tree", "`arm`", "`hinge`", "`other`"],
    ),
    (
        "</joint>",
        r#"</joint><joint name="ring" type="fixed"><parent link="arm"/><child link="base"/></joint>"#,
        &["not a tree", "loop", "own ancestor"],
    ),
    ("</joint>", r#"</joint><link name="arm"/>"#, &["two links", "`arm`"]),
    (
        "</joint>",
        r#"</joint><link name="hand"/><joint name="wrist" type="continuous"><parent link="arm"/>
        <child link="hand"/></joint>"#,
        &["`hand`", "`wrist`", "<inertial>"],
    ),
];

#[test]
fn errors_name_the_element_and_a_remedy() {
    for (from, to, words) in REFUSED {
        check(from, to, words);
    }
    assert!(
        Description::from_urdf("<sdf/>")
            .unwrap_err()
            .to_string()
            .contains("<sdf>")
    );
    assert!(
        Description::from_urdf("<robot/>")
            .unwrap_err()
            .to_string()
            .contains("no link")
    );
}

#[test]
fn infinite_total_mass_is_refused() {
    let heavy = PLAIN
        .replace(r#"<mass value="2"/>"#, r#"<mass value="1e308"/>"#)
        .replace(r#"<mass value="10"/>"#, r#"<mass value="1e308"/>"#);
    let message = Description::from_urdf(&heavy).unwrap_err().to_string();
    assert!(message.contains("inf kg") && message.contains("finite"), "{message}");
}

#[test]
fn limits_of_a_joint_without_a_range_are_not_compared() {
    let turning = PLAIN.replace(
        r#"type="revolute"><"#,
        r#"type="continuous"><limit lower="3" upper="-3"/><"#,
    );
    Description::from_urdf(&turning).expect("a continuous joint has no range");
}

#[test]
fn massless_bodies_may_carry_but_not_end_a_chain() {
    let massless = r#"<inertial><mass value="0"/>
        <inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial>"#;
    let end = PLAIN.replace(
        "</robot>",
        &format!(
            r#"<link name="hand">{massless}</link><joint name="wrist" type="continuous"><parent link="arm"/>
               <child link="hand"/><axis xyz="1 0 0"/></joint></robot>"#
        ),
    );
    let d = Description::from_urdf(&end).expect("the description is fine");
    let error = Tree::<2, 8>::new(&d).unwrap_err();
    assert!(matches!(&error, TreeError::NoInertia { .. }), "{error}");
    assert!(
        error.to_string().contains("`wrist`") && error.to_string().contains("motor inertia"),
        "{error}"
    );
    // inverse dynamics would work; forward dynamics works with a motor
    let mut with_motor = d.clone();
    with_motor.add_motor_inertia("wrist", 0.01).expect("it exists");
    Tree::<2, 8>::new(&with_motor).expect("a motor is inertia enough");
    // the stock slosh gimbal carries the bob
    Tree::<9, 15>::new(&servicer()).expect("an intermediate massless body is fine");
    let light = PLAIN.replace(r#"<mass value="10"/>"#, r#"<mass value="0"/>"#).replace(
        r#"<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>"#,
        r#"<inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/>"#,
    );
    let error = Tree::<1, 7>::new(&Description::from_urdf(&light).expect("valid"))
        .unwrap_err()
        .to_string();
    assert!(error.contains("floating base") && error.contains("`base`"), "{error}");
    Tree::<1, 1>::new(&Description::from_urdf(&light).expect("valid")).expect("a fixed base needs no inertia");
}

#[test]
fn tree_of_wrong_size_lists_the_joints() {
    let error = Tree::<2, 8>::new(&Description::from_urdf(PLAIN).expect("valid"))
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("1 moving joints (hinge)") && error.contains("for 2"),
        "{error}"
    );
}

#[test]
fn the_stock_servicer_in_numbers() {
    let d = servicer();
    let names: Vec<&str> = d.moving_joints().map(|j| j.name.as_str()).collect();
    assert_eq!(names, ["A1", "A2", "A3", "A4", "A5", "A6", "A7", "slosh_y", "slosh_x"]);
    let a1 = d.moving_joints().next().expect("A1");
    assert_eq!(a1.limits.map(|l| (l.upper, l.effort)), Some((2.967059728, 320.0)));
    let tree = Tree::<9, 15>::new(&d).expect("valid");
    assert_eq!(tree.joint_names(), names);
    for frame in ["end_effector", "tool", "link_7", "tank", "base"] {
        tree.frame(frame).expect("every link is a frame");
    }
    let error = tree.frame("hand").unwrap_err().to_string();
    assert!(error.contains("`hand`") && error.contains("end_effector"), "{error}");
}

#[test]
fn the_controllers_model_has_the_propellant_frozen() {
    let mut d = servicer();
    d.freeze("slosh_y", 0.0)
        .and_then(|d| d.freeze("slosh_x", 0.0))
        .expect("they exist");
    for joint in ["A1", "A2", "A3", "A4", "A5", "A6", "A7"] {
        d.add_motor_inertia(joint, 0.1).expect("it exists");
    }
    let tree = Tree::<7, 13>::new(&d).expect("valid");
    let q = nalgebra::SVector::<f64, 7>::zeros();
    let m = tree.mass_matrix(&q);
    assert!((m[(3, 3)] - 450.2).abs() < 1e-12);
    let bare = Tree::<9, 15>::new(&servicer()).expect("valid");
    let whole = bare.mass_matrix(&nalgebra::SVector::zeros());
    for i in 0..13 {
        for j in 0..13 {
            let motor = if i == j && i > 5 { 0.1 } else { 0.0 };
            assert!((m[(i, j)] - whole[(i, j)] - motor).abs() < 1e-12, "{i} {j}");
        }
    }
    let error = d.freeze("slosh_y", 0.0).unwrap_err().to_string();
    assert!(error.contains("`slosh_y`") && error.contains("A1, A2"), "{error}");
}

#[test]
fn mismatch_scales_the_named_quantities() {
    let mut d = servicer();
    d.scale_mass("tool", 1.5)
        .and_then(|d| d.scale_inertia("link_1", 2.0))
        .expect("they exist");
    assert!((d.total_mass() - 451.2).abs() < 1e-9);
    let of = |d: &Description, name: &str| {
        d.links
            .iter()
            .find(|l| l.name == name)
            .and_then(|l| l.inertia)
            .expect("there")
    };
    assert_eq!(of(&d, "link_1").about_com, of(&servicer(), "link_1").about_com * 2.0);
    assert_eq!(of(&d, "tool").com, Vector3::new(0.0, 0.0, 0.1));
    let error = d.scale_mass("tool", -1.0).unwrap_err().to_string();
    assert!(error.contains("`tool`") && error.contains("-1"), "{error}");
    assert!(d.scale_mass("nose", 1.0).unwrap_err().to_string().contains("`nose`"));
    d.remove_branch("slosh_gimbal").expect("it exists");
    assert_eq!(d.dof(), 7);
    assert!((d.total_mass() - 440.59).abs() < 1e-9, "{}", d.total_mass());
}
