//! Editable description of a mechanism: named links and joints.
//!
//! A [`Description`] is read from URDF text ([`Description::from_urdf`]), edited by name (freeze a joint, add motor
//! inertia, scale a mass) and then converted to a [`Tree`](crate::Tree) of static size, which can no longer be edited
//! and on which the algorithms run. Fixed joints stay in the description; they are merged when the tree is built, and
//! every link keeps its name as a frame.

mod check;
mod digest;
mod edit;
mod error;
mod mechanism;
mod merge;
mod mimic;
mod urdf;

pub use edit::EditError;
pub use error::DescriptionError;
pub use mechanism::{Description, Inertia, Joint, JointKind, Limits, Link, Mimic, Placement};
pub(crate) use merge::{Body, Merged, steiner as merge_steiner};
pub(crate) use mimic::JointCoupling;
pub use urdf::{UrdfError, UrdfErrorKind, UrdfErrors, UrdfOptions, UrdfReading, UrdfWarning, read_xml};
