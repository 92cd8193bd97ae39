//! Constants of the recursions, computed from a description, for a tree of any size.

use crate::description::{Body, Description, DescriptionError, JointCoupling, Merged};
use crate::kernel::jacobian::FrameConsts;
use crate::kernel::{BASE, Link, Rigid};
use nalgebra::Matrix3;

/// A frame of one tree, found by name with [`Tree::frame`](crate::Tree::frame).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameId(pub(crate) usize);

/// Errors of building a tree.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TreeError {
    /// The description is not a mechanism.
    #[error(transparent)]
    Description(#[from] DescriptionError),
    /// The type has a different number of joints.
    #[error(
        "`{name}` has {found} moving joints ({joints}) but the tree's type is for {expected}; freeze some, or use Tree<{found}, …>"
    )]
    Count {
        /// The mechanism.
        name: String,
        /// Joints it has.
        found: usize,
        /// Joints the type has.
        expected: usize,
        /// Their names.
        joints: String,
    },
    /// The type's algorithms do not support joints that follow others.
    #[error(
        "joint `{joint}` mimics `{leader}`: a tree of static size has no joints that follow others; make `{joint}` fixed in the URDF (or use DynTree, in code)"
    )]
    Mimic {
        /// The joint.
        joint: String,
        /// The joint it follows.
        leader: String,
    },
    /// Forward dynamics has no solution: a part moves without inertia.
    #[error("{what} moves no inertia, so its acceleration is not determined; {remedy}")]
    NoInertia {
        /// The joint (with its link), or the base.
        what: String,
        /// The remedy.
        remedy: &'static str,
    },
}

/// No frame of that name.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("there is no frame or link `{name}`; there are: {known}")]
pub struct UnknownFrame {
    /// The requested name.
    pub name: String,
    /// The existing names.
    pub known: String,
}

/// The constants of a mechanism of any size.
#[derive(Clone, Debug)]
pub(crate) struct Constants {
    pub base_name: String,
    pub base: Rigid,
    pub bodies: Vec<Link>,
    pub body_names: Vec<(String, String)>,
    pub frames: Vec<FrameConsts>,
    pub frame_names: Vec<String>,
    /// Source of each joint's position, when some follow others.
    pub couplings: Option<Vec<JointCoupling>>,
}

impl Constants {
    pub(crate) fn new(d: &Description) -> Result<Self, DescriptionError> {
        let m = Merged::new(d)?;
        let link = |b: &Body| Link {
            parent: b.parent.map_or(BASE, |p| p + 1),
            coordinate: b.coordinate,
            prismatic: b.prismatic,
            e: columns(&b.placement.r),
            p: b.placement.p.into(),
            rigid: Rigid::new(&b.inertia),
            motor_inertia: b.motor_inertia,
            damping: b.damping,
            stiffness: b.stiffness,
            rest: b.rest,
        };
        Ok(Self {
            base: Rigid::new(&m.base),
            bodies: m.bodies.iter().map(link).collect(),
            body_names: m.bodies.iter().map(|b| (b.joint.clone(), b.name.clone())).collect(),
            frames: m
                .frames
                .iter()
                .map(|f| FrameConsts {
                    body: f.body.map_or(BASE, |b| b + 1),
                    r: columns(&f.placement.r),
                    p: f.placement.p.into(),
                })
                .collect(),
            frame_names: m.frames.into_iter().map(|f| f.name).collect(),
            base_name: m.base_name,
            couplings: m.couplings,
        })
    }

    pub(crate) fn frame(&self, name: &str) -> Result<FrameId, UnknownFrame> {
        find_frame(&self.frame_names, name)
    }
}

pub(crate) fn find_frame(names: &[String], name: &str) -> Result<FrameId, UnknownFrame> {
    match names.iter().position(|n| n == name) {
        Some(i) => Ok(FrameId(i)),
        None => Err(UnknownFrame {
            name: name.to_owned(),
            known: names.join(", "),
        }),
    }
}

fn columns(r: &Matrix3<f64>) -> [[f64; 3]; 3] {
    [0, 1, 2].map(|c| [r[(0, c)], r[(1, c)], r[(2, c)]])
}
