//! Values for each kind of channel, in the order of the generalised velocity.

use control_laws::{Dof, JOINTS};

/// Base rotation, base translation and joints in the order of the generalised velocity.
pub fn channels(rotation: [f64; 3], translation: [f64; 3], joints: [f64; JOINTS]) -> Dof {
    Dof::from_iterator(rotation.into_iter().chain(translation).chain(joints))
}
