//! Content of published files beyond the supported subset: accepted, warned of or rejected, each with its line.

use multibody::{Description, DynState, DynTree, Quaternion, UrdfOptions, UrdfReading};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};

const HULL: &str = r#"<link name="hull"><inertial><mass value="10"/>
  <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>"#;

fn read(text: &str) -> UrdfReading {
    Description::read_urdf(text, UrdfOptions::default()).unwrap_or_else(|errors| panic!("{errors}"))
}

fn robot(more: &str) -> String {
    format!("<robot name=\"r\">{HULL}\n{more}</robot>")
}

fn refused(text: &str) -> String {
    Description::from_urdf(text).expect_err(text).to_string()
}

fn link(name: &str, mass: f64, moments: [f64; 3]) -> String {
    let [x, y, z] = moments;
    format!(
        r#"<link name="{name}"><inertial><mass value="{mass}"/><inertia ixx="{x}" iyy="{y}" izz="{z}" ixy="0" ixz="0" iyz="0"/></inertial></link>"#
    )
}

fn joint(kind: &str, child: &str, more: &str) -> String {
    format!(r#"<joint name="to {child}" type="{kind}"><parent link="hull"/><child link="{child}"/>{more}</joint>"#)
}

#[test]
fn quaternion_origin_is_the_attitude_that_rpy_gives() {
    let quarter = "0 0 0.7071067811865476 0.7071067811865476";
    let boom = |origin: &str| robot(&(link("boom", 2.0, [0.01, 0.2, 0.2]) + &joint("revolute", "boom", origin)));
    let text = boom(&format!(
        r#"<origin xyz="0 0 1" quat_xyzw="{quarter}"/><axis xyz="0 0 1"/>"#
    ));
    let reading = read(&text);
    assert!(reading.warnings.is_empty(), "{:?}", reading.warnings);
    let tree = DynTree::new(&reading.description, true).unwrap();
    let s = DynState {
        p_nb: Vector3::zeros(),
        quat_nb: Quaternion::IDENTITY,
        q: vec![0.0],
        nu: vec![0.0; 7],
    };
    let at = tree.placement_in_world(&s, tree.frame("boom").unwrap());
    assert!(
        (at.r - Matrix3::new(0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0)).amax() < 1e-15,
        "{}",
        at.r
    );
    let by_rpy = read(&boom(r#"<origin xyz="0 0 1" rpy="0.3 -0.2 1.1"/>"#)).description;
    let q = UnitQuaternion::from_euler_angles(0.3, -0.2, 1.1);
    let by_quaternion = read(&boom(&format!(
        r#"<origin xyz="0 0 1" quat_xyzw="{} {} {} {}"/>"#,
        q.i, q.j, q.k, q.w
    )))
    .description;
    let difference = by_rpy.joints[0].origin.r - by_quaternion.joints[0].origin.r;
    assert!(difference.amax() < 1e-15, "{difference}");

    // an inertia in rotated axes
    let hull = HULL
        .replace("<mass", &format!(r#"<origin xyz="0 0 0" quat_xyzw="{quarter}"/><mass"#))
        .replace("iyy=\"1\" izz=\"1\"", "iyy=\"2\" izz=\"2.5\"");
    let body = read(&format!("<robot name=\"r\">{hull}</robot>")).description.links[0]
        .inertia
        .unwrap();
    assert!((body.about_com - Matrix3::from_diagonal(&Vector3::new(2.0, 1.0, 2.5))).amax() < 1e-15);

    let error = refused(&boom(r#"<origin quat_xyzw="0 0 0 1" rpy="0 0 0"/>"#));
    assert!(
        error.starts_with("line 3: ") && error.contains("both rpy and quat_xyzw"),
        "{error}"
    );
    for wrong in ["0 0 0 2", "0 0 0 0", "0 0 1", "0 0 0 one"] {
        let error = refused(&boom(&format!(r#"<origin quat_xyzw="{wrong}"/>"#)));
        assert!(error.contains(&format!("quat_xyzw=\"{wrong}\"")), "{error}");
    }
}

#[test]
fn undeclared_prefix_and_document_type_are_read() {
    let prefixes = robot("<gazebo reference=\"hull\"><sensor:camera name=\"c\"/><a:b c:d=\"1\"/></gazebo>");
    let types = [
        "<!DOCTYPE robot>",
        "<!DOCTYPE robot [ <!ENTITY unused \"a > b\"> <!-- ]> ' --> ]>",
        "<!DOCTYPE robot SYSTEM \"file:///etc/passwd\">",
    ];
    let texts = types.map(|kind| format!("<?xml version=\"1.0\"?>\n<!-- <robot> -->\n{kind}\n{prefixes}"));
    for text in texts.iter().chain([&prefixes]) {
        let d = read(text).description;
        assert_eq!((d.links.len(), d.total_mass()), (1, 10.0));
    }
    // lines stay those of the file
    let error = refused(&texts[1].replace("<mass value=\"10\"/>", "<mass value=\"ten\"/>"));
    assert!(error.starts_with("line 4: ") && error.contains("\"ten\""), "{error}");
}

#[test]
fn entity_bomb_and_external_entity_are_refused() {
    let mut bomb = "<!ENTITY e0 \"ha\">".to_owned();
    for level in 1..40 {
        let before = format!("&e{};", level - 1);
        bomb += &format!("<!ENTITY e{level} \"{}\">", before.repeat(10));
    }
    let text = format!("<!DOCTYPE robot [{bomb}]><robot name=\"&e39;\">{HULL}</robot>");
    assert!(refused(&text).contains("not well-formed XML"));
    let outside =
        format!("<!DOCTYPE robot [<!ENTITY out SYSTEM \"file:///etc/passwd\">]><robot name=\"&out;\">{HULL}</robot>");
    assert!(refused(&outside).contains("not well-formed XML"));
}

#[test]
fn unexpanded_xacro_is_refused_at_every_place() {
    let macros = "<xacro:property name=\"m\" value=\"2\"/>\n<xacro:arm prefix=\"left\"/>\n<xacro:if value=\"true\"/>\n";
    for declared in ["http://www.ros.org/wiki/xacro", "http://ros.org/wiki/xacro"] {
        let text = robot(macros).replace("<robot", &format!("<robot xmlns:xacro=\"{declared}\""));
        let lines: Vec<String> = refused(&text).lines().map(str::to_owned).collect();
        assert_eq!(lines.len(), 3);
        assert!(lines[1].starts_with("line 4: <xacro:arm> is not expanded"), "{lines:?}");
    }
    assert!(
        refused(&robot(macros)).contains("line 3: <xacro:property>"),
        "not declared either"
    );
    let error = refused(&robot("").replace("\"10\"", "\"${m}\""));
    assert!(
        error.contains("line 1: ") && error.contains("value=\"${m}\" of link `hull` is not expanded"),
        "{error}"
    );
    assert!(refused(&robot("").replace("hull", "$(arg side)_hull")).contains("is not expanded"));
    // for other tools
    read(&robot("<gazebo><xacro:insert/></gazebo>"));
}

#[test]
fn unmodelled_content_is_warned_about_with_its_line() {
    let arm = link("arm", 1.0, [0.1; 3]) + "\n";
    let more = "<dynamics damping=\"1\" friction=\"0.5\" spring_stiffness=\"3\"/>\n<limit effort=\"1\" velocity=\"1\" jerk=\"3\"/><flex/>";
    let text =
        robot(&(arm + &joint("revolute", "arm", more) + "\n<loop_joint name=\"l\"/>\n<viz:link name=\"ghost\"/>"));
    let warnings: Vec<String> = read(&text).warnings.iter().map(ToString::to_string).collect();
    let expected = [
        "line 4: joint `to arm`: spring_stiffness=\"3\" of <dynamics> is not modelled",
        "line 4: joint `to arm`: friction=\"0.5\" is not modelled",
        "line 5: joint `to arm`: <flex> is not modelled",
        "line 6: the robot: <loop_joint> is not modelled",
        "line 7: the robot: <viz:link> is of another namespace",
    ];
    assert_eq!(warnings.len(), expected.len(), "{warnings:#?}");
    for words in expected {
        assert!(
            warnings.iter().any(|warning| warning.starts_with(words)),
            "{words}: {warnings:#?}"
        );
    }
    assert_eq!(read(&text).description.links.len(), 2, "the ghost is none");
    // elements of other namespaces are not needed here
    let quiet = "<material name=\"m\"/><transmission/><gazebo/><ros2_control/>";
    assert!(read(&robot(quiet)).warnings.is_empty());
    let still = joint("fixed", "arm", "<dynamics friction=\"1\"/>");
    assert!(
        read(&robot(&(link("arm", 1.0, [0.1; 3]) + &still))).warnings.is_empty(),
        "it does not move"
    );
}

#[test]
fn duplicate_element_is_rejected() {
    let text = robot("").replace("</inertial>", "</inertial>\n<inertial><mass value=\"1\"/></inertial>");
    let error = refused(&text);
    assert!(error.starts_with("line 3: link `hull`: a second <inertial>"), "{error}");
}

#[test]
fn negligible_placeholder_link_is_accepted() {
    // a microgram with a physically impossible inertia, fixed to the hull
    let text = robot(&(link("imu", 1e-6, [1e-6, 0.0, 0.0]) + "\n" + &joint("fixed", "imu", "")));
    let reading = read(&text);
    assert_eq!(reading.warnings.len(), 1);
    let warning = reading.warnings[0].to_string();
    assert!(
        warning.starts_with("line 3: link `imu`") && warning.contains("so it is taken"),
        "{warning}"
    );
    DynTree::new(&reading.description, true).unwrap();
    // on a moving joint it is a separate body, and rejected
    let error = refused(&text.replace("fixed", "continuous"));
    assert!(
        error.starts_with("line 3: link `imu`") && error.contains("triangle"),
        "{error}"
    );
    // rounding residue is not a mass
    let rounded =
        robot(&(link("frame", 0.0, [0.0; 3]).replace("ixz=\"0\"", "ixz=\"2.4e-35\"") + &joint("fixed", "frame", "")));
    assert!(read(&rounded).warnings.is_empty());
    let moving = rounded
        .replace("fixed", "continuous")
        .replace("value=\"0\"", "value=\"1\"");
    read(&moving);
}

#[test]
fn unphysical_body_is_accepted_when_allowed() {
    let text = robot(&(link("arm", 1.0, [0.1, 0.1, 0.3]) + "\n" + &joint("continuous", "arm", "")));
    assert!(refused(&text).contains("triangle"));
    let reading = Description::read_urdf(&text, UrdfOptions { allow_unphysical: true }).unwrap();
    assert!(
        reading.warnings[0].to_string().ends_with("taken as it is"),
        "{}",
        reading.warnings[0]
    );
    DynTree::new(&reading.description, true).unwrap();
    let nan = text.replace("0.3", "nan");
    assert!(Description::read_urdf(&nan, UrdfOptions { allow_unphysical: true }).is_err());
}

#[test]
fn all_errors_are_reported_at_once_with_their_lines() {
    let text = "<robot name=\"r\">\n<link name=\"base\"/>\n<link name=\"arm\"><inertial><mass value=\"x\"/>\n\
         <inertia ixx=\"1\" iyy=\"y\" izz=\"1\" ixy=\"0\" ixz=\"0\"/></inertial></link>\n\
         <joint name=\"j\" type=\"planar\"><parent link=\"base\"/><child link=\"leg\"/>\n<axis xyz=\"0 0\"/></joint>\n\
         <link name=\"base\"/></robot>";
    let errors = Description::from_urdf(text).unwrap_err();
    let lines: Vec<Option<u32>> = errors.iter().map(|error| error.line).collect();
    assert_eq!(
        lines,
        [Some(2), Some(3), Some(4), Some(4), Some(5), Some(5), Some(6)],
        "{errors}"
    );
    // also for errors of the whole tree
    let two = robot(&(link("a", -1.0, [0.1; 3]) + "\n" + &link("b", 1.0, [1.0, 0.1, 0.1]) + "\n")).replace(
        "</robot>",
        &(joint("continuous", "a", "") + "\n" + &joint("continuous", "b", "<axis xyz=\"0 0 0\"/>") + "</robot>"),
    );
    assert_eq!(
        Description::from_urdf(&two).unwrap_err().iter().count(),
        1,
        "an axis first"
    );
    let errors = Description::from_urdf(&two.replace("0 0 0", "0 0 1")).unwrap_err();
    let lines: Vec<Option<u32>> = errors.iter().map(|error| error.line).collect();
    assert_eq!(lines, [Some(3), Some(4)], "{errors}");
}
