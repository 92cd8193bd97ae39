//! Bindings to the functions of an FMU's library, according to the C headers of FMI 2.0 and 3.0.
//!
//! Only the functions that co-simulation needs: the bindings are small enough to be written here, so a step calls the FMU
//! directly. All calls of foreign code are in this module.

mod interface;
mod library;
mod log;
mod three;
mod two;

#[cfg(test)]
pub use interface::Stepped;
pub use interface::{Instance, Native, Status, Texts, Values};
pub use library::LoadError;
pub use log::{Log, to_standard_error};

use std::path::Path;

use crate::description::{Description, Version};

/// Loads the library of the FMU that is unpacked in `folder` and creates an instance called `name`.
///
/// # Errors
/// Names the library or the function, with the FMU's log.
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
