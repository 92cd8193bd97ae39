//! Structured H-infinity tuning and mu analysis, for plants of any kind.
//!
//! ```
//! use synthesis::matrices::PlantMatrices;
//! use synthesis::tuner::{Options, SearchControl, tune};
//!
//! // ẋ = −2 x + w + u, z = (x, u), y = x: the best static gain is −1/2, with gamma = 1/√5.
//! let plant = PlantMatrices {
//!     name: "example".into(),
//!     a: vec![vec![-2.0]],
//!     b1: vec![vec![1.0]],
//!     b: vec![vec![1.0]],
//!     c1: vec![vec![1.0], vec![0.0]],
//!     c: vec![vec![1.0]],
//!     d12: vec![vec![0.0], vec![1.0]],
//!     ..PlantMatrices::default()
//! };
//! let tuned = tune(&plant.static_output_feedback()?, &Options::default(), &|_progress| SearchControl::Continue)?;
//! assert!((tuned.evaluation.gamma - 0.2f64.sqrt()).abs() < 1e-6);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! | module | contents |
//! |---|---|
//! | [`linalg`], [`state_space`], [`interconnect`], [`delay`], [`balance`], [`reduce`] | matrices, systems and their algebra |
//! | [`norm`] | the exact H-infinity norm |
//! | [`tuner`] | structured gains over several models and channels, with an optimality certificate |
//! | [`full_order`] | the optimum of unstructured controllers |
//! | [`mu`] | robust stability margins: proofs for all frequencies, and perturbations |
//! | [`matrices`] | a plant from matrices in a file |
//! | [`robot`] | the velocity loop of a free-flying robot: specification, plant, margins, sampled loop, adversary |
//!
//! Conventions: continuous time, SI units where units are known, frequencies in rad/s, `u = K y` (the sign is part of K),
//! generalised plants with inputs [w; u] and outputs [z; y]. The crate reads no file and prints nothing.
//!
//! Determinism: every sum has its order in the code, elementary functions are those of `libm` in Rust, and searches are seeded, so
//! results have the same bits on every processor and with any number of threads.

pub mod balance;
pub mod delay;
mod double_double;
pub mod full_order;
pub mod interconnect;
pub mod linalg;
pub mod matrices;
pub mod mu;
pub mod norm;
mod parallel;
pub mod reduce;
mod rng;
pub mod robot;
pub mod state_space;
pub mod tuner;
