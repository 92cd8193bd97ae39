//! Errors and warnings of a URDF, with their lines.

use super::super::DescriptionError;
use core::fmt;

/// All errors in a text, in line order. Displayed as one error per line.
#[derive(Clone, Debug, PartialEq)]
pub struct UrdfErrors(pub(super) Vec<UrdfError>);

impl UrdfErrors {
    /// The errors; at least one.
    pub fn iter(&self) -> impl Iterator<Item = &UrdfError> {
        self.0.iter()
    }
}

impl fmt::Display for UrdfErrors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (at, error) in self.0.iter().enumerate() {
            let end = if at + 1 < self.0.len() { "\n" } else { "" };
            write!(f, "{error}{end}")?;
        }
        Ok(())
    }
}

impl std::error::Error for UrdfErrors {}

/// One error in a text.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{}{kind}", line_prefix(*.line))]
pub struct UrdfError {
    /// The line, from 1; `None` for an error of the whole text.
    pub line: Option<u32>,
    /// The error.
    pub kind: UrdfErrorKind,
}

/// Content of a text that the dynamics ignore, or that is odd but readable.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UrdfWarning {
    /// The line, from 1; `None` for the whole text.
    pub line: Option<u32>,
    /// The content, and how it is treated.
    pub text: String,
}

impl fmt::Display for UrdfWarning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}", line_prefix(self.line), self.text)
    }
}

fn line_prefix(line: Option<u32>) -> String {
    line.map_or_else(String::new, |line| format!("line {line}: "))
}

/// The error.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum UrdfErrorKind {
    /// Not XML.
    #[error("not well-formed XML: {0}")]
    Xml(String),
    /// The root element is not `<robot>`.
    #[error("the root element is {found}; a URDF starts with <robot name=\"…\">")]
    NotARobot {
        /// The element found.
        found: String,
    },
    /// An element or attribute is missing.
    #[error("{owner}: {missing} is missing")]
    Missing {
        /// The link or joint.
        owner: String,
        /// The missing element or attribute.
        missing: String,
    },
    /// An element that may occur only once.
    #[error("{owner}: a second {element}; give one")]
    Duplicate {
        /// The link or joint.
        owner: String,
        /// The element.
        element: String,
    },
    /// An attribute is not the number or numbers expected.
    #[error("{owner}: {attribute}=\"{text}\" must be {expected}")]
    Number {
        /// The link or joint.
        owner: String,
        /// The attribute.
        attribute: String,
        /// Its text.
        text: String,
        /// The expected content.
        expected: &'static str,
    },
    /// An attitude given in two ways.
    #[error("{owner}: <origin> has both rpy and quat_xyzw; give one")]
    TwoAttitudes {
        /// The link or joint.
        owner: String,
    },
    /// The text must be expanded first.
    #[error(
        "{what} is not expanded, so what it stands for is missing; expand the file with `xacro FILE.xacro > FILE.urdf`"
    )]
    NotExpanded {
        /// The element or text.
        what: String,
    },
    /// A joint names a link that does not exist.
    #[error("joint `{joint}`: its {role} link `{link}` is not defined in this file")]
    UnknownLink {
        /// The joint.
        joint: String,
        /// `parent` or `child`.
        role: &'static str,
        /// The name.
        link: String,
    },
    /// A joint type the kernels have no equations for.
    #[error(
        "joint `{joint}`: type `{kind}` is not supported; use revolute, continuous, prismatic or fixed (the base floats by itself, and \
         a planar joint is two prismatic and one revolute joint)"
    )]
    JointType {
        /// The joint.
        joint: String,
        /// The type.
        kind: String,
    },
    /// The text is a URDF but does not describe a mechanism.
    #[error(transparent)]
    Description(#[from] DescriptionError),
}

impl UrdfErrorKind {
    /// Whether the error is a physically impossible body: [`UrdfOptions::allow_unphysical`](super::UrdfOptions) accepts it.
    pub fn is_unphysical(&self) -> bool {
        use DescriptionError::{InertiaNotPositive, InertiaWithoutMass, Negative, Triangle};
        match self {
            Self::Description(InertiaNotPositive { .. } | InertiaWithoutMass { .. } | Triangle { .. }) => true,
            Self::Description(Negative { what, .. }) => *what == "link",
            _ => false,
        }
    }
}
