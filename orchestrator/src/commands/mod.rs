//! One file per command; each returns the exit code.

pub mod bench;
pub mod check;
pub mod compare;
pub mod doctor;
pub mod graph;
pub mod participant;
pub mod run;
