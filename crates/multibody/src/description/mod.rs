//! A mechanism as its author describes it: named links and joints, every number still editable.
//!
//! A [`Description`] is read from URDF text ([`Description::from_urdf`]), edited by name (freeze a joint, add motor
//! inertia, scale a mass) and then turned into a [`Tree`](crate::Tree) of static size, which can no longer be edited
//! and on which the algorithms run. Fixed joints stay in the description; they disappear, link by link, when the tree
//! is built, and every link keeps its name as a frame.

mod check;
mod digest;
mod edit;
mod merge;
mod urdf;

pub use edit::EditError;
pub(crate) use merge::{Body, Merged, steiner as merge_steiner};
pub use urdf::UrdfError;

use nalgebra::{Matrix3, Vector3};

/// Pose of a frame B in a frame A: `p_AB` (A axes, m) and `R_AB`, so that a point's coordinates map as
/// `p_AP = p_AB + R_AB p_BP`.
#[derive(Clone, Copy, Debug, PartialEq)]
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

/// How a joint moves its child.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JointKind {
    /// Not at all.
    Fixed,
    /// By turning about its axis within limits (rad). The algorithms do not enforce limits.
    Revolute,
    /// By turning about its axis (rad).
    Continuous,
    /// By sliding along its axis (m).
    Prismatic,
}

/// Range, speed and effort a joint is rated for. Carried for those who ask; no algorithm here enforces it.
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

/// A joint between two links.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Name, unique among joints.
    pub name: String,
    /// How it moves.
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
    /// Coulomb friction (N m or N). Carried, not simulated: the equations of motion here are smooth.
    pub friction: f64,
    /// Stiffness of a spring towards `rest` (N m/rad or N/m).
    pub stiffness: f64,
    /// Position at which the spring is relaxed (rad or m).
    pub rest: f64,
    /// Reflected rotor inertia (kg m² or kg), added to the joint's diagonal element of the mass matrix.
    pub motor_inertia: f64,
}

/// A mechanism: one tree of links. The root link is the base.
#[derive(Clone, Debug, PartialEq)]
pub struct Description {
    /// Name of the mechanism.
    pub name: String,
    /// The links, in the order of the file.
    pub links: Vec<Link>,
    /// The joints, in the order of the file. The moving ones, in this order, are the joint coordinates.
    pub joints: Vec<Joint>,
}

impl Description {
    /// One rigid body with no joints: what a torque-free target is.
    pub fn rigid_body(name: &str, inertia: Inertia) -> Result<Self, DescriptionError> {
        let link = Link {
            name: name.to_owned(),
            inertia: Some(inertia),
        };
        let it = Self {
            name: name.to_owned(),
            links: vec![link],
            joints: Vec::new(),
        };
        it.validate()?;
        Ok(it)
    }

    /// The moving joints, in coordinate order.
    pub fn moving_joints(&self) -> impl Iterator<Item = &Joint> {
        self.joints.iter().filter(|j| j.kind != JointKind::Fixed)
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

/// Why a description is not a mechanism. Every variant names the link or joint at fault.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DescriptionError {
    /// There is no link.
    #[error("the description has no link; a mechanism needs at least a base")]
    Empty,
    /// Two links or two joints share a name.
    #[error("two {what}s are called `{name}`; names must be unique")]
    DuplicateName {
        /// `link` or `joint`.
        what: &'static str,
        /// The shared name.
        name: String,
    },
    /// A link is the child of two joints.
    #[error("not a tree: link `{link}` is the child of both joint `{first}` and joint `{second}`; remove one of them")]
    TwoParents {
        /// The link.
        link: String,
        /// One joint.
        first: String,
        /// The other joint.
        second: String,
    },
    /// There is more than one root.
    #[error("not a tree: links `{first}` and `{second}` both have no parent joint; connect one below the other")]
    TwoRoots {
        /// One root.
        first: String,
        /// The other root.
        second: String,
    },
    /// Links form a loop.
    #[error("not a tree: link `{link}` is its own ancestor (through joint `{joint}`); cut the loop")]
    Loop {
        /// A link of the loop.
        link: String,
        /// The joint that leads to it.
        joint: String,
    },
    /// An axis has no direction.
    #[error("joint `{joint}`: the axis [{x} {y} {z}] has no direction; give a vector of finite, non-zero length")]
    Axis {
        /// The joint.
        joint: String,
        /// The axis as given.
        x: f64,
        /// The axis as given.
        y: f64,
        /// The axis as given.
        z: f64,
    },
    /// A rotation is not one.
    #[error(
        "joint `{joint}`: the origin's rotation is not orthonormal (off by {off:e}); pass a proper rotation matrix"
    )]
    Rotation {
        /// The joint.
        joint: String,
        /// Largest element of `RᵀR − 1`, or 1 if the determinant is negative.
        off: f64,
    },
    /// A number is not finite.
    #[error("{what} `{name}`: {field} is {value}; it must be a finite number")]
    NotFinite {
        /// `link` or `joint`.
        what: &'static str,
        /// Which.
        name: String,
        /// Which number.
        field: &'static str,
        /// Its value.
        value: f64,
    },
    /// A number that cannot be negative is.
    #[error("{what} `{name}`: {field} is {value}; it cannot be negative")]
    Negative {
        /// `link` or `joint`.
        what: &'static str,
        /// Which.
        name: String,
        /// Which number.
        field: &'static str,
        /// Its value.
        value: f64,
    },
    /// An inertia has a negative principal moment.
    #[error("link `{link}`: the inertia is not positive: its smallest principal moment is {moment:e} kg m²")]
    InertiaNotPositive {
        /// The link.
        link: String,
        /// The smallest principal moment.
        moment: f64,
    },
    /// An inertia violates the triangle inequality.
    #[error(
        "link `{link}`: no distribution of mass has these principal moments: {large:e} > {small:e} + {middle:e} kg m² \
         (triangle inequality); check units and axes"
    )]
    Triangle {
        /// The link.
        link: String,
        /// Smallest principal moment.
        small: f64,
        /// Middle principal moment.
        middle: f64,
        /// Largest principal moment.
        large: f64,
    },
    /// A body that moves on its own has no inertia given for any of its links.
    #[error(
        "link `{link}` moves on its own (by joint `{joint}`) but neither it nor anything fixed to it has an <inertial>; \
         add one (mass 0 is allowed for an intermediate body) or make the joint fixed"
    )]
    MissingInertial {
        /// The link.
        link: String,
        /// The joint that moves it, or `floating base`.
        joint: String,
    },
}
