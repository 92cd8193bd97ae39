//! The executor that runs every participant in its own process: start, supervision, placement and shutdown of the processes.

pub(super) mod child;
pub(super) mod descriptions;
pub(super) mod executor;
pub(super) mod handshake;
pub(super) mod monitor;
pub(super) mod participants;
pub(super) mod placement;
pub mod port_discovery;
pub(super) mod ports;
pub(super) mod process_state;
pub(super) mod relocation;
pub mod resources;
pub(super) mod run_services;
pub(super) mod sigbus;
pub(super) mod stall;
pub(super) mod start_up;
pub(super) mod time_slices;
