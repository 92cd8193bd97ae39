//! The target satellite.

use lockstep::participant::ParameterError;
use lockstep::units::{Angle, Inertia, Length, Mass, PerAxis, Quantity, QuantityKind, Vector};
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

impl Target {
    /// Rejects a body that does not exist: both equations of motion, of translation and of rotation, need an inertia above
    /// zero.
    ///
    /// # Errors
    /// Names the key below `target`, its value and the remedy.
    pub fn validate(&self) -> Result<(), ParameterError> {
        above_zero::<Mass>("target.mass", "", self.mass.si())?;
        for (moment, axis) in self.inertia.si().into_iter().zip([" about x", " about y", " about z"]) {
            above_zero::<Inertia>("target.inertia", axis, moment)?;
        }
        Ok(())
    }
}

fn above_zero<K: QuantityKind>(key: &str, axis: &str, value: f64) -> Result<(), ParameterError> {
    if value > 0.0 {
        return Ok(());
    }
    let reason = format!(
        "{}{axis} is not above zero; write for example \"{}\"",
        K::text(value),
        K::EXAMPLE
    );
    Err(ParameterError::new(key, reason))
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
