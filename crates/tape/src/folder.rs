//! The run folder, which contains everything that one run produces.
//!
//! ```text
//! plan.toml                  the scenario with every default filled in
//! run.json                   versions, host, command line, files
//! summary.json               verdict and figures of merit
//! log/<participant>.stderr   what each participant said
//! tape/                      see `tape`
//! outputs.json               what was written into the folder on request
//! ```

mod claim;
mod outputs;
mod place;
mod utc;

pub use claim::Claim;
pub use outputs::note_outputs;
pub use place::{FolderError, MARKS, RECORD, RunFolder, private};
pub use utc::{utc_compact, utc_text};
