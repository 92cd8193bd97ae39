//! The folder of a campaign: identity, journal, table, and the points whose runs are kept.

pub(super) mod any_path;
pub(super) mod campaign_folder;
pub(super) mod identity;
pub(super) mod journal;
pub(super) mod keep;
pub(super) mod points;
pub(super) mod recall;
pub(super) mod status;
pub(super) mod table;
