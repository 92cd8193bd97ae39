//! Errors of a description that is not a mechanism.

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
    /// A rotation matrix is not orthonormal.
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
        /// Its name.
        name: String,
        /// Name of the number.
        field: &'static str,
        /// Its value.
        value: f64,
    },
    /// A number is negative but must not be.
    #[error("{what} `{name}`: {field} is {value}; it cannot be negative")]
    Negative {
        /// `link` or `joint`.
        what: &'static str,
        /// Its name.
        name: String,
        /// Name of the number.
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
    /// A body without mass has an inertia.
    #[error(
        "link `{link}`: the mass is zero, but the inertia is not (its largest principal moment is {moment:e} kg m²); no \
         distribution of mass has that: give both, or set both to zero for an intermediate body"
    )]
    InertiaWithoutMass {
        /// The link.
        link: String,
        /// The largest principal moment.
        moment: f64,
    },
    /// The sum of all masses is beyond what a number can hold.
    #[error("the links' masses add up to {value} kg; the sum must be a finite number: check their units")]
    TotalMass {
        /// The sum.
        value: f64,
    },
    /// The range of a joint has no position in it.
    #[error(
        "joint `{joint}`: the limits are lower=\"{lower}\" and upper=\"{upper}\"; the lower one must not be above the \
         upper one"
    )]
    Range {
        /// The joint.
        joint: String,
        /// The lower limit.
        lower: f64,
        /// The upper limit.
        upper: f64,
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
    /// A joint cannot follow the joint it mimics.
    #[error("joint `{joint}` mimics `{leader}`, {reason}")]
    Mimic {
        /// The joint.
        joint: String,
        /// The joint it names.
        leader: String,
        /// The reason, and the remedy.
        reason: &'static str,
    },
}

impl DescriptionError {
    /// Subject of the error: `link` or `joint`, and its name; `None` for the whole mechanism.
    pub fn subject(&self) -> Option<(&'static str, &str)> {
        Some(match self {
            Self::Empty | Self::TotalMass { .. } => return None,
            Self::DuplicateName { what, name }
            | Self::NotFinite { what, name, .. }
            | Self::Negative { what, name, .. } => (*what, name),
            Self::TwoParents { second: joint, .. }
            | Self::Loop { joint, .. }
            | Self::Axis { joint, .. }
            | Self::Rotation { joint, .. }
            | Self::Range { joint, .. }
            | Self::Mimic { joint, .. } => ("joint", joint),
            Self::TwoRoots { second: link, .. }
            | Self::InertiaNotPositive { link, .. }
            | Self::InertiaWithoutMass { link, .. }
            | Self::Triangle { link, .. }
            | Self::MissingInertial { link, .. } => ("link", link),
        })
    }
}
