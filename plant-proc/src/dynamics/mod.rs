//! Dynamics of the servicer, with a conservation ledger of momentum and energy.

mod abreast;
mod bodies;
mod constraint;
mod coordinates;
mod flow;
mod ledger;
mod model;
mod motion;
mod slosh_model;
mod sphere;

pub use abreast::{Models, Under};
pub use bodies::Bodies;
pub use constraint::stop_joints;
pub use coordinates::{COORDINATES, Generalised, Servicer, Target, TargetTree, Tree, VELOCITIES};
pub use flow::Mechanics;
pub use ledger::{Ledger, Totals};
pub use model::{Grasp, Model, quaternion_of};
pub use motion::{Forces, Motion};
pub use slosh_model::SloshModel;
pub use sphere::Bob;
