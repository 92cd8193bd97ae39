//! The campaign file that declares a campaign's points, as recorded in the folder: it determines how the points are
//! recomputed.

use serde::{Deserialize, Serialize};
use tape::Digest;

use super::folder::any_path::AnyPath;

/// A campaign file. Its points follow from the file, from the scenario with the changes that all points share, and from
/// their number.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Source {
    /// The absolute path of the file; in a bundle relative to the bundle.
    pub file: AnyPath,
    /// The digest of its content, without the scenario and the number of points.
    pub digest: Digest,
    /// The one-line description; empty where there is none.
    pub title: String,
    /// The dispersions whose Sobol' indices can be estimated, in the order of their matrices.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub factors: Option<Vec<String>>,
    /// Whether the points are a sample: one draw each, so that confidence intervals hold.
    #[serde(default)]
    pub sample: bool,
    /// Whether adding points leaves the existing ones unchanged.
    pub grows: bool,
    /// Whether later points depend on the results of earlier ones, so that only the file and the folder together determine
    /// them.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub rare: bool,
}
