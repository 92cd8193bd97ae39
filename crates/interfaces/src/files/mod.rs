//! Model files: data of the servicer and the target shared by plant, controller and guidance.

mod servicer;
mod target;

pub use servicer::{Arm, Servicer, Slosh};
pub use target::{Frame, Target};
