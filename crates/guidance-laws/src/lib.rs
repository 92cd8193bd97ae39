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
//!
//! # Example
//!
//! The set-point at the start of the close capture is the start pose, and after the last instant the grasp frame on the target:
//!
//! ```
//! use guidance_laws::capture::{CaptureGuidance, Input, Parameters, Phase, Schedule};
//! use guidance_laws::{Pose, TargetState};
//!
//! let upright = [1.0, 0.0, 0.0, 0.0];
//! let start = Pose::from_raw([0.0, 0.0, 0.0], upright).unwrap();
//! let grasp = Pose::from_raw([0.0, 0.0, 0.5], upright).unwrap();
//! let target = TargetState::from_raw([1.0, 0.0, 0.0], upright, [0.0; 3], [0.0; 3]).unwrap();
//! let mut guidance = CaptureGuidance::new(Parameters { schedule: Schedule::CLOSE, grasp })?;
//!
//! let mut at = |time_s| guidance.step(&Input { time_s, end_effector: Some(start), target: Some(target) });
//! assert_eq!(at(0.0).phase, Phase::Waiting);
//! let output = at(31.0);
//! assert_eq!(output.phase, Phase::Tracking);
//! assert_eq!(output.set_point.unwrap().pose.position.as_slice(), [1.0, 0.0, 0.5]);
//! # Ok::<(), guidance_laws::ParameterError>(())
//! ```
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
