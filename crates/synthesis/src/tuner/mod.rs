//! Structured H-infinity tuning: gains of a given structure that minimise the largest of several channel norms over
//! several models.
//!
//! 1. **Stabilise**: descend on the spectral abscissa until every model is stable (Burke, Henrion, Lewis, Overton 2006).
//! 2. **Descend** on the logarithm of the largest norm by BFGS with a weak Wolfe line search.
//! 3. **Finish** with a bundle of the active pieces, in the metric from 2, and return to 2 while that improves the result.
//! 4. **Certify**: the smallest element of the convex hull of the active gradients.
//!
//! Growing gains are slightly penalised, so that an infimum at infinite gain does not lead the search to where rounding decides;
//! the [`Verdict`] reports when a result is no optimum.
//!
//! Several starts, each a separate deterministic run; threads affect only when a run is executed, never its result.

mod bundle;
mod certificate;
mod descent;
mod divergence;
mod gain_units;
mod gains;
mod growth_penalty;
mod objective;
mod options;
mod problem;
pub(crate) mod qp;
mod run;
mod search;
mod state_feedback;
mod verdict;

pub use certificate::Certificate;
pub use gains::{GainBlock, GainError, GainKind};
pub use options::{Options, Phase, SearchControl, TuningProgress};
pub use problem::{Channel, Model, Problem, TuneError};
pub use run::{ChannelReport, Evaluation, Tuned, controllers, evaluate, tune};
pub use verdict::Verdict;
