//! URDF text to [`Description`].
//!
//! The subset is the one rigid-body dynamics needs: `link/inertial`, and `joint` with `origin`, `axis`, `limit`,
//! `dynamics`. Geometry, materials and transmissions are skipped. `rpy` means R = Rz(y) Ry(p) Rx(r), as the format
//! defines it.

use super::{Description, DescriptionError, Inertia, Joint, JointKind, Limits, Link, Placement};
use crate::rotation::roll_pitch_yaw;
use nalgebra::{Matrix3, Vector3};
use roxmltree::{Document, Node};

/// Why a text is not a URDF this crate can use. `line` counts from 1.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum UrdfError {
    /// Not XML.
    #[error("not well-formed XML: {0}")]
    Xml(String),
    /// The root element is not `<robot>`.
    #[error("the root element is <{found}>; a URDF starts with <robot name=\"…\">")]
    NotARobot {
        /// What it is.
        found: String,
    },
    /// An element or attribute is missing.
    #[error("line {line}: {owner}: {missing} is missing")]
    Missing {
        /// Line of the owner.
        line: u32,
        /// Which link or joint.
        owner: String,
        /// What is missing.
        missing: String,
    },
    /// An attribute is not the number or numbers it must be.
    #[error("line {line}: {owner}: {attribute}=\"{text}\" must be {expected}")]
    Number {
        /// Line of the element.
        line: u32,
        /// Which link or joint.
        owner: String,
        /// The attribute.
        attribute: String,
        /// Its text.
        text: String,
        /// What it must be.
        expected: &'static str,
    },
    /// A joint names a link that does not exist.
    #[error("line {line}: joint `{joint}`: its {role} link `{link}` is not defined in this file")]
    UnknownLink {
        /// Line of the joint.
        line: u32,
        /// The joint.
        joint: String,
        /// `parent` or `child`.
        role: &'static str,
        /// The name.
        link: String,
    },
    /// A joint type the kernels have no equations for.
    #[error(
        "line {line}: joint `{joint}`: type `{kind}` is not supported; use revolute, continuous, prismatic or fixed \
         (the base floats by itself, and a planar joint is two prismatic and one revolute joint)"
    )]
    JointType {
        /// Line of the joint.
        line: u32,
        /// The joint.
        joint: String,
        /// The type.
        kind: String,
    },
    /// A mimic joint.
    #[error(
        "line {line}: joint `{joint}` mimics another; constraints are not supported, remove <mimic> or fix the joint"
    )]
    Mimic {
        /// Line of the element.
        line: u32,
        /// The joint.
        joint: String,
    },
    /// The text is a URDF but not of a mechanism.
    #[error(transparent)]
    Description(#[from] DescriptionError),
}

impl Description {
    /// Reads URDF text. The root link becomes the base; joint coordinates are the moving joints in the order of the
    /// text.
    pub fn from_urdf(text: &str) -> Result<Self, UrdfError> {
        let document = Document::parse(text).map_err(|e| UrdfError::Xml(e.to_string()))?;
        let robot = document.root_element();
        if !robot.has_tag_name("robot") {
            return Err(UrdfError::NotARobot {
                found: robot.tag_name().name().to_owned(),
            });
        }
        let elements = |tag: &'static str| robot.children().filter(move |n| n.has_tag_name(tag));
        let links = elements("link").map(link).collect::<Result<Vec<_>, _>>()?;
        let joints = elements("joint")
            .map(|n| joint(n, &links))
            .collect::<Result<Vec<_>, _>>()?;
        let name = robot.attribute("name").unwrap_or("mechanism").to_owned();
        let description = Self { name, links, joints };
        description.validate()?;
        Ok(description)
    }
}

fn link(node: Node) -> Result<Link, UrdfError> {
    let name = required(node, "a <link>", "name")?.to_owned();
    let owner = format!("link `{name}`");
    let Some(inertial) = element(node, "inertial") else {
        return Ok(Link { name, inertia: None });
    };
    let mass = scalar(needed(inertial, &owner, "mass")?, &owner, "value")?;
    let i = needed(inertial, &owner, "inertia")?;
    let m = |a: &'static str| scalar(i, &owner, a);
    let (xx, xy, xz) = (m("ixx")?, m("ixy")?, m("ixz")?);
    let (yy, yz, zz) = (m("iyy")?, m("iyz")?, m("izz")?);
    let placement = origin(inertial, &owner)?;
    let about_com = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
    let inertia = Inertia {
        mass,
        com: Vector3::zeros(),
        about_com,
    };
    Ok(Link {
        name,
        inertia: Some(super::merge::moved(&inertia, &placement)),
    })
}

fn joint(node: Node, links: &[Link]) -> Result<Joint, UrdfError> {
    let name = required(node, "a <joint>", "name")?.to_owned();
    let owner = format!("joint `{name}`");
    let line = line_of(node);
    if let Some(mimic) = element(node, "mimic") {
        return Err(UrdfError::Mimic {
            line: line_of(mimic),
            joint: name,
        });
    }
    let kind = match required(node, &owner, "type")? {
        "fixed" => JointKind::Fixed,
        "revolute" => JointKind::Revolute,
        "continuous" => JointKind::Continuous,
        "prismatic" => JointKind::Prismatic,
        other => {
            return Err(UrdfError::JointType {
                line,
                joint: name,
                kind: other.to_owned(),
            });
        }
    };
    let end = |role: &'static str| {
        let link = required(needed(node, &owner, role)?, &owner, "link")?;
        links
            .iter()
            .position(|l| l.name == link)
            .ok_or_else(|| UrdfError::UnknownLink {
                line,
                joint: name.clone(),
                role,
                link: link.to_owned(),
            })
    };
    let (parent, child) = (end("parent")?, end("child")?);
    let axis = match element(node, "axis") {
        Some(axis) => vector(axis, &owner, "xyz")?.unwrap_or_else(Vector3::x),
        None => Vector3::x(), // the format's default
    };
    // Unit length here, so that everyone who reads `axis` can rely on it; a zero axis is left for the check to name.
    let length = axis.norm();
    let axis = if length > 0.0 && length.is_finite() && length != 1.0 {
        axis / length
    } else {
        axis
    };
    let optional = |n: Option<Node>, a: &'static str| match n {
        Some(n) if n.has_attribute(a) => scalar(n, &owner, a),
        _ => Ok(0.0),
    };
    let limit = element(node, "limit");
    let limits = match limit {
        Some(_) => Some(Limits {
            lower: optional(limit, "lower")?,
            upper: optional(limit, "upper")?,
            velocity: optional(limit, "velocity")?,
            effort: optional(limit, "effort")?,
        }),
        None => None,
    };
    let dynamics = element(node, "dynamics");
    let damping = optional(dynamics, "damping")?;
    let friction = optional(dynamics, "friction")?;
    let origin = origin(node, &owner)?;
    let (stiffness, rest, motor_inertia) = (0.0, 0.0, 0.0);
    Ok(Joint {
        name,
        kind,
        parent,
        child,
        origin,
        axis,
        limits,
        damping,
        friction,
        stiffness,
        rest,
        motor_inertia,
    })
}

fn origin(node: Node, owner: &str) -> Result<Placement, UrdfError> {
    let Some(origin) = element(node, "origin") else {
        return Ok(Placement::identity());
    };
    let p = vector(origin, owner, "xyz")?.unwrap_or_else(Vector3::zeros);
    let rpy = vector(origin, owner, "rpy")?.unwrap_or_else(Vector3::zeros);
    Ok(Placement {
        p,
        r: roll_pitch_yaw(rpy.x, rpy.y, rpy.z),
    })
}

fn element<'a, 'i>(node: Node<'a, 'i>, tag: &str) -> Option<Node<'a, 'i>> {
    node.children().find(|n| n.has_tag_name(tag))
}

fn line_of(node: Node) -> u32 {
    node.document().text_pos_at(node.range().start).row
}

fn needed<'a, 'i>(node: Node<'a, 'i>, owner: &str, tag: &str) -> Result<Node<'a, 'i>, UrdfError> {
    element(node, tag).ok_or_else(|| UrdfError::Missing {
        line: line_of(node),
        owner: owner.to_owned(),
        missing: format!("element <{tag}>"),
    })
}

fn required<'a>(node: Node<'a, '_>, owner: &str, attribute: &str) -> Result<&'a str, UrdfError> {
    node.attribute(attribute).ok_or_else(|| UrdfError::Missing {
        line: line_of(node),
        owner: owner.to_owned(),
        missing: format!("attribute {attribute} of <{}>", node.tag_name().name()),
    })
}

fn scalar(node: Node, owner: &str, attribute: &str) -> Result<f64, UrdfError> {
    let text = required(node, owner, attribute)?;
    let number = text.trim().parse().ok().filter(|x: &f64| x.is_finite());
    number.ok_or_else(|| not_a_number(node, owner, attribute, text, "one finite number"))
}

fn vector(node: Node, owner: &str, attribute: &str) -> Result<Option<Vector3<f64>>, UrdfError> {
    let Some(text) = node.attribute(attribute) else {
        return Ok(None);
    };
    let numbers: Option<Vec<f64>> = text
        .split_whitespace()
        .map(|w| w.parse().ok().filter(|x: &f64| x.is_finite()))
        .collect();
    match numbers.as_deref() {
        Some([x, y, z]) => Ok(Some(Vector3::new(*x, *y, *z))),
        _ => Err(not_a_number(node, owner, attribute, text, "three finite numbers")),
    }
}

fn not_a_number(node: Node, owner: &str, attribute: &str, text: &str, expected: &'static str) -> UrdfError {
    UrdfError::Number {
        line: line_of(node),
        owner: owner.to_owned(),
        attribute: attribute.to_owned(),
        text: text.to_owned(),
        expected,
    }
}
