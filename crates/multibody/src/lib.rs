//! Rigid-body algorithms for trees on a floating or fixed base: from URDF, of static size, without allocation, and with
//! the same bits on every machine.
//!
//! ```
//! use multibody::{Description, Method, State, Tree};
//! use nalgebra::SVector;
//!
//! let text = r#"<robot name="pendulum">
//!   <link name="bus"><inertial><mass value="100"/>
//!     <inertia ixx="10" ixy="0" ixz="0" iyy="10" iyz="0" izz="10"/></inertial></link>
//!   <link name="bob"><inertial><origin xyz="0 0 -0.5"/><mass value="3"/>
//!     <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>
//!   <joint name="hinge" type="continuous"><parent link="bus"/><child link="bob"/><axis xyz="0 1 0"/></joint>
//! </robot>"#;
//! let tree = Tree::<1, 7>::new(&Description::from_urdf(text)?)?;
//! let mut state = State::rest();
//! state.nu[6] = 0.3; // rad/s
//! let tau = SVector::zeros();
//! for _ in 0..1000 {
//!     state = tree.step(Method::Rk4, &state, &tau, 1e-3);
//! }
//! let momentum = tree.momentum(&tree.kinematics(&state.q, &state.nu));
//! assert!((momentum.linear_b.norm() - 3.0 * 0.5 * 0.3).abs() < 1e-2);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Notation
//!
//! Monogram notation throughout: `p_AB` is the position of B's origin from A's, in A axes; `R_AB` (`r` in a
//! [`Placement`], `quat_AB` as a quaternion) takes components in B axes to A axes, so neighbouring letters cancel:
//! `p_NE = p_NB + R_NB p_BE`. `omega_AB` is the angular velocity of B relative to A; `v_AB` the velocity of B's origin
//! relative to A. A trailing `_B` names the axes when they are not those of the first letter: `v_NB_B`. N is the inertial
//! world, B the base, L a body, E a frame such as the end effector, C the centre of mass.
//!
//! # Conventions
//!
//! * SI units and radians. Quaternions are Hamilton's, scalar first; `quat_NB` moves by `½ quat ⊗ [0, ω_NB_B]`.
//! * Generalised velocity `ν = [ω_NB; v_NB; q̇]`, both base vectors in B axes and `v_NB` that of B's origin; generalised
//!   force `τ = [torque about B's origin; force; joint torques]`, B axes, so that `τᵀ ν` is power. A fixed base has the
//!   joints alone.
//! * Joint coordinates are in the order of the joints in the description, whatever the topology of the tree.
//! * `M ν̇ + C ν = τ − D q̇ − K (q − q₀)`: C is the Christoffel-consistent factorisation, dampers and springs are on the
//!   right. A reflected motor inertia is added to its joint's diagonal element of M (the rotor's own gyroscopic effect is
//!   neglected, as is usual for high gear ratios).
//! * A body Jacobian has rows `[ω; v]` in the axes of its frame: `J_v ν = [ω_NE; v_NE]`.
//!
//! # Accuracy
//!
//! Everything is computed in base axes about the joints' own origins; neither the position nor the velocity of the base
//! enters the dynamics (see `kernel`), so a base 7,000 km from the world's origin costs no digit. Angles may be large
//! (1e5 rad and beyond). NaN inputs give NaN outputs.
//!
//! # Determinism
//!
//! Only operations that IEEE 754 rounds correctly are used (fused multiply-adds are explicit, and the compiler never
//! contracts by itself); sines and cosines are our own polynomial ([`sin_cos`]). So the same state gives the same bits on
//! every processor, in [`Tree`], [`DynTree`] and in each lane of a batch alike. Compile with FMA enabled
//! (`-C target-cpu=x86-64-v3` on x86-64): without it the same bits come from a software routine, far more slowly.

mod batch;
mod description;
mod dynamic;
mod integrate;
mod kernel;
mod num;
mod reduction;
pub mod rotation;
mod slosh;
mod state;
mod tree;

pub use batch::Trees;
pub use description::{
    Description, DescriptionError, EditError, Inertia, Joint, JointKind, Limits, Link, Mimic, Placement, UrdfError,
    UrdfErrorKind, UrdfErrors, UrdfOptions, UrdfReading, UrdfWarning, read_xml,
};
pub use dynamic::{BodyInfo, Dense, DynState, DynTree};
pub use integrate::{Method, OdeSystem, Rate, UnknownMethod, dop853, rk4};
pub use nalgebra;
pub use num::{Computation, F64x4, ForLanes, Lanes, Number, Real, lanes_max, sin_cos, with_lanes};
pub use rotation::Quaternion;
pub use slosh::{SloshError, SloshRate, SloshState, SloshTree, SphericalSlosh, from_two_hinges};
pub use state::State;
pub use tree::{FrameId, Kinematics, Momentum, Tree, TreeError, UnknownFrame};
