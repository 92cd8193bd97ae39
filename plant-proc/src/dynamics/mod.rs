//! Dynamics of the servicer, with a conservation ledger of momentum and energy.

mod batch;
mod bodies;
mod constraint;
mod coordinates;
mod ledger;
mod mechanics;
mod model;
mod motion;
mod slosh_model;
mod spherical_pendulum;

pub use batch::{PackedModels, SteppedPlant, pack_models};
pub use bodies::BodyQuantities;
pub use constraint::stop_joints;
pub use coordinates::{COORDINATES, Generalised, Servicer, Target, TargetTree, Tree, VELOCITIES};
pub use ledger::{Ledger, Totals};
pub use mechanics::Mechanics;
pub use model::{Grasp, Model, quaternion_of};
pub use motion::{Forces, Motion};
pub use slosh_model::SloshModel;
pub use spherical_pendulum::Bob;
