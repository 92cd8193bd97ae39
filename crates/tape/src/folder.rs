//! The run folder, which contains everything that one run produces.
//!
//! ```text
//! plan.toml                  the scenario with every default filled in
//! run.json                   versions, host, command line, files
//! summary.json               verdict and figures of merit
//! log/<participant>.stderr   the standard error of each participant
//! tape/                      see `tape`
//! outputs.json               the files that were written into the folder on request
//! ```

mod outputs;
mod paths;
mod reservation;
mod utc;

pub use outputs::{OUTPUTS_FILE, record_outputs};
pub use paths::{FolderError, REQUIRED_FILES, RUN_ENTRIES, RunFolder, private_dir_builder};
pub use reservation::Reservation;
pub use utc::{utc_compact, utc_text};
