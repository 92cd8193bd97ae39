//! Common parts of `tune` and `margins`: files of gains, computed entries, tables and plots.

mod entries;
mod files;
mod lookup;
mod plots;
mod reporter;
mod sliding;
mod tables;

pub use entries::{channel_entries, contradictions, margin_entries, optima, sampled_entries, validation_entry};
pub use files::{at_line, files_of, finite, json, load, write};
pub use lookup::{look_up, override_with, restore_recorded_angles};
pub use plots::plots;
pub use reporter::Reporter;
pub use sliding::{sliding_gain, take_sliding_gain};
pub use tables::{print_closed_loop, print_margins, print_sampled, print_validation};

/// The number of threads to use.
pub fn threads() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}
