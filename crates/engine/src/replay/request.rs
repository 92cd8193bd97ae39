//! The request for a replay: the run, the participant, and what is changed.

use std::path::Path;
use std::sync::Arc;

use lockstep::time::Rational;

use crate::Catalogue;
use crate::scenario::RunSpec;

/// The request for a replay.
pub struct Request<'a> {
    /// Where builtin participants come from.
    pub catalogue: &'a Arc<Catalogue>,
    /// The folder of the recorded run.
    pub folder: &'a Path,
    /// The participant that is replayed.
    pub participant: &'a str,
    /// Changes of the plan, each `key.path=value`.
    pub overrides: &'a [String],
    /// A program that replaces the participant's, with its arguments.
    pub program: Option<(&'a Path, &'a [String])>,
    /// The `run` that replaces the participant's, as in a plan.
    pub run: Option<&'a RunSpec>,
    /// Replay no further than this instant.
    pub to: Option<Rational>,
    /// Replay even if the tape does not match its seal.
    pub unverified: bool,
}
