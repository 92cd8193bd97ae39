//! Distributions, each as an inverse distribution function of numbers in (0, 1).

mod inertia;
mod invalid;
mod normal;
mod rotation;
mod scalar;
mod student;
mod vector;

pub use inertia::{Inertia, moments_are_physical};
pub use invalid::InvalidParameter;
pub use normal::{cumulative as normal_cumulative, quantile as normal_quantile};
pub use rotation::{
    Quaternion, compose, from_roll_pitch_yaw, misalignment, random_rotation, roll_pitch_yaw, rotate,
    rotation_from_vector,
};
pub use scalar::{Scalar, Weights};
pub use student::quantile as student_quantile;
pub use vector::{Correlated, in_cone, on_sphere};
