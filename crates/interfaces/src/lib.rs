//! The stock interfaces of the capture: messages, and the model files that several participants read.
//!
//! # Messages
//!
//! Every field carries its unit and, for a vector, the frame of its components. Notation: `p_NB_N` is the position of B
//! from N's origin in N axes; `quat_NB` (Hamilton, scalar first) turns B components into N components; `omega_NB_B` is the
//! angular velocity of B against N in B axes; `v_NB_B` the velocity of B's origin in B axes. N is the inertial world with
//! the target's initial centre of mass as origin, B the servicer's base, E its end effector, T the target body, G the grasp
//! frame fixed in T, D a desired frame.
//!
//! **A message of zeros means "nothing received yet"**: its quaternion has zero norm and is no attitude. A link delivers this
//! message before the first sample unless the scenario specifies otherwise, and every consumer must handle it.
//!
//! # Model files
//!
//! [`files`] holds the data of servicer and target that plant, controller and guidance all read, so that one file serves all
//! of them.

pub mod files;
mod messages;

pub use messages::*;

/// Joints of the arm.
pub const JOINTS: usize = 7;
/// Joint coordinates of the pendulum that models the propellant.
pub const SLOSH: usize = 2;
