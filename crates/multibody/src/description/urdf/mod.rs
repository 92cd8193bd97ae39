//! URDF text to [`Description`].
//!
//! The supported subset is that of rigid-body dynamics: `link/inertial`, and `joint` with `origin`, `axis`, `limit`, `dynamics` and
//! `mimic`. Geometry, materials, transmissions and data for simulators and controllers are skipped. Everything else causes a warning
//! or an error, with its line. `rpy` means R = Rz(y) Ry(p) Rx(r), as the format defines it; `quat_xyzw` is that of version 1.1.

mod error;
mod xml;

pub use error::{UrdfError, UrdfErrorKind, UrdfErrors, UrdfWarning};
pub use xml::read_xml;

use super::{Description, DescriptionError, Inertia, Joint, JointKind, Limits, Link, Mimic, Placement};
use crate::rotation::{Quaternion, roll_pitch_yaw};
use nalgebra::{Matrix3, Vector3};
use roxmltree::Node;
use std::collections::BTreeMap;
use xml::{displayed_name, element, is_macro, is_urdf_element, line_at, line_of};

/// Skipped elements, which belong to other tools: appearance, contact, actuation, simulators, middleware.
const SKIPPED_ELEMENTS: &[&str] = &[
    "material",
    "transmission",
    "gazebo",
    "sensor",
    "ros2_control",
    "mujoco",
    "group_state",
    "capability",
];

/// Tolerance of a quaternion's length, for rounded digits; a larger deviation is an error.
const QUATERNION_SLACK: f64 = 1e-3;

/// Options of the URDF reader.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct UrdfOptions {
    /// Accepts physically impossible bodies, with a warning.
    pub allow_unphysical: bool,
}

/// Result of reading a URDF.
#[derive(Clone, Debug, PartialEq)]
pub struct UrdfReading {
    /// The mechanism.
    pub description: Description,
    /// Content of the text that is not in the description, in line order.
    pub warnings: Vec<UrdfWarning>,
}

impl Description {
    /// Reads URDF text. The root link becomes the base; joint coordinates are the moving joints in the order of the text, without
    /// those that mimic another. Content beyond rigid-body dynamics is skipped; [`read_urdf`](Self::read_urdf) reports it.
    ///
    /// # Errors
    /// All errors found in the text.
    pub fn from_urdf(text: &str) -> Result<Self, UrdfErrors> {
        Self::read_urdf(text, UrdfOptions::default()).map(|reading| reading.description)
    }

    /// Reads URDF text, and reports the content that the dynamics ignore.
    ///
    /// # Errors
    /// All errors found in the text.
    pub fn read_urdf(text: &str, options: UrdfOptions) -> Result<UrdfReading, UrdfErrors> {
        let xml_error = |error: roxmltree::Error| {
            let line = Some(error.pos().row);
            UrdfErrors(vec![UrdfError {
                line,
                kind: UrdfErrorKind::Xml(error.to_string()),
            }])
        };
        read_xml(text, |document| {
            Reader::default().robot(document.root_element(), options)
        })
        .map_err(xml_error)?
    }
}

/// Errors and warnings found so far.
#[derive(Default)]
struct Reader {
    errors: Vec<UrdfError>,
    warnings: Vec<UrdfWarning>,
    /// Where the elements of links and joints start in the text. Only errors and warnings need the line, which is counted from the
    /// beginning of the text.
    starts: BTreeMap<(&'static str, String), usize>,
}

impl Reader {
    fn robot(mut self, robot: Node, options: UrdfOptions) -> Result<UrdfReading, UrdfErrors> {
        if robot.tag_name().name() != "robot" {
            let found = displayed_name(robot);
            self.report(robot, UrdfErrorKind::NotARobot { found });
            return Err(UrdfErrors(self.errors));
        }
        self.check_content(
            robot,
            "the robot",
            &["name", "version"],
            &[],
            &[&["link", "joint"], SKIPPED_ELEMENTS].concat(),
        );
        let elements = |tag: &'static str| {
            let own = move |n: &Node| n.is_element() && is_urdf_element(*n) && n.tag_name().name() == tag;
            robot.children().filter(own)
        };
        let links: Vec<Link> = elements("link").filter_map(|node| self.link(node)).collect();
        let joints: Vec<Joint> = elements("joint").filter_map(|node| self.joint(node, &links)).collect();
        let description = Description {
            name: robot.attribute("name").unwrap_or("mechanism").to_owned(),
            links,
            joints,
            allow_unphysical: options.allow_unphysical,
        };
        // an element that could not be read would be reported again as missing from the tree
        let found = if self.errors.is_empty() {
            description.errors()
        } else {
            description.part_errors()
        };
        for error in found {
            let line = self.line_of_subject(robot, &error);
            self.errors.push(UrdfError {
                line,
                kind: error.into(),
            });
        }
        if !self.errors.is_empty() {
            self.errors.sort_by_key(|error| error.line);
            return Err(UrdfErrors(self.errors));
        }
        for (error, merged) in description.tolerated_errors() {
            let line = self.line_of_subject(robot, &error);
            let kept = if merged {
                "; with what is fixed to it the body is possible, so it is taken"
            } else {
                "; taken as it is"
            };
            self.warnings.push(UrdfWarning {
                line,
                text: format!("{error}{kept}"),
            });
        }
        self.warnings.sort_by_key(|warning| warning.line);
        Ok(UrdfReading {
            description,
            warnings: self.warnings,
        })
    }

    /// The line of the element that an error is about, in the document of `robot`.
    fn line_of_subject(&self, robot: Node, error: &DescriptionError) -> Option<u32> {
        let (what, name) = error.subject()?;
        let start = self.starts.get(&(what, name.to_owned()))?;
        Some(line_at(robot, *start))
    }

    fn report(&mut self, node: Node, kind: UrdfErrorKind) {
        self.errors.push(UrdfError {
            line: Some(line_of(node)),
            kind,
        });
    }

    fn warn(&mut self, node: Node, text: String) {
        self.warnings.push(UrdfWarning {
            line: Some(line_of(node)),
            text,
        });
    }

    /// Checks an element for content other than the attributes and children that are read (`once` each) or may be skipped.
    fn check_content(&mut self, node: Node, owner: &str, attributes: &[&str], once: &[&str], skipped: &[&str]) {
        for attribute in node.attributes() {
            let name = attribute.name();
            if attribute.namespace().is_none() && !attributes.contains(&name) {
                let text = format!(
                    "{owner}: {name}=\"{}\" of {} is not modelled",
                    attribute.value(),
                    displayed_name(node)
                );
                self.warn(node, text);
            }
        }
        let mut seen: Vec<&str> = Vec::new();
        for child in node.children().filter(Node::is_element) {
            let name = child.tag_name().name();
            if is_macro(child) {
                let what = displayed_name(child);
                self.report(child, UrdfErrorKind::NotExpanded { what });
            } else if !is_urdf_element(child) {
                let text = format!(
                    "{owner}: {} is of another namespace and is passed over",
                    displayed_name(child)
                );
                self.warn(child, text);
            } else if once.contains(&name) {
                if seen.contains(&name) {
                    let (owner, element) = (owner.to_owned(), displayed_name(child));
                    self.report(child, UrdfErrorKind::Duplicate { owner, element });
                }
                seen.push(name);
            } else if !skipped.contains(&name) {
                let text = format!("{owner}: {} is not modelled and is passed over", displayed_name(child));
                self.warn(child, text);
            }
        }
    }

    fn named(&mut self, what: &'static str, node: Node) -> Option<String> {
        let owner = format!("a <{what}>");
        let name = self.required_attribute(node, &owner, "name")?.to_owned();
        let start = node.range().start;
        self.starts.entry((what, name.clone())).or_insert(start);
        Some(name)
    }

    fn link(&mut self, node: Node) -> Option<Link> {
        let name = self.named("link", node)?;
        let owner = format!("link `{name}`");
        self.check_content(
            node,
            &owner,
            &["name"],
            &["inertial"],
            &["visual", "collision", "contact"],
        );
        let inertia = element(node, "inertial").and_then(|inertial| self.inertia(inertial, &owner));
        Some(Link { name, inertia })
    }

    fn inertia(&mut self, node: Node, owner: &str) -> Option<Inertia> {
        self.check_content(node, owner, &[], &["origin", "mass", "inertia"], &[]);
        let mass = self.required_element(node, owner, "mass").and_then(|mass| {
            self.check_content(mass, owner, &["value"], &[], &[]);
            self.scalar(mass, owner, "value")
        });
        let moments = self.required_element(node, owner, "inertia").map(|inertia| {
            const NAMES: [&str; 6] = ["ixx", "ixy", "ixz", "iyy", "iyz", "izz"];
            self.check_content(inertia, owner, &NAMES, &[], &[]);
            NAMES.map(|name| self.scalar(inertia, owner, name))
        });
        let placement = self.origin(node, owner);
        let [xx, xy, xz, yy, yz, zz] = moments?;
        let (xx, xy, xz, yy, yz, zz) = (xx?, xy?, xz?, yy?, yz?, zz?);
        let inertia = Inertia {
            mass: mass?,
            com: Vector3::zeros(),
            about_com: Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz),
        };
        Some(super::merge::transformed(&inertia, &placement?))
    }

    fn joint(&mut self, node: Node, links: &[Link]) -> Option<Joint> {
        const READ: [&str; 7] = ["parent", "child", "origin", "axis", "limit", "dynamics", "mimic"];
        let name = self.named("joint", node)?;
        let owner = format!("joint `{name}`");
        self.check_content(
            node,
            &owner,
            &["name", "type"],
            &READ,
            &["calibration", "safety_controller"],
        );
        let kind = self.kind(node, &name, &owner);
        let parent = self.joint_link(node, &name, "parent", links);
        let child = self.joint_link(node, &name, "child", links);
        let origin = self.origin(node, &owner);
        let axis = match element(node, "axis") {
            Some(axis) => {
                self.check_content(axis, &owner, &["xyz"], &[], &[]);
                self.vector(axis, &owner, "xyz", Vector3::x())
            }
            None => Some(Vector3::x()), // the format's default
        };
        let limits = self.limits(node, &owner);
        let [damping, friction] = match element(node, "dynamics") {
            Some(dynamics) => {
                self.check_content(dynamics, &owner, &["damping", "friction"], &[], &[]);
                ["damping", "friction"].map(|name| self.optional(dynamics, &owner, name, 0.0))
            }
            None => [Some(0.0); 2],
        };
        let moves = kind.is_some_and(|kind| kind != JointKind::Fixed);
        if let (Some(dynamics), Some(friction)) = (element(node, "dynamics"), friction)
            && moves
            && friction > 0.0
        {
            let text =
                format!("{owner}: friction=\"{friction}\" is not modelled; the joint moves without Coulomb friction");
            self.warn(dynamics, text);
        }
        let mimic = match element(node, "mimic") {
            Some(mimic) if !moves => {
                self.warn(
                    mimic,
                    format!("{owner}: <mimic> on a joint that does not move is passed over"),
                );
                Some(None)
            }
            Some(mimic) => self.mimic(mimic, &owner).map(Some),
            None => Some(None),
        };
        Some(Joint {
            name,
            kind: kind?,
            parent: parent?,
            child: child?,
            origin: origin?,
            axis: unit(axis?),
            limits: limits?,
            damping: damping?,
            friction: friction?,
            stiffness: 0.0,
            rest: 0.0,
            motor_inertia: 0.0,
            mimic: mimic?,
        })
    }

    fn kind(&mut self, node: Node, name: &str, owner: &str) -> Option<JointKind> {
        match self.required_attribute(node, owner, "type")? {
            "fixed" => Some(JointKind::Fixed),
            "revolute" => Some(JointKind::Revolute),
            "continuous" => Some(JointKind::Continuous),
            "prismatic" => Some(JointKind::Prismatic),
            other => {
                let (joint, kind) = (name.to_owned(), other.to_owned());
                self.report(node, UrdfErrorKind::JointType { joint, kind });
                None
            }
        }
    }

    /// The limits of a joint, if it has any; nothing when they are invalid.
    fn limits(&mut self, node: Node, owner: &str) -> Option<Option<Limits>> {
        let Some(limit) = element(node, "limit") else {
            return Some(None);
        };
        let more = ["acceleration", "deceleration", "jerk"]; // no range is enforced
        let names = ["lower", "upper", "velocity", "effort"];
        self.check_content(limit, owner, &[names.as_slice(), &more].concat(), &[], &[]);
        let [lower, upper, velocity, effort] = names.map(|name| self.optional(limit, owner, name, 0.0));
        Some(Some(Limits {
            lower: lower?,
            upper: upper?,
            velocity: velocity?,
            effort: effort?,
        }))
    }

    fn joint_link(&mut self, node: Node, joint: &str, role: &'static str, links: &[Link]) -> Option<usize> {
        let owner = format!("joint `{joint}`");
        let end = self.required_element(node, &owner, role)?;
        self.check_content(end, &owner, &["link"], &[], &[]);
        let link = self.required_attribute(end, &owner, "link")?;
        let found = links.iter().position(|l| l.name == link);
        if found.is_none() {
            let (joint, link) = (joint.to_owned(), link.to_owned());
            self.report(end, UrdfErrorKind::UnknownLink { joint, role, link });
        }
        found
    }

    fn mimic(&mut self, node: Node, owner: &str) -> Option<Mimic> {
        self.check_content(node, owner, &["joint", "multiplier", "offset"], &[], &[]);
        let joint = self.required_attribute(node, owner, "joint").map(str::to_owned);
        let multiplier = self.optional(node, owner, "multiplier", 1.0);
        let offset = self.optional(node, owner, "offset", 0.0);
        Some(Mimic {
            joint: joint?,
            multiplier: multiplier?,
            offset: offset?,
        })
    }

    fn origin(&mut self, node: Node, owner: &str) -> Option<Placement> {
        let Some(origin) = element(node, "origin") else {
            return Some(Placement::identity());
        };
        self.check_content(origin, owner, &["xyz", "rpy", "quat_xyzw"], &[], &[]);
        let p = self.vector(origin, owner, "xyz", Vector3::zeros());
        let r = if origin.has_attribute("quat_xyzw") {
            if origin.has_attribute("rpy") {
                let owner = owner.to_owned();
                self.report(origin, UrdfErrorKind::TwoAttitudes { owner });
                return None;
            }
            self.quaternion(origin, owner)
        } else {
            self.vector(origin, owner, "rpy", Vector3::zeros())
                .map(|rpy| roll_pitch_yaw(rpy.x, rpy.y, rpy.z))
        };
        Some(Placement { p: p?, r: r? })
    }

    fn quaternion(&mut self, node: Node, owner: &str) -> Option<Matrix3<f64>> {
        let [x, y, z, w] = self.numbers(node, owner, "quat_xyzw", "four finite numbers")?;
        let quaternion = Quaternion::from_wxyz([w, x, y, z]);
        if (quaternion.norm_squared() - 1.0).abs() > 2.0 * QUATERNION_SLACK {
            return self.invalid_number(node, owner, "quat_xyzw", "a quaternion of length one, scalar last");
        }
        Some(quaternion.normalized().matrix())
    }

    fn required_element<'a, 'i>(&mut self, node: Node<'a, 'i>, owner: &str, tag: &str) -> Option<Node<'a, 'i>> {
        let found = element(node, tag);
        if found.is_none() {
            let (owner, missing) = (owner.to_owned(), format!("element <{tag}>"));
            self.report(node, UrdfErrorKind::Missing { owner, missing });
        }
        found
    }

    /// The text of a required attribute, which must contain nothing still to be expanded.
    fn required_attribute<'a>(&mut self, node: Node<'a, '_>, owner: &str, attribute: &str) -> Option<&'a str> {
        let Some(text) = node.attribute(attribute) else {
            let missing = format!("attribute {attribute} of {}", displayed_name(node));
            let owner = owner.to_owned();
            self.report(node, UrdfErrorKind::Missing { owner, missing });
            return None;
        };
        if text.contains("${") || text.contains("$(") {
            let what = format!("{attribute}=\"{text}\" of {owner}");
            self.report(node, UrdfErrorKind::NotExpanded { what });
            return None;
        }
        Some(text)
    }

    fn numbers<const N: usize>(
        &mut self,
        node: Node,
        owner: &str,
        attribute: &str,
        what: &'static str,
    ) -> Option<[f64; N]> {
        let text = self.required_attribute(node, owner, attribute)?;
        let numbers: Option<Vec<f64>> = text
            .split_whitespace()
            .map(|word| word.parse().ok().filter(|x: &f64| x.is_finite()))
            .collect();
        match numbers.and_then(|numbers| numbers.try_into().ok()) {
            Some(numbers) => Some(numbers),
            None => self.invalid_number(node, owner, attribute, what),
        }
    }

    fn scalar(&mut self, node: Node, owner: &str, attribute: &str) -> Option<f64> {
        self.numbers::<1>(node, owner, attribute, "one finite number")
            .map(|[x]| x)
    }

    fn optional(&mut self, node: Node, owner: &str, attribute: &str, default: f64) -> Option<f64> {
        if node.has_attribute(attribute) {
            self.scalar(node, owner, attribute)
        } else {
            Some(default)
        }
    }

    fn vector(&mut self, node: Node, owner: &str, attribute: &str, default: Vector3<f64>) -> Option<Vector3<f64>> {
        if !node.has_attribute(attribute) {
            return Some(default);
        }
        self.numbers::<3>(node, owner, attribute, "three finite numbers")
            .map(Vector3::from)
    }

    fn invalid_number<T>(&mut self, node: Node, owner: &str, attribute: &str, expected: &'static str) -> Option<T> {
        let kind = UrdfErrorKind::Number {
            owner: owner.to_owned(),
            attribute: attribute.to_owned(),
            text: node.attribute(attribute).unwrap_or_default().to_owned(),
            expected,
        };
        self.report(node, kind);
        None
    }
}

/// Normalises the axis here for every later use; a zero axis is left to be reported by the check.
fn unit(axis: Vector3<f64>) -> Vector3<f64> {
    let length = axis.norm();
    if length > 0.0 && length.is_finite() && length != 1.0 {
        axis / length
    } else {
        axis
    }
}
