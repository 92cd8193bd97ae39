//! Points that are to be run, and what for.

use std::collections::VecDeque;

use crate::campaign::folder::campaign_folder::JournaledResults;
use crate::campaign::folder::identity::Identity;

/// A point to be run.
#[derive(Debug, Clone, Copy)]
pub(super) struct PendingPoint {
    /// From 0.
    pub(super) point: usize,
    pub(super) purpose: Purpose,
}

/// Use of a result.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Purpose {
    /// It is the point's result.
    Own,
    /// It is compared with the result of another shard.
    Audit,
    /// It is already known; the run folder is requested.
    Rerun,
}

/// The points that the folder is for and does not have: its own, then those of another shard.
pub(super) fn missing_points(known: &JournaledResults, identity: &Identity) -> VecDeque<PendingPoint> {
    let all = 0..known.results.len();
    let own = all
        .clone()
        .filter(|&at| identity.owns(at) && known.results[at].is_none());
    let others = all
        .filter(|at| identity.audits(*at))
        .filter(|at| !known.audited.contains(at));
    let pending_point = |purpose| move |point| PendingPoint { point, purpose };
    own.map(pending_point(Purpose::Own))
        .chain(others.map(pending_point(Purpose::Audit)))
        .collect()
}
