//! The structured singular value: how large an uncertainty of known structure a loop tolerates.
//!
//! For M and a set of block-diagonal Δ, `1/μ(M)` is the size of the smallest Δ in the set for which `I − MΔ` is singular.
//! Computing μ is NP-hard, so there are two bounds: [`upper_bound`] is convex and proves robustness, [`lower_bound`]
//! exhibits a perturbation. [`margin`] does both for a closed loop and all frequencies.

mod centre;
mod destabilise;
mod interval_certificate;
mod lower;
mod margin;
mod options;
mod scalings;
mod structure;

pub use lower::{Singular, lower_bound};
pub use margin::{Margin, margin};
pub use options::{Destabilising, MarginOptions};
pub use scalings::{Scalings, UpperBound, upper_bound};
pub use structure::{Block, MuError, Structure};
