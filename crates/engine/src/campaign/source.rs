//! The campaign file that declares a campaign's points, as its folder knows it: how they are made again.

use serde::{Deserialize, Serialize};
use tape::Digest;

use super::any_path::AnyPath;

/// A campaign file. Its points follow from it, from the scenario with the changes that all points share, and from their number.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Source {
    /// The file, from the root on; in a bundle relative to it.
    pub file: AnyPath,
    /// Of everything that it says besides its scenario and the number of points.
    pub digest: Digest,
    /// One line about it; empty where there is none.
    pub title: String,
    /// The dispersions whose Sobol' indices can be told, in the order of their matrices.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub factors: Option<Vec<String>>,
    /// Whether more points leave those as they are that there were.
    pub grows: bool,
    /// Whether later points depend on what became of those before, so that the file and the folder say together which they are.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub rare: bool,
}
