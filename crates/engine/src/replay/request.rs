//! What is to be replayed.

use std::path::Path;
use std::sync::Arc;

use lockstep::time::Rational;

use crate::Catalogue;
use crate::scenario::RunSpec;

/// What is replayed.
pub struct Request<'a> {
    /// What builtin participants are made of.
    pub catalogue: &'a Arc<Catalogue>,
    /// The folder of the recorded run.
    pub folder: &'a Path,
    /// The participant that is replayed.
    pub participant: &'a str,
    /// Changes of the plan, each `key.path=value`.
    pub overrides: &'a [String],
    /// A program in the participant's place, with its arguments.
    pub program: Option<(&'a Path, &'a [String])>,
    /// What runs in the participant's place, as the plan would say it.
    pub run: Option<&'a RunSpec>,
    /// Replay no further than this.
    pub to: Option<Rational>,
    /// Also when the tape is not what was sealed.
    pub unverified: bool,
}
