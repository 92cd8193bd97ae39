//! The pace of a run: granted time, the wall clock, and how well the run keeps up with it.

pub(super) mod clock_controller;
pub(super) mod lateness;
pub(super) mod report;
pub(super) mod spans;
mod suspensions;
pub(super) mod trace;
pub(super) mod traced;
pub(super) mod wall_clock;
