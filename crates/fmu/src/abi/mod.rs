//! The functions of an FMU's library, as the C headers of FMI 2.0 and 3.0 have them.
//!
//! Only what a co-simulation needs: the bindings are small enough to stand here, so a step calls the FMU and nothing else. All calls of
//! foreign code are in this module.

mod interface;
mod library;
mod log;
mod three;
mod two;

pub use interface::{Instance, Native, Status, Texts, Values};
pub use library::LoadError;
pub use log::{Log, to_standard_error};

use std::path::Path;

use crate::description::{Description, Version};

/// Loads the library of the FMU that is unpacked in `folder` and makes an instance called `name`.
///
/// # Errors
/// Names the library or the function, with what the FMU wrote into its log.
pub fn instantiate(
    description: &Description,
    library: &Path,
    folder: &Path,
    name: &str,
    log: &Log,
) -> Result<Box<dyn Instance>, LoadError> {
    Ok(match description.version {
        Version::Two => Box::new(two::Two::new(description, library, folder, name, log)?),
        Version::Three => Box::new(three::Three::new(description, library, folder, name, log)?),
    })
}
