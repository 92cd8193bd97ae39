//! Control laws for a free-flying servicer with a seven-joint arm: values in, values out.
//!
//! | module | what it computes |
//! |---|---|
//! | [`hierarchical`] | the two-level law: outer loop, shaping filter, inner loop, model feed-forward |
//! | [`outer`] | pose errors of the end effector to a virtual velocity (attitude error, weights, pseudoinverse) |
//! | [`inner`] | velocity error to a bounded feedback force (conditional integrator, PI, P) |
//! | [`filter`] | virtual velocity to virtual acceleration |
//! | [`tracker`] | the two above and the model feed-forward: virtual velocity to force |
//! | [`model`] | the control model: kinematics of the end effector and the feed-forward force |
//! | [`avoidance`] | avoidance of joint limits and of the straight elbow, in the null space |
//! | [`allocation`] | allocation of the base's torque to wheels and thrusters |
//! | [`comparison`] | the comparison law: separate set-points for base and arm |
//! | [`stabilise`] | after the capture: servicer and target brought to rest within every limit |
//!
//! # Conventions
//!
//! SI units and radians. Generalised velocity `[w_NB in B axes (3); v_NB in B axes (3); joint rates (7)]`; a generalised force has the
//! same order: `[torque about B's origin; force; joint torques]`. Twists are `[w; v]` in end-effector axes. Quaternions are Hamilton,
//! scalar first in every array.
//!
//! "Eq n" is the numbering of P. Bruschi, *A Hierarchical Control Architecture for Space Robots in On-Orbit Servicing Operations* (2025).
//!
//! # What a law is
//!
//! A law is a struct built by `new` from validated parameters and advanced by `step`. It uses no process, file, clock or log, and `step`
//! does not allocate. Its complete state is returned by `state()` as plain arrays; `from_state` continues bit for bit. All matrices have
//! static sizes and sines come from `libm`, so the same inputs give the same bits on every machine.
//!
//! # Example
//!
//! A wheel gives at most 0.25 N m, so that the thruster couples give the rest of a torque about x:
//!
//! ```
//! use control_laws::Dof;
//! use control_laws::allocation::{Allocation, AllocationParameters};
//! use nalgebra::Vector3;
//!
//! let parameters = AllocationParameters {
//!     wheel_torque_nm: Vector3::repeat(0.25),
//!     wheel_momentum_nms: Vector3::repeat(12.0),
//!     thruster_force_n: Vector3::repeat(9.0),
//!     lever_arm_m: Vector3::repeat(0.5),
//!     unload_rate_1_s: 0.0,
//!     unload_above_nms: 6.0,
//! };
//! let mut command = Dof::zeros();
//! command[0] = 1.0;
//! let allocation = Allocation::of(Some(&parameters), &command, &Vector3::zeros());
//! assert_eq!(allocation.wheel_torque.x, 0.25);
//! assert_eq!(allocation.thruster_torque.x, 0.75);
//! assert_eq!(allocation.missing_torque, Vector3::zeros());
//! ```
#![allow(non_snake_case)] // monogram notation: `p_NE`, `R_NE` read like the equations they implement

pub mod allocation;
pub mod avoidance;
pub mod comparison;
mod dof;
pub mod filter;
pub mod hierarchical;
pub mod inner;
mod measured;
pub mod model;
pub mod outer;
pub mod stabilise;
pub mod tracker;

pub use comparison::ComparisonLaw;
pub use dof::{DOF, Dof, JOINTS, Jacobian, Matrix13, Twist};
pub use guidance_laws::ParameterError;
pub use hierarchical::HierarchicalLaw;
pub use measured::Measured;
pub use model::{ControlModel, ModelOptions, Payload};
pub use stabilise::StabilisingLaw;
