//! Recording of a run: which samples are recorded, guarded and written, and where they go.

pub mod faults;
pub(super) mod guard;
pub(super) mod newest;
pub(super) mod observed;
pub(super) mod participant_events;
pub(super) mod recorded_part;
pub(super) mod recorder;
pub(super) mod store;
pub(super) mod streams;
pub(super) mod tape_mapping;
