//! Bindings to the functions of an FMU's library, according to the C headers of FMI 2.0 and 3.0.
//!
//! Only the functions that co-simulation needs: the bindings are small enough to be written here, so a step calls the FMU
//! directly. All calls of foreign code are in this module.

mod fmi2;
mod fmi3;
mod guarded;
mod interface;
mod library;
mod log;
mod threads;

#[cfg(test)]
pub use interface::Stepped;
pub use interface::{Instance, Native, StateError, Status, Texts, Values};
pub use library::LoadError;
pub use log::{Log, to_standard_error};

use std::path::Path;

use crate::description::{Description, Version};
use guarded::Guarded;

/// Loads the library of the FMU that is unpacked in `folder` and creates an instance called `name`. `own_process` where nothing else
/// depends on the process: the orchestrator then sees that it has ended, and with which status.
///
/// # Errors
/// Names the library or the function, with the FMU's log.
pub fn instantiate(
    description: &Description,
    library: &Path,
    folder: &Path,
    name: &str,
    log: &Log,
    own_process: bool,
) -> Result<Box<dyn Instance>, LoadError> {
    const INSTANTIATE: &str = "its library's initialisation or in Instantiate";
    let guard = guarded::guard(name, own_process);
    let own = guard.clone();
    Ok(match description.version {
        Version::Fmi2 => {
            let load = || fmi2::Fmi2Instance::new(description, library, folder, name, log, own);
            let instance = guard.call(INSTANTIATE, load)?;
            Box::new(Guarded { instance, guard })
        }
        Version::Fmi3 => {
            let load = || fmi3::Fmi3Instance::new(description, library, folder, name, log, own);
            let instance = guard.call(INSTANTIATE, load)?;
            Box::new(Guarded { instance, guard })
        }
    })
}
