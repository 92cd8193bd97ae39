//! System structures (SSP 1.0 and 2.0) as scenarios.
//!
//! [`import`] reads a package, flattens its systems, and returns a scenario as text together with the FMUs. No code of an FMU is executed.
//! A package may come from an untrusted source: its archive and its XML are checked, and everything that a scenario cannot express is
//! rejected with file and line, all problems at once.
//!
//! # Example
//!
//! ```no_run
//! let imported = ssp::import("system.ssp".as_ref(), ssp::Options::default())?;
//! std::fs::write("system.toml", &imported.scenario)?;
//! for (name, content) in &imported.fmus {
//!     std::fs::write(name, content)?;
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! A package without a system structure is an error that names the file:
//!
//! ```
//! let package = ssp::Package::Files(Default::default());
//! let error = ssp::import_package("system.ssp".as_ref(), &package, ssp::Options::default()).unwrap_err();
//! assert!(error.to_string().contains("system.ssp"));
//! ```

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
