//! Links, joints and the mechanism that they form.

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use super::error::DescriptionError;

/// Pose of a frame B in a frame A: `p_AB` (A axes, m) and `R_AB`, so that a point's coordinates map as
/// `p_AP = p_AB + R_AB p_BP`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Placement {
    /// Position of B's origin in A axes (m).
    pub p: Vector3<f64>,
    /// Rotation that takes components in B axes to components in A axes.
    pub r: Matrix3<f64>,
}

impl Placement {
    /// A and B coincide.
    pub fn identity() -> Self {
        Self {
            p: Vector3::zeros(),
            r: Matrix3::identity(),
        }
    }

    /// Pose of C in A from the pose of B in A (`self`) and of C in B.
    pub fn then(&self, c: &Placement) -> Placement {
        Placement {
            p: self.p + self.r * c.p,
            r: self.r * c.r,
        }
    }
}

/// Mass, centre of mass and rotational inertia of a link, in the link's own axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inertia {
    /// Mass (kg).
    pub mass: f64,
    /// Centre of mass from the link origin, link axes (m).
    pub com: Vector3<f64>,
    /// Inertia about the centre of mass, link axes (kg m²).
    pub about_com: Matrix3<f64>,
}

impl Inertia {
    /// No mass at all.
    pub fn zero() -> Self {
        Self {
            mass: 0.0,
            com: Vector3::zeros(),
            about_com: Matrix3::zeros(),
        }
    }
}

/// A link: a name and, unless it is only a frame, an inertia.
#[derive(Clone, Debug, PartialEq)]
pub struct Link {
    /// Name, unique among links.
    pub name: String,
    /// `None` when the file has no `<inertial>` for it.
    pub inertia: Option<Inertia>,
}

/// Motion of the child relative to the parent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JointKind {
    /// No motion.
    Fixed,
    /// Rotation about its axis within limits (rad). The algorithms do not enforce limits.
    Revolute,
    /// Rotation about its axis (rad).
    Continuous,
    /// Translation along its axis (m).
    Prismatic,
}

/// Rated range, speed and effort of a joint. Stored for the caller; no algorithm here enforces them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Smallest position (rad or m).
    pub lower: f64,
    /// Largest position (rad or m).
    pub upper: f64,
    /// Largest speed (rad/s or m/s).
    pub velocity: f64,
    /// Largest torque or force (N m or N).
    pub effort: f64,
}

/// How a joint follows another: its position is `multiplier · q + offset` of the other's position q.
#[derive(Clone, Debug, PartialEq)]
pub struct Mimic {
    /// Name of the joint it follows, which may itself follow a third.
    pub joint: String,
    /// Ratio of the rates (rad or m for each rad or m of the other joint).
    pub multiplier: f64,
    /// Position while the other is at zero (rad or m).
    pub offset: f64,
}

/// A joint between two links.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Name, unique among joints.
    pub name: String,
    /// Joint type.
    pub kind: JointKind,
    /// Index of the parent in [`Description::links`].
    pub parent: usize,
    /// Index of the child in [`Description::links`].
    pub child: usize,
    /// Pose of the joint frame in the parent link at position zero; the child's frame coincides with it there.
    pub origin: Placement,
    /// Unit axis in joint axes; ignored for a fixed joint.
    pub axis: Vector3<f64>,
    /// Rated range, if the file gives one.
    pub limits: Option<Limits>,
    /// Viscous damping (N m s/rad or N s/m); the damper's force is `−damping · rate`.
    pub damping: f64,
    /// Coulomb friction (N m or N). Stored, not simulated: the equations of motion here are smooth.
    pub friction: f64,
    /// Stiffness of a spring towards `rest` (N m/rad or N/m).
    pub stiffness: f64,
    /// Position at which the spring is relaxed (rad or m).
    pub rest: f64,
    /// Reflected rotor inertia (kg m² or kg), added to the joint's diagonal element of the mass matrix.
    pub motor_inertia: f64,
    /// The joint that this one follows, if it has no independent coordinate.
    pub mimic: Option<Mimic>,
}

/// A mechanism: one tree of links. The root link is the base.
#[derive(Clone, Debug, PartialEq)]
pub struct Description {
    /// Name of the mechanism.
    pub name: String,
    /// The links, in the order of the file.
    pub links: Vec<Link>,
    /// The joints, in the order of the file. The moving ones that follow no other are, in this order, the joint coordinates.
    pub joints: Vec<Joint>,
    /// Accepts physically impossible bodies: a negative mass or moment, or principal moments that violate the triangle inequality.
    pub allow_unphysical: bool,
}

impl Joint {
    /// Whether the joint moves and follows no other joint.
    pub fn has_coordinate(&self) -> bool {
        self.kind != JointKind::Fixed && self.mimic.is_none()
    }
}

impl Description {
    /// One rigid body without joints, such as a torque-free target.
    pub fn rigid_body(name: &str, inertia: Inertia) -> Result<Self, DescriptionError> {
        let link = Link {
            name: name.to_owned(),
            inertia: Some(inertia),
        };
        let it = Self {
            name: name.to_owned(),
            links: vec![link],
            joints: Vec::new(),
            allow_unphysical: false,
        };
        it.validate()?;
        Ok(it)
    }

    /// The moving joints with an independent coordinate, in coordinate order: not those that follow another.
    pub fn moving_joints(&self) -> impl Iterator<Item = &Joint> {
        self.joints.iter().filter(|j| j.has_coordinate())
    }

    /// Number of joint coordinates.
    pub fn dof(&self) -> usize {
        self.moving_joints().count()
    }

    /// Sum of the masses (kg).
    pub fn total_mass(&self) -> f64 {
        self.links.iter().filter_map(|l| l.inertia).map(|i| i.mass).sum()
    }
}
