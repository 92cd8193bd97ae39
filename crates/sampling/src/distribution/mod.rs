//! Distributions, each as the value that belongs to numbers in (0, 1).

mod inertia;
mod normal;
mod rotation;
mod scalar;
mod vector;

pub use inertia::{Inertia, moments_are_physical};
pub use normal::{cumulative as normal_cumulative, quantile as normal_quantile};
pub use rotation::{
    Quaternion, compose, from_roll_pitch_yaw, misalignment, random_rotation, roll_pitch_yaw, rotate, small_rotation,
};
pub use scalar::{Scalar, Weights};
pub use vector::{Correlated, in_cone, on_sphere};

/// A distribution that there is not.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Impossible {
    /// The parameter that is wrong, as [`Scalar`] and the others call it.
    pub parameter: &'static str,
    /// What is wrong with it.
    pub reason: String,
}

fn impossible(parameter: &'static str, reason: impl Into<String>) -> Impossible {
    Impossible {
        parameter,
        reason: reason.into(),
    }
}
