//! Guidance and navigation laws for the capture of a tumbling target: values in, values out.
//!
//! | module | what it computes |
//! |---|---|
//! | [`capture`] | the set-point of the end effector, from its start to the grasp point on the moving target |
//! | [`comparison`] | the comparison guidance: fixed instants, and a set-point for the base as well |
//! | [`navigation`] | the target's motion from a noisy camera pose that arrives late |
//! | [`target`] | motion of a torque-free rigid body, and of a grasp frame fixed in it |
//! | [`set_point`] | pose and twist to follow, and its propagation between two guidance samples |
//! | [`profile`], [`so3`] | the quintic time law; exponential, logarithm and Jacobians of rotations |
//!
//! # Conventions
//!
//! SI units and radians. `N` is the inertial world, `E` the end effector, `T` the target body, `G` the grasp frame fixed in `T`,
//! `B` the servicer's base. `p_NE` is the position of `E` in world axes, `R_NE` turns `E` axes into world axes, `v_NE` is a velocity
//! in world axes, `w_NE_E` an angular velocity in `E` axes. Quaternions are Hamilton, scalar first in every array.
//!
//! # What a law is
//!
//! A law is a struct built by `new` from validated parameters and advanced by `step`. It uses no process, file, clock or log and
//! does not allocate. Its complete state is returned by `state()` as plain arrays; `from_state` continues bit for bit.
//! Sines and exponentials come from `libm`, so the same inputs give the same bits on every machine.
#![allow(non_snake_case)] // monogram notation: `p_NE`, `R_NE` read like the equations they implement

pub mod capture;
pub mod comparison;
mod error;
pub mod navigation;
pub mod profile;
pub mod set_point;
pub mod so3;
pub mod target;

pub use error::ParameterError;
pub use set_point::{InterSample, Pose, SetPoint};
pub use target::TargetState;
