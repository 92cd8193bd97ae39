//! The geometry of the 3-D playback, from a URDF: its visuals where it has any, else shapes that follow from its
//! kinematics and inertias.

use multibody::nalgebra::{Quaternion, UnitQuaternion};
use roxmltree::{Document, Node};
use serde::Serialize;

/// Why a model cannot be drawn.
#[derive(Debug, thiserror::Error)]
pub enum ModelError {
    /// Not XML.
    #[error("the model is not XML: {0}")]
    Xml(#[from] roxmltree::Error),
    /// Not a tree of links and joints.
    #[error("the model cannot be drawn: {0}")]
    Structure(String),
}

/// A tree of bodies; parents come before their children.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct Model {
    pub(crate) bodies: Vec<Body>,
}

/// A link with the joint that carries it.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct Body {
    pub(crate) name: String,
    /// The parent's place in the list; none for the root.
    pub(crate) parent: Option<usize>,
    /// Placement of the joint in the parent: metres, and roll, pitch, yaw in radians.
    pub(crate) xyz: [f64; 3],
    pub(crate) rpy: [f64; 3],
    /// The joint's axis in its own frame; none for a fixed joint.
    pub(crate) axis: Option<[f64; 3]>,
    pub(crate) prismatic: bool,
    /// The playback channel and its element that move the joint.
    pub(crate) channel: Option<(&'static str, usize)>,
    pub(crate) shapes: Vec<Shape>,
}

/// A solid in the frame of its body. Cylinders stand along z around their origin.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct Shape {
    pub(crate) kind: Kind,
    /// Box: the extents. Cylinder: radius, radius at the top, length. Sphere: radius. m.
    pub(crate) size: [f64; 3],
    pub(crate) xyz: [f64; 3],
    pub(crate) rpy: [f64; 3],
    /// Red, green, blue, opacity; none for the colour of the role.
    pub(crate) rgba: Option<[f64; 4]>,
    /// What it stands for, which gives it a colour.
    pub(crate) role: &'static str,
}

impl Shape {
    /// Red, green, blue, opacity from 0 to 1.
    pub(crate) fn color(&self) -> [f64; 4] {
        self.rgba.unwrap_or(match self.role {
            "bus" => [0.80, 0.66, 0.36, 1.0],
            "arm" => [0.90, 0.91, 0.93, 1.0],
            "joint" => [0.93, 0.52, 0.20, 1.0],
            "tool" => [0.36, 0.40, 0.47, 1.0],
            "tank" => [0.55, 0.75, 0.95, 0.16],
            "bob" => [0.20, 0.55, 0.95, 1.0],
            _ => [0.75, 0.77, 0.80, 1.0],
        })
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Kind {
    Box,
    Cylinder,
    Sphere,
}

fn numbers<const N: usize>(text: &str) -> Option<[f64; N]> {
    let mut words = text.split_whitespace();
    let mut out = [0.0; N];
    for slot in &mut out {
        *slot = words.next()?.parse().ok().filter(|x: &f64| x.is_finite())?;
    }
    words.next().is_none().then_some(out)
}

fn child<'a>(node: Node<'a, 'a>, name: &str) -> Option<Node<'a, 'a>> {
    node.children().find(|n| n.has_tag_name(name))
}

fn origin(node: Node<'_, '_>) -> ([f64; 3], [f64; 3]) {
    let part = |name| {
        let text = node.children().find(|n| n.has_tag_name("origin"))?.attribute(name)?;
        numbers(text)
    };
    let turned = node
        .children()
        .find(|n| n.has_tag_name("origin"))
        .and_then(|n| n.attribute("quat_xyzw"));
    let rpy = match turned.and_then(numbers) {
        Some([x, y, z, w]) => {
            let quaternion = UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z));
            let (roll, pitch, yaw) = quaternion.euler_angles();
            Some([roll, pitch, yaw])
        }
        None => part("rpy"),
    };
    (part("xyz").unwrap_or_default(), rpy.unwrap_or_default())
}

/// Reads a URDF. The first `arm` moving joints follow channel `q`, the next `slosh` ones channel `q_slosh`.
pub(crate) fn read(text: &str, arm: usize, slosh: usize) -> Result<Model, ModelError> {
    multibody::read_xml(text, |document| of_document(document, arm, slosh))?
}

fn of_document(document: &Document<'_>, arm: usize, slosh: usize) -> Result<Model, ModelError> {
    let robot = document.root_element();
    let links: Vec<Node<'_, '_>> = robot.children().filter(|n| n.has_tag_name("link")).collect();
    let joints: Vec<Node<'_, '_>> = robot.children().filter(|n| n.has_tag_name("joint")).collect();
    let end = |joint: Node<'_, '_>, which: &str| {
        let link = joint.children().find(|n| n.has_tag_name(which));
        link.and_then(|n| n.attribute("link")).unwrap_or_default().to_owned()
    };
    let named = |name: &str| links.iter().find(|n| n.attribute("name") == Some(name));
    let is_child = |link: &Node<'_, '_>| {
        joints
            .iter()
            .any(|j| link.attribute("name") == Some(&*end(*j, "child")))
    };
    let root = links
        .iter()
        .find(|link| !is_child(link))
        .ok_or_else(|| ModelError::Structure("it has no link without a parent".to_owned()))?;
    let mut model = Model {
        bodies: vec![body_of(*root, None, None)],
    };
    let mut moving = 0;
    // Breadth first over the joints of each body; the order of the moving joints is that of the file.
    let mut channels = vec![None; joints.len()];
    for (at, joint) in joints.iter().enumerate() {
        let kind = joint.attribute("type").unwrap_or_default();
        if matches!(kind, "revolute" | "continuous" | "prismatic") {
            channels[at] = if moving < arm {
                Some(("q", moving))
            } else {
                (moving < arm + slosh).then_some(("q_slosh", moving - arm))
            };
            moving += 1;
        }
    }
    let mut next = 0;
    while next < model.bodies.len() {
        let name = model.bodies[next].name.clone();
        for (at, joint) in joints.iter().enumerate().filter(|(_, j)| end(**j, "parent") == name) {
            let link = named(&end(*joint, "child"))
                .ok_or_else(|| ModelError::Structure(format!("`{name}` has a joint to a link that is not there")))?;
            if model.bodies.len() > links.len() {
                return Err(ModelError::Structure(format!("`{name}` is part of a loop")));
            }
            let mut body = body_of(*link, Some(next), Some(*joint));
            body.channel = channels[at];
            model.bodies.push(body);
        }
        next += 1;
    }
    if let Some(lost) = links.iter().find(|link| {
        let name = link.attribute("name").unwrap_or_default();
        model.bodies.iter().all(|body| body.name != name)
    }) {
        let name = lost.attribute("name").unwrap_or_default();
        return Err(ModelError::Structure(format!("`{name}` does not hang on the rest")));
    }
    if model.bodies.iter().all(|body| body.shapes.is_empty()) {
        invent_shapes(&mut model, &links);
    }
    Ok(model)
}

fn body_of<'a>(link: Node<'a, 'a>, parent: Option<usize>, joint: Option<Node<'a, 'a>>) -> Body {
    let (xyz, rpy) = joint.map(origin).unwrap_or_default();
    let kind = joint.and_then(|j| j.attribute("type")).unwrap_or("fixed");
    let axis = joint
        .and_then(|j| child(j, "axis"))
        .and_then(|n| n.attribute("xyz"))
        .and_then(numbers)
        .unwrap_or([1.0, 0.0, 0.0]);
    Body {
        name: link.attribute("name").unwrap_or_default().to_owned(),
        parent,
        xyz,
        rpy,
        axis: matches!(kind, "revolute" | "continuous" | "prismatic").then_some(axis),
        prismatic: kind == "prismatic",
        channel: None,
        shapes: link
            .children()
            .filter(|n| n.has_tag_name("visual"))
            .filter_map(visual)
            .collect(),
    }
}

/// Names of materials that the playback knows how to shade; others look like paint.
const MATERIALS: [&str; 12] = [
    "foil", "silver", "metal", "white", "dark", "ring", "radiator", "cells", "nozzle", "lens", "tank", "bob",
];

/// A `<visual>`; meshes are other files, which a self-contained page does not load.
fn visual(node: Node<'_, '_>) -> Option<Shape> {
    let geometry = node.children().find(|n| n.has_tag_name("geometry"))?;
    let solid = geometry.children().find(Node::is_element)?;
    let number = |name| solid.attribute(name).and_then(numbers::<1>).map(|[x]| x);
    let (kind, size) = match solid.tag_name().name() {
        "box" => (Kind::Box, solid.attribute("size").and_then(numbers)?),
        "cylinder" => {
            let radius = number("radius")?;
            (Kind::Cylinder, [radius, radius, number("length")?])
        }
        "sphere" => (Kind::Sphere, [number("radius")?, 0.0, 0.0]),
        _ => return None,
    };
    let material = node.children().find(|n| n.has_tag_name("material"));
    // A material is given in place, or by its name among those of the robot.
    let by_name = material.and_then(|m| m.attribute("name")).and_then(|name| {
        let mut all = node.document().root_element().children();
        all.find(|n| n.has_tag_name("material") && n.attribute("name") == Some(name))
    });
    let color = [material, by_name].into_iter().flatten().find_map(|m| {
        let color = m.children().find(|n| n.has_tag_name("color"))?;
        numbers(color.attribute("rgba")?)
    });
    let named = material.and_then(|m| m.attribute("name")).unwrap_or_default();
    let (xyz, rpy) = origin(node);
    Some(Shape {
        kind,
        size,
        xyz,
        rpy,
        rgba: color,
        role: MATERIALS.iter().find(|known| **known == named).unwrap_or(&"visual"),
    })
}

/// Shapes for a model that has none: the root as the uniform box of its inertia, joints as drums along their axes, links
/// as tubes from joint to joint, the bob at its centre of mass inside a tank.
fn invent_shapes(model: &mut Model, links: &[Node<'_, '_>]) {
    let inertial = |name: &str| {
        let link = links.iter().find(|n| n.attribute("name") == Some(name))?;
        let inertial = link.children().find(|n| n.has_tag_name("inertial"))?;
        let value = |tag: &str, name: &str| {
            let node = inertial.children().find(|n| n.has_tag_name(tag))?;
            numbers::<1>(node.attribute(name)?).map(|[x]| x)
        };
        let moments = [
            value("inertia", "ixx")?,
            value("inertia", "iyy")?,
            value("inertia", "izz")?,
        ];
        Some((value("mass", "value")?, moments, origin(inertial).0))
    };
    if let Some((mass, [x, y, z], at)) = inertial(&model.bodies[0].name).filter(|(mass, ..)| *mass > 0.0) {
        let side = |sum: f64| (6.0 * sum / mass).max(1e-4).sqrt();
        let size = [side(y + z - x), side(x + z - y), side(x + y - z)];
        model.bodies[0].shapes.push(solid(Kind::Box, size, at, "bus"));
    }
    // Radius of the arm's tubes, thinner towards the tool.
    let radius = |index: usize| 0.075 - 0.005 * index.min(8) as f64;
    for at in 1..model.bodies.len() {
        let body = model.bodies[at].clone();
        let parent = body.parent.unwrap_or(0);
        match body.channel {
            Some(("q", index)) => {
                let r = radius(index);
                let drum = along(
                    body.axis.unwrap_or([0.0, 0.0, 1.0]),
                    2.6 * r,
                    [0.0; 3],
                    r * 1.08,
                    "joint",
                );
                model.bodies[at].shapes.push(drum);
                if parent > 0 {
                    model.bodies[parent]
                        .shapes
                        .extend(tube([0.0; 3], body.xyz, r * 0.86, "arm"));
                }
            }
            Some(_) => {
                let bob = inertial(&body.name).filter(|(mass, ..)| *mass > 0.0);
                if let Some((_, _, center)) = bob {
                    let length = center.iter().map(|x| x * x).sum::<f64>().sqrt();
                    let ball = [0.36 * length, 0.0, 0.0];
                    model.bodies[at].shapes.push(solid(Kind::Sphere, ball, center, "bob"));
                    model.bodies[at]
                        .shapes
                        .extend(tube([0.0; 3], center, 0.05 * length, "rod"));
                    let tank = solid(Kind::Sphere, [1.56 * length, 0.0, 0.0], [0.0; 3], "tank");
                    // The tank does not swing: it belongs to the last ancestor that does not.
                    let mut fixed = parent;
                    let mut place = body.xyz;
                    while model.bodies[fixed].channel.is_some() {
                        place = std::array::from_fn(|i| place[i] + model.bodies[fixed].xyz[i]);
                        fixed = model.bodies[fixed].parent.unwrap_or(0);
                    }
                    model.bodies[fixed].shapes.push(Shape { xyz: place, ..tank });
                }
            }
            None if body.axis.is_none() && model.bodies[parent].channel.is_some_and(|(name, _)| name == "q") => {
                let (parent_shape, role) = (tube([0.0; 3], body.xyz, radius(7), "arm"), "tool");
                model.bodies[parent].shapes.extend(parent_shape);
                // The tool reaches to the frame behind it, which is usually its tip.
                let tip = model.bodies.iter().find(|b| b.parent == Some(at)).map(|b| b.xyz);
                model.bodies[at]
                    .shapes
                    .extend(tube([0.0; 3], tip.unwrap_or_default(), 0.03, role));
            }
            None => {}
        }
    }
}

fn solid(kind: Kind, size: [f64; 3], xyz: [f64; 3], role: &'static str) -> Shape {
    Shape {
        kind,
        size,
        xyz,
        rpy: [0.0; 3],
        rgba: None,
        role,
    }
}

/// A cylinder of this length along `axis`, around `center`.
fn along(axis: [f64; 3], length: f64, center: [f64; 3], radius: f64, role: &'static str) -> Shape {
    let n = axis.iter().map(|x| x * x).sum::<f64>().sqrt().max(1e-12);
    let [x, y, z] = axis.map(|a| a / n);
    // Pitch and yaw take z to the axis.
    let (pitch, yaw) = ((x * x + y * y).sqrt().atan2(z), y.atan2(x));
    Shape {
        rpy: [0.0, pitch, yaw],
        ..solid(Kind::Cylinder, [radius, radius, length], center, role)
    }
}

fn tube(from: [f64; 3], to: [f64; 3], radius: f64, role: &'static str) -> Option<Shape> {
    let axis: [f64; 3] = std::array::from_fn(|i| to[i] - from[i]);
    let length = axis.iter().map(|x| x * x).sum::<f64>().sqrt();
    let center = std::array::from_fn(|i| 0.5 * (from[i] + to[i]));
    (length > 1e-3).then(|| along(axis, length, center, radius, role))
}

#[cfg(test)]
mod tests {
    use super::*;

    const ARM: &str = r#"<robot name="r">
      <link name="base"><inertial><mass value="12"/><inertia ixx="13" iyy="10" izz="5"/></inertial></link>
      <link name="l1"/><link name="tool"/><link name="bob"><inertial><origin xyz="0 0 -0.1"/><mass value="1"/>
        <inertia ixx="0" iyy="0" izz="0"/></inertial></link>
      <joint name="a" type="revolute"><parent link="base"/><child link="l1"/><origin xyz="0 0 1"/><axis xyz="0 1 0"/></joint>
      <joint name="f" type="fixed"><parent link="l1"/><child link="tool"/><origin xyz="0 0 0.5"/></joint>
      <joint name="s" type="continuous"><parent link="base"/><child link="bob"/><axis xyz="1 0 0"/></joint>
    </robot>"#;

    #[test]
    fn shapes_follow_from_kinematics_and_inertia() {
        let model = read(ARM, 1, 1).unwrap();
        let names: Vec<&str> = model.bodies.iter().map(|b| &*b.name).collect();
        assert_eq!(names, ["base", "l1", "bob", "tool"]);
        assert_eq!(model.bodies[1].channel, Some(("q", 0)));
        assert_eq!(model.bodies[2].channel, Some(("q_slosh", 0)));
        // m/12 (b² + c²) = 13, m/12 (a² + c²) = 10, m/12 (a² + b²) = 5
        let size = model.bodies[0].shapes[0].size;
        for (side, expected) in size.iter().zip([1.0, 2.0, 3.0_f64]) {
            assert!((side - expected).abs() < 1e-12, "{size:?}");
        }
        assert!(model.bodies.iter().all(|b| b.name == "tool" || !b.shapes.is_empty()));
    }

    #[test]
    fn visuals_win() {
        let text = ARM.replace(
            r#"<link name="l1"/>"#,
            r#"<link name="l1"><visual><origin xyz="1 2 3"/><geometry><box size="1 2 3"/></geometry>
               <material name="red"/></visual></link><material name="red"><color rgba="1 0 0 1"/></material>"#,
        );
        let model = read(&text, 1, 1).unwrap();
        let shapes: Vec<&Shape> = model.bodies.iter().flat_map(|b| &b.shapes).collect();
        assert_eq!(shapes.len(), 1);
        assert_eq!(
            (shapes[0].size, shapes[0].rgba),
            ([1.0, 2.0, 3.0], Some([1.0, 0.0, 0.0, 1.0]))
        );
    }

    #[test]
    fn what_is_no_tree_is_an_error() {
        assert!(read("<robot", 1, 1).is_err());
        assert!(read("<robot/>", 1, 1).is_err());
        let text = ARM.replace(r#"<child link="tool"/>"#, r#"<child link="base"/>"#);
        assert!(read(&text, 1, 1).is_err());
        let text = ARM.replace(r#"<child link="tool"/>"#, r#"<child link="nobody"/>"#);
        assert!(read(&text, 1, 1).unwrap_err().to_string().contains("l1"));
        let text = ARM.replace(r#"<child link="tool"/>"#, r#"<child link="l1"/>"#);
        assert!(read(&text, 1, 1).is_err());
    }
}
