//! System structures (SSP 1.0 and 2.0) as scenarios.
//!
//! A package is read, its systems are flattened, and what comes out is a scenario as text with the FMUs beside it: [`import`]. Nothing
//! of an FMU runs. A package comes from anybody: its archive and its XML are checked, and what a scenario cannot express is
//! refused with file and line, everything at once.

mod connect;
mod error;
mod import;
mod mapping;
mod numbers;
mod package;
mod parameters;
mod read;
mod structure;
mod trace;
mod transform;
mod values;
mod xml;

pub use error::{Problem, SspError};
pub use import::{Imported, Options, import, import_package};
pub use package::Package;
