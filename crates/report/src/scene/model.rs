//! Solids, and the links of a URDF: its visuals where it has any, else shapes derived from its kinematics and inertias.

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

/// A tree of links; parents come before their children.
#[derive(Debug, Clone, Serialize)]
pub struct Model {
    pub(crate) links: Vec<Link>,
}

/// A link with the joint that carries it.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct Link {
    pub(crate) name: String,
    /// The parent's index in the list; none for the root.
    pub(crate) parent: Option<usize>,
    /// Placement of the joint in the parent: metres, and roll, pitch, yaw in radians.
    pub(crate) xyz: [f64; 3],
    pub(crate) rpy: [f64; 3],
    /// The joint's axis in its own frame; none for a fixed joint.
    pub(crate) axis: Option<[f64; 3]>,
    pub(crate) prismatic: bool,
    /// The index of a moving joint among the moving joints of the file.
    pub(crate) joint: Option<usize>,
    pub(crate) shapes: Vec<Solid>,
}

/// A solid in the frame of its body. Cylinders stand along z around their origin.
#[derive(Debug, Clone, Serialize)]
pub struct Solid {
    /// Its kind.
    pub kind: SolidKind,
    /// Box: the extents. Cylinder: radius, radius at the top, length. Sphere: radius. m.
    pub size: [f64; 3],
    /// Its centre, m.
    pub xyz: [f64; 3],
    /// Its orientation: roll, pitch and yaw about fixed axes, rad.
    pub rpy: [f64; 3],
    /// Red, green, blue, opacity; none for the colour of the material.
    pub rgba: Option<[f64; 4]>,
    /// The material, which determines the shading: a name of the list in docs/run-folder.md.
    pub role: &'static str,
}

impl Solid {
    /// Red, green, blue, opacity from 0 to 1.
    pub(crate) fn color(&self) -> [f64; 4] {
        self.rgba.unwrap_or(match self.role {
            "bus" => [0.80, 0.66, 0.36, 1.0],
            "tube" => [0.90, 0.91, 0.93, 1.0],
            "joint" => [0.93, 0.52, 0.20, 1.0],
            "tool" => [0.36, 0.40, 0.47, 1.0],
            "tank" => [0.55, 0.75, 0.95, 0.16],
            "bob" => [0.20, 0.55, 0.95, 1.0],
            _ => [0.75, 0.77, 0.80, 1.0],
        })
    }
}

/// The kinds of solids.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum SolidKind {
    /// Aligned with the axes.
    Box,
    /// About z.
    Cylinder,
    /// About the origin.
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

impl Model {
    /// Reads a URDF.
    ///
    /// # Errors
    /// A text that is not XML, or whose links and joints do not form a tree.
    pub fn read(text: &str) -> Result<Model, ModelError> {
        multibody::read_xml(text, of_document)?
    }

    /// A single link with these solids.
    pub(crate) fn of_solids(name: &str, solids: Vec<Solid>) -> Model {
        let link = Link {
            name: name.to_owned(),
            parent: None,
            xyz: [0.0; 3],
            rpy: [0.0; 3],
            axis: None,
            prismatic: false,
            joint: None,
            shapes: solids,
        };
        Model { links: vec![link] }
    }

    /// The number of moving joints.
    pub fn moving(&self) -> usize {
        self.links.iter().filter(|link| link.joint.is_some()).count()
    }

    /// For each moving joint in the order of the file, whether it is prismatic.
    pub(crate) fn sliding(&self) -> Vec<bool> {
        let mut moving: Vec<(usize, bool)> = self
            .links
            .iter()
            .filter_map(|link| Some((link.joint?, link.prismatic)))
            .collect();
        moving.sort_unstable();
        moving.into_iter().map(|(_, slides)| slides).collect()
    }
}

fn of_document(document: &Document<'_>) -> Result<Model, ModelError> {
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
        links: vec![link_of(*root, None, None)],
    };
    // Breadth first over the joints of each link; the order of the moving joints is that of the file.
    let mut moving = 0;
    let mut places = vec![None; joints.len()];
    for (place, joint) in places.iter_mut().zip(&joints) {
        if is_moving_joint(joint.attribute("type").unwrap_or_default()) {
            *place = Some(moving);
            moving += 1;
        }
    }
    let mut next = 0;
    while next < model.links.len() {
        let name = model.links[next].name.clone();
        for (at, joint) in joints.iter().enumerate().filter(|(_, j)| end(**j, "parent") == name) {
            let link = named(&end(*joint, "child"))
                .ok_or_else(|| ModelError::Structure(format!("`{name}` has a joint to a link that is not there")))?;
            if model.links.len() > links.len() {
                return Err(ModelError::Structure(format!("`{name}` is part of a loop")));
            }
            let mut link = link_of(*link, Some(next), Some(*joint));
            link.joint = places[at];
            model.links.push(link);
        }
        next += 1;
    }
    if let Some(lost) = links.iter().find(|link| {
        let name = link.attribute("name").unwrap_or_default();
        model.links.iter().all(|link| link.name != name)
    }) {
        let name = lost.attribute("name").unwrap_or_default();
        return Err(ModelError::Structure(format!("`{name}` does not hang on the rest")));
    }
    if model.links.iter().all(|link| link.shapes.is_empty()) {
        derive_shapes(&mut model, &links);
    }
    Ok(model)
}

fn is_moving_joint(kind: &str) -> bool {
    matches!(kind, "revolute" | "continuous" | "prismatic")
}

fn link_of<'a>(link: Node<'a, 'a>, parent: Option<usize>, joint: Option<Node<'a, 'a>>) -> Link {
    let (xyz, rpy) = joint.map(origin).unwrap_or_default();
    let kind = joint.and_then(|j| j.attribute("type")).unwrap_or("fixed");
    let axis = joint
        .and_then(|j| child(j, "axis"))
        .and_then(|n| n.attribute("xyz"))
        .and_then(numbers)
        .unwrap_or([1.0, 0.0, 0.0]);
    Link {
        name: link.attribute("name").unwrap_or_default().to_owned(),
        parent,
        xyz,
        rpy,
        axis: is_moving_joint(kind).then_some(axis),
        prismatic: kind == "prismatic",
        joint: None,
        shapes: link
            .children()
            .filter(|n| n.has_tag_name("visual"))
            .filter_map(visual)
            .collect(),
    }
}

/// Materials with a shading of their own in the playback; others look like paint.
const MATERIALS: [&str; 12] = [
    "foil", "silver", "metal", "white", "dark", "ring", "radiator", "cells", "nozzle", "lens", "tank", "bob",
];

/// A `<visual>`; meshes are separate files, which a self-contained page does not load.
fn visual(node: Node<'_, '_>) -> Option<Solid> {
    let geometry = node.children().find(|n| n.has_tag_name("geometry"))?;
    let solid = geometry.children().find(Node::is_element)?;
    let number = |name| solid.attribute(name).and_then(numbers::<1>).map(|[x]| x);
    let (kind, size) = match solid.tag_name().name() {
        "box" => (SolidKind::Box, solid.attribute("size").and_then(numbers)?),
        "cylinder" => {
            let radius = number("radius")?;
            (SolidKind::Cylinder, [radius, radius, number("length")?])
        }
        "sphere" => (SolidKind::Sphere, [number("radius")?, 0.0, 0.0]),
        _ => return None,
    };
    let material = node.children().find(|n| n.has_tag_name("material"));
    // A material is defined in place, or by the name of one of the robot's materials.
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
    Some(Solid {
        kind,
        size,
        xyz,
        rpy,
        rgba: color,
        role: MATERIALS.iter().find(|known| **known == named).unwrap_or(&"visual"),
    })
}

/// Mass, principal moments as given in the file, and centre of mass of a link.
type Inertial = (f64, [f64; 3], [f64; 3]);

fn inertial_of(links: &[Node<'_, '_>], name: &str) -> Option<Inertial> {
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
}

/// Which links form a pendulum: point masses on moving joints, and the massless links that carry them.
fn pendulums(model: &Model, inertials: &[Option<Inertial>]) -> Vec<bool> {
    let mut hangs = vec![false; inertials.len()];
    for at in (1..inertials.len()).rev() {
        let bare = inertials[at].is_none_or(|(_, moments, _)| moments == [0.0; 3]);
        let weighs = inertials[at].is_some_and(|(mass, ..)| mass > 0.0);
        let mut carried = (0..inertials.len())
            .filter(|child| model.links[*child].parent == Some(at))
            .peekable();
        hangs[at] = bare
            && model.links[at].joint.is_some()
            && (weighs || carried.peek().is_some())
            && carried.all(|child| hangs[child]);
    }
    hangs
}

/// Shapes for a model without visuals: the root as the uniform box of its inertia, joints as drums along their axes, links
/// as tubes from joint to joint, the bob of a pendulum at its centre of mass inside a tank.
fn derive_shapes(model: &mut Model, links: &[Node<'_, '_>]) {
    let inertials: Vec<Option<Inertial>> = model.links.iter().map(|link| inertial_of(links, &link.name)).collect();
    let hangs = pendulums(model, &inertials);
    if let Some((mass, [x, y, z], at)) = inertials[0].filter(|(mass, ..)| *mass > 0.0) {
        let side = |sum: f64| (6.0 * sum / mass).max(1e-4).sqrt();
        let size = [side(y + z - x), side(x + z - y), side(x + y - z)];
        model.links[0].shapes.push(solid(SolidKind::Box, size, at, "bus"));
    }
    // Radius of the tubes, decreasing towards the end of a chain.
    let radius = |index: usize| 0.075 - 0.005 * index.min(8) as f64;
    for at in 1..model.links.len() {
        let link = model.links[at].clone();
        let parent = link.parent.unwrap_or(0);
        match link.joint {
            Some(_) if hangs[at] => {
                if let Some((_, _, centre)) = inertials[at].filter(|(mass, ..)| *mass > 0.0) {
                    add_pendulum_shapes(model, at, centre);
                }
            }
            Some(index) => {
                let r = radius(index);
                let axis = link.axis.unwrap_or([0.0, 0.0, 1.0]);
                model.links[at]
                    .shapes
                    .push(cylinder_along(axis, 2.6 * r, [0.0; 3], r * 1.08, "joint"));
                if parent > 0 {
                    let tube = cylinder_between([0.0; 3], link.xyz, r * 0.86, "tube");
                    model.links[parent].shapes.extend(tube);
                }
            }
            None if model.links[parent].joint.is_some() && !hangs[parent] => {
                model.links[parent]
                    .shapes
                    .extend(cylinder_between([0.0; 3], link.xyz, radius(7), "tube"));
                // The tool extends to the frame after it, which is usually its tip.
                let tip = model.links.iter().find(|b| b.parent == Some(at)).map(|b| b.xyz);
                let tool = cylinder_between([0.0; 3], tip.unwrap_or_default(), 0.03, "tool");
                model.links[at].shapes.extend(tool);
            }
            None => {}
        }
    }
}

/// The bob of a pendulum with its rod, and the tank around its pivot. The tank does not swing: it belongs to the nearest
/// ancestor that does not move.
fn add_pendulum_shapes(model: &mut Model, at: usize, centre: [f64; 3]) {
    let length = centre.iter().map(|x| x * x).sum::<f64>().sqrt();
    let ball = [0.36 * length, 0.0, 0.0];
    model.links[at]
        .shapes
        .push(solid(SolidKind::Sphere, ball, centre, "bob"));
    model.links[at]
        .shapes
        .extend(cylinder_between([0.0; 3], centre, 0.05 * length, "rod"));
    let tank = solid(SolidKind::Sphere, [1.56 * length, 0.0, 0.0], [0.0; 3], "tank");
    let (mut fixed, mut place) = (model.links[at].parent.unwrap_or(0), model.links[at].xyz);
    while model.links[fixed].joint.is_some() {
        place = std::array::from_fn(|i| place[i] + model.links[fixed].xyz[i]);
        fixed = model.links[fixed].parent.unwrap_or(0);
    }
    model.links[fixed].shapes.push(Solid { xyz: place, ..tank });
}

pub(crate) fn solid(kind: SolidKind, size: [f64; 3], xyz: [f64; 3], role: &'static str) -> Solid {
    Solid {
        kind,
        size,
        xyz,
        rpy: [0.0; 3],
        rgba: None,
        role,
    }
}

/// A cylinder of this length along `axis`, around `center`.
fn cylinder_along(axis: [f64; 3], length: f64, center: [f64; 3], radius: f64, role: &'static str) -> Solid {
    let n = axis.iter().map(|x| x * x).sum::<f64>().sqrt().max(1e-12);
    let [x, y, z] = axis.map(|a| a / n);
    // Pitch and yaw that rotate z to the axis.
    let (pitch, yaw) = ((x * x + y * y).sqrt().atan2(z), y.atan2(x));
    Solid {
        rpy: [0.0, pitch, yaw],
        ..solid(SolidKind::Cylinder, [radius, radius, length], center, role)
    }
}

fn cylinder_between(from: [f64; 3], to: [f64; 3], radius: f64, role: &'static str) -> Option<Solid> {
    let axis: [f64; 3] = std::array::from_fn(|i| to[i] - from[i]);
    let length = axis.iter().map(|x| x * x).sum::<f64>().sqrt();
    let center = std::array::from_fn(|i| 0.5 * (from[i] + to[i]));
    (length > 1e-3).then(|| cylinder_along(axis, length, center, radius, role))
}

#[cfg(test)]
mod tests {
    use super::*;

    const CHAIN: &str = r#"<robot name="r">
      <link name="base"><inertial><mass value="12"/><inertia ixx="13" iyy="10" izz="5"/></inertial></link>
      <link name="l1"/><link name="tool"/><link name="bob"><inertial><origin xyz="0 0 -0.1"/><mass value="1"/>
        <inertia ixx="0" iyy="0" izz="0"/></inertial></link>
      <joint name="a" type="revolute"><parent link="base"/><child link="l1"/><origin xyz="0 0 1"/><axis xyz="0 1 0"/></joint>
      <joint name="f" type="fixed"><parent link="l1"/><child link="tool"/><origin xyz="0 0 0.5"/></joint>
      <joint name="s" type="continuous"><parent link="base"/><child link="bob"/><axis xyz="1 0 0"/></joint>
    </robot>"#;

    #[test]
    fn shapes_derive_from_kinematics_and_inertia() {
        let model = Model::read(CHAIN).unwrap();
        let names: Vec<&str> = model.links.iter().map(|b| &*b.name).collect();
        assert_eq!(names, ["base", "l1", "bob", "tool"]);
        assert_eq!(model.links[1].joint, Some(0));
        assert_eq!(model.links[2].joint, Some(1));
        let roles: Vec<&str> = model.links[2].shapes.iter().map(|shape| shape.role).collect();
        assert_eq!(roles, ["bob", "rod"], "a point mass is the bob of a pendulum");
        // m/12 (b² + c²) = 13, m/12 (a² + c²) = 10, m/12 (a² + b²) = 5
        let size = model.links[0].shapes[0].size;
        for (side, expected) in size.iter().zip([1.0, 2.0, 3.0_f64]) {
            assert!((side - expected).abs() < 1e-12, "{size:?}");
        }
        assert!(model.links.iter().all(|b| b.name == "tool" || !b.shapes.is_empty()));
    }

    #[test]
    fn visuals_take_precedence_over_derived_shapes() {
        let text = CHAIN.replace(
            r#"<link name="l1"/>"#,
            r#"<link name="l1"><visual><origin xyz="1 2 3"/><geometry><box size="1 2 3"/></geometry>
               <material name="red"/></visual></link><material name="red"><color rgba="1 0 0 1"/></material>"#,
        );
        let model = Model::read(&text).unwrap();
        let shapes: Vec<&Solid> = model.links.iter().flat_map(|b| &b.shapes).collect();
        assert_eq!(shapes.len(), 1);
        assert_eq!(
            (shapes[0].size, shapes[0].rgba),
            ([1.0, 2.0, 3.0], Some([1.0, 0.0, 0.0, 1.0]))
        );
    }

    #[test]
    fn model_without_tree_is_rejected() {
        assert!(Model::read("<robot").is_err());
        assert!(Model::read("<robot/>").is_err());
        let text = CHAIN.replace(r#"<child link="tool"/>"#, r#"<child link="base"/>"#);
        assert!(Model::read(&text).is_err());
        let text = CHAIN.replace(r#"<child link="tool"/>"#, r#"<child link="nobody"/>"#);
        assert!(Model::read(&text).unwrap_err().to_string().contains("l1"));
        let text = CHAIN.replace(r#"<child link="tool"/>"#, r#"<child link="l1"/>"#);
        assert!(Model::read(&text).is_err());
    }
}
