//! Model files: what plant, controller and guidance each read of the same servicer and the same target.

mod servicer;
mod target;

pub use servicer::{Arm, Servicer, Slosh};
pub use target::{Frame, Target};
