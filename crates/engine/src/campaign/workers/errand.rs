//! Points that are to be run, and what for.

use std::collections::VecDeque;

use crate::campaign::folder::claim::Known;
use crate::campaign::folder::identity::Identity;

/// A point to be run.
#[derive(Debug, Clone, Copy)]
pub(super) struct Errand {
    /// From 0.
    pub(super) point: usize,
    pub(super) what: What,
}

/// Use of a result.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum What {
    /// It is the point's result.
    Own,
    /// It is compared with the result of another shard.
    Audit,
    /// It is already known; the run folder is requested.
    Again,
}

/// The points that the folder is for and does not have: its own, then those of another shard.
pub(super) fn open_points(known: &Known, identity: &Identity) -> VecDeque<Errand> {
    let all = 0..known.results.len();
    let own = all
        .clone()
        .filter(|&at| identity.owns(at) && known.results[at].is_none());
    let others = all
        .filter(|at| identity.audits(*at))
        .filter(|at| !known.audited.contains(at));
    let errand = |what| move |point| Errand { point, what };
    own.map(errand(What::Own))
        .chain(others.map(errand(What::Audit)))
        .collect()
}
