//! The coordinates of the servicer and of the target.

/// Joint coordinates: arm and pendulum.
pub const COORDINATES: usize = interfaces::JOINTS + interfaces::SLOSH;
/// Velocity coordinates: the base's six, then the joints'.
pub const VELOCITIES: usize = 6 + COORDINATES;

/// The servicer's tree.
pub type Tree = multibody::Tree<COORDINATES, VELOCITIES>;
/// State of the servicer.
pub type Servicer = multibody::State<COORDINATES, VELOCITIES>;
/// Generalised velocity or force.
pub type Generalised = nalgebra::SVector<f64, VELOCITIES>;
/// The target's tree: one body.
pub type TargetTree = multibody::Tree<0, 6>;
/// State of the target.
pub type Target = multibody::State<0, 6>;
