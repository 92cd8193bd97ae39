//! Structured H-infinity tuning: gains of a given structure that minimise the largest of several channel norms over
//! several models.
//!
//! 1. **Stabilise**: descend on the spectral abscissa until every model is stable (Burke, Henrion, Lewis, Overton 2006).
//! 2. **Descend** on the logarithm of the largest norm by BFGS with a weak Wolfe line search.
//! 3. **Finish** with a bundle of the active pieces, in the metric that 2 has learnt, and go back to 2 while that helps.
//! 4. **Certify**: the smallest element of the convex hull of the active gradients.
//!
//! Growing gains have a small price, so that an infimum at infinite gain does not draw the search to where rounding decides;
//! the [`Verdict`] says when a result is no optimum.
//!
//! Several starts, each its own deterministic run; threads only decide when a run happens, never what it does.

mod bundle;
mod certificate;
mod descent;
mod gains;
mod objective;
mod options;
mod problem;
pub(crate) mod qp;
mod region;
mod run;
mod search;
mod state_feedback;
mod verdict;
mod yardstick;

pub use certificate::Certificate;
pub use gains::{GainBlock, GainError, GainKind};
pub use options::{Flow, Options, Phase, Progress};
pub use problem::{Channel, Model, Problem, TuneError};
pub use run::{ChannelReport, Evaluation, Tuned, controllers, evaluate, tune};
pub use verdict::Verdict;
