//! The target satellite.

use lockstep::units::{Angle, Inertia, Length, Mass, PerAxis, Quantity, Vector};
use serde::Deserialize;

/// The target: a rigid body, its frame T at the centre of mass along the principal axes.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Target {
    /// Mass.
    pub mass: Quantity<Mass>,
    /// Principal moments of inertia about x, y and z of T.
    pub inertia: PerAxis<Inertia, 3>,
    /// The grasp frame G in T.
    pub grasp: Frame,
}

/// Pose of a frame in its parent.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Frame {
    /// Origin, parent axes.
    pub position: Vector<Length, 3>,
    /// Roll, pitch and yaw: rotations about the fixed parent axes x, y and z in this order. Aligned by default.
    #[serde(default = "aligned")]
    pub attitude: Vector<Angle, 3>,
}

fn aligned() -> Vector<Angle, 3> {
    Vector::of([0.0; 3])
}
